"""What has changed since a hanger's baseline was made, of what it was made from: the description,
where that moves results, and the tests.

The description stands beside each posterior since there were such comparisons; of an older baseline
nothing is known, and so nothing is said.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, asdict, fields, is_dataclass
from typing import Any

from shm.documents import dump
from shm.pipeline.ending import SHM
from shm.store import Baseline, Stage, Store
from shm.values import Hanger

MOVES_NOTHING = frozenset(
    {"id", "name", "thresholds", "limits", "models", "effect_priors"}
    | {"scatter.sensor_gain", "scatter.sensor_place_m", "scatter.sensor_turn_deg"}
    | {"scatter.sensor_cross_axis"}
)
"""What no posterior depends on: names, what an owner calls much, which classes may compete, and
what is of the gap diagnosis alone."""


def redescribed(hanger: Hanger, baseline: Baseline | None) -> tuple[str, ...]:
    """What has changed since the baseline was made, as `length_m from 12 to 12.4`."""
    if baseline is None or baseline.described is None:
        return ()
    before, now = _comparable(baseline.described), _comparable(asdict(hanger))
    return tuple(_changes(before, now))


def discarded_of(store: Store, baseline: Baseline | None) -> tuple[str, ...]:
    """The tests of a baseline that count no more, by name: a person has discarded them since.

    A day of a stream in whose place the whole day stands measured the same, of fewer hours.
    """
    tests = () if baseline is None else store.tests.of_baseline(baseline)
    refused = [each for each in tests if each.stage == Stage.REFUSED]
    out = [(each, store.recordings.discard_in_force(each.recording_id)) for each in refused]
    return tuple(each.test.id for each, why in out if why is None or why.who != SHM)


def _comparable(described: Mapping[str, Any]) -> dict[str, Any]:
    """As it stands in a document; what an older version did not know has its default."""
    told: dict[str, Any] = {}
    for each in fields(Hanger):
        default = each.default_factory() if each.default_factory is not MISSING else each.default
        if each.name in MOVES_NOTHING:
            continue
        if is_dataclass(default) and not isinstance(default, type):
            default = asdict(default)
        stated = described.get(each.name, default)
        if isinstance(default, dict) and isinstance(stated, Mapping):
            stated = {**default, **stated}
        if stated is not MISSING:
            told[each.name] = stated
    plain: dict[str, Any] = json.loads(dump(told))
    return plain


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
    return f" from {_told(old)} to {_told(new)}"


def _told(value: object) -> str:
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)
