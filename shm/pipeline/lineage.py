"""Settings shared by the steps: classes, seeds, refusals, lineage of results and its changes.

Nothing here imports what computes, so that the daemon itself begins quickly and stays small.

The description stands beside each posterior since there were such comparisons; of an older baseline
nothing is known, and so nothing is said.
"""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass, replace
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from shm.assumptions import DEFAULTS, number_text
from shm.documents import compact
from shm.pipeline.reconcile import SHM
from shm.read import Limits
from shm.settings import TABLE, Settings
from shm.store import (
    Baseline,
    BaselineGlance,
    Lineage,
    Store,
    StoredRecording,
    StoredTest,
    Workspace,
)
from shm.store.recordings import find_discard
from shm.store.tests import list_refused_of_baselines
from shm.values import Hanger, Posterior

if TYPE_CHECKING:
    from shm.models import Model

IDENTIFY_SETTINGS = (
    "band_low_hz", "band_high_hz", "identifier", "cross_check", "estimator", "reference_force_n",
    "frequency_allowance", "mains_hz",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Taught:
    """The posterior of a test whose tension was read, too, of the same hanger or of a sibling."""

    posterior: Posterior
    same_hanger: bool


@dataclass(frozen=True, eq=False)
class Terms:
    """Options of an update: samples, seed, priors, and what a measured tension has taught."""

    samples: int
    seed: int
    priors: str
    taught: Taught | None = None


def competing(hanger: Hanger, settings: Settings, selected: Mapping[int, str]) -> tuple[Model, ...]:
    """The selected class of a hanger, or all that compete where none is selected yet.

    Raises UsageError where the selected class does not apply to the hanger, or none does.
    """
    from shm.models import build, competing_names  # not before they are needed

    if hanger.id in selected:
        return (build(selected[hanger.id], hanger, settings.priors),)
    names = competing_names(hanger, settings.model_names)
    return tuple(build(name, hanger, settings.priors) for name in names)


def identify_settings(settings: Settings) -> dict[str, Any]:
    """The settings that decide what an identification gives, by name."""
    return {name: getattr(settings, name) for name in IDENTIFY_SETTINGS}


def read_limits(settings: Settings) -> Limits:
    """Return what one file may hold and what reading it may cost."""
    return Limits(**{each.name: getattr(settings, each.name) for each in fields(Limits)})


def identify_lineage(
    recording: StoredRecording, hanger_id: int | None, workspace: Workspace
) -> Lineage:
    """Return the lineage of tests: file, sidecar, settings, description, version."""
    bridge = workspace.bridge
    inputs = [recording.file.sha256, recording.file.sidecar_as]
    terms = {
        **identify_settings(workspace.settings),
        "hanger": [_described(hanger) for hanger in bridge.watched if hanger.id == hanger_id],
        "disturbances": [asdict(each) for each in bridge.disturbances],
    }
    return Lineage.of(inputs, terms)


def _described(hanger: Hanger) -> dict[str, Any]:
    """Return the description that results depend on: without how the bar was measured."""
    return {key: value for key, value in asdict(hanger).items() if key != "survey"}


def diagnosis_lineage(
    tests: Sequence[StoredTest], hanger: Hanger, terms: Mapping[str, Any]
) -> Lineage:
    """Return what a diagnosis depends on: tests, description, options, version."""
    inputs = [[test.key, test.lineage.columns] for test in tests]
    return Lineage.of(inputs, {**terms, "hanger": _described(hanger)})


def update_terms(
    hanger: Hanger,
    models: Sequence[str],
    tests: Sequence[StoredTest],
    settings: Settings,
    known: Posterior | None = None,
    taught: Taught | None = None,
) -> tuple[Terms, Lineage]:
    """Terms and lineage of an update; the seed depends on what is updated alone."""
    seed = seed_of(settings.seed, [test.key for test in tests])
    terms = Terms(settings.samples, seed, settings.priors, taught)
    plain = {"samples": terms.samples, "seed": seed, "priors": terms.priors}
    inputs: list[object] = [[test.key, test.lineage.columns] for test in tests]
    from_others = [known, taught.posterior if taught else None]
    inputs += [hashlib.sha256(each.samples.tobytes()).hexdigest() for each in from_others if each]
    described = _described(hanger)
    settled = {"models": list(models), **plain, "hanger": described}
    return terms, Lineage.of(inputs, settled, described)


def seed_of(seed: int, keys: Sequence[str]) -> int:
    """The seed of one result: the same in whatever order and wherever it is computed."""
    text = "\n".join([str(seed), *sorted(keys)])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4])


_ALL = (*IDENTIFY_SETTINGS, "models", "samples", "seed", "baseline_tests", "false_call_years")
_LIBRARIES = ("numpy", "scipy", "emcee")


def test_lineage(store: Store, test: StoredTest) -> dict[str, str]:
    """The file of a test, the checksums of what its modes come from, the software."""
    file = store.recordings.get(test.recording_id)
    return {
        "file_name": file.file.file_name,
        "file_sha256": file.file.sha256,
        "received": f"{file.received_at:%Y-%m-%d %H:%M} UTC, {file.file.size_bytes} bytes",
        "input_sha256": test.lineage.input_sha256,
        "settings_sha256": test.lineage.settings_sha256,
        "version": test.lineage.version,
        "software": software(),
    }


@cache
def software() -> str:
    """`Python 3.11.2, numpy 2.4.1 ...`: what computes here."""
    libraries = [f"{name} {version(name)}" for name in _LIBRARIES]
    return ", ".join((f"Python {platform.python_version()}", *libraries))


def settings_words(settings: Settings, names: Sequence[str] = _ALL) -> dict[str, str]:
    """The settings that decide the numbers of a report, each with its unit."""
    units = {row.name: row.unit for row in TABLE}
    return {name: f"{getattr(settings, name)} {units[name]}".rstrip() for name in names}


MOVES_NOTHING = frozenset(
    {"id", "name", "thresholds", "limits", "models", "effect_priors", "survey"}
    | {"scatter.sensor_gain", "scatter.sensor_place_m", "scatter.sensor_turn_deg"}
    | {"scatter.sensor_cross_axis"}
    | {f"assumptions.{name}" for name in ("sensor_gain_sd", "sensor_place_sd_m")}
    | {f"assumptions.{name}" for name in ("sensor_turn_sd_deg", "sensor_cross_axis_sd")}
)
"""What no posterior depends on: names, what an owner calls much, which classes may compete, and
what is of the gap diagnosis alone."""


def redescribed(hanger: Hanger, baseline: Baseline | BaselineGlance | None) -> tuple[str, ...]:
    """Return what has changed since the baseline was made, as `length_m from 12 to 12.4`."""
    if baseline is None or baseline.described is None:
        return ()
    described = json.loads(compact(_described(hanger)))
    if described == baseline.described:  # as a rule, and what follows takes five times as long
        return ()
    before, now = _comparable(baseline.described), _comparable(described)
    return tuple(_changes(before, now))


def discarded_of_baselines(store: Store) -> dict[int, tuple[str, ...]]:
    """Return the tests of baselines in force that people have discarded since, by hanger.

    A day of a stream that was replaced by the complete day measured the same, of fewer hours.
    """
    found: dict[int, tuple[str, ...]] = {}
    for hanger, name, recording_id in list_refused_of_baselines(store):
        why = find_discard(store, recording_id)
        if why is None or why.who != SHM:
            found[hanger] = (*found.get(hanger, ()), name)
    return found


def _comparable(described: Mapping[str, Any]) -> dict[str, Any]:
    """As it stands in a document; what an older version did not know has its default."""
    document: dict[str, Any] = {}
    for each in fields(Hanger):
        default = each.default_factory() if each.default_factory is not MISSING else each.default
        if each.name in MOVES_NOTHING:
            continue
        if each.name == "assumptions":
            document[each.name] = _assumed(described.get(each.name, {}))
            continue
        if is_dataclass(default) and not isinstance(default, type):
            default = asdict(default)
        stated = described.get(each.name, default)
        if isinstance(default, dict) and isinstance(stated, Mapping):
            stated = {**default, **stated}
        if stated is not MISSING:
            document[each.name] = stated
    plain: dict[str, Any] = json.loads(compact(document))
    return plain


def _assumed(described: object) -> object:
    """Return the numbers of every assumption in words, of a description as it was stored.

    What is no table of assumptions is returned as it is: it differs from any.
    """
    if not isinstance(described, Mapping):
        return described
    numbers = _default_numbers()
    for row in described.get("overridden", ()):
        if row["name"] in numbers:
            stated = {key: row[key] for key in ("value", "sd", "lower", "upper")}
            known: dict[str, Any] = {
                key: math.nan if each is None else each for key, each in stated.items()
            }
            stated_now = number_text(replace(DEFAULTS[row["name"]], **known))
            numbers = {**numbers, row["name"]: stated_now}
    return numbers


@cache
def _default_numbers() -> Mapping[str, str]:
    return {name: number_text(row) for name, row in DEFAULTS.items()}


def _changes(before: Mapping[str, Any], now: Mapping[str, Any], within: str = "") -> Iterator[str]:
    for name in sorted({*before, *now}):
        old, new = before.get(name), now.get(name)
        if f"{within}{name}" in MOVES_NOTHING:
            continue
        if isinstance(old, dict) and isinstance(new, dict):
            yield from _changes(old, new, f"{within}{name}.")
        elif old != new:
            yield f"{within}{name}{_from_to(old, new)}"


def _from_to(old: object, new: object) -> str:
    """Lists and tables would be long: of them it is said that they changed."""
    if any(isinstance(each, dict | list) for each in (old, new)):
        return ""
    return f" from {_as_text(old)} to {_as_text(new)}"


def _as_text(value: object) -> str:
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)
