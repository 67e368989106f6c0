"""The open warnings of the hangers of a workspace, from what its store says.

Nothing here imports what computes: `shm status` asks it, too.

What has changed since a hanger's baseline was made, of what it was made from: the description,
where that moves results, and the tests.

The description stands beside each posterior since there were such comparisons; of an older baseline
nothing is known, and so nothing is said.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, fields, is_dataclass
from functools import partial
from typing import Any

from shm.documents import dump
from shm.pipeline.ending import SHM
from shm.report.open_warnings import nearly_slack, open_warnings, passed_over, standing_out
from shm.store import (
    Baseline,
    BaselineGlance,
    Silence,
    Stage,
    Store,
    StoredWatch,
    TrendPoint,
    Workspace,
)
from shm.store.checksums import of_readable
from shm.store.stored_alerts import said_of
from shm.values import TENSION, Hanger


def warnings_of(
    workspace: Workspace, store: Store, hangers: Sequence[Hanger]
) -> dict[int, tuple[str, ...]]:
    """The open warnings of each of `hangers` that has a baseline, by hanger."""
    every = workspace.bridge.hangers
    latest = of_readable(partial(store.watch.latest, hangers=hangers), {})
    now, baselines = store.posteriors.latest_trends(hangers), store.watch.baselines_in_force(every)
    works = [each for each in store.silences.list_all() if each.is_maintenance]
    return warnings_from(every, hangers, baselines, latest, now, works)


def warnings_from(
    every: Sequence[Hanger],
    hangers: Sequence[Hanger],
    baselines: Mapping[int, BaselineGlance],
    latest: Mapping[int, StoredWatch],
    now: Mapping[int, TrendPoint],
    works: Sequence[Silence],
) -> dict[int, tuple[str, ...]]:
    """The same of what was asked already: the `baselines` of `every` hanger of the bridge.

    `works` are maintenance windows.
    """
    tensions = {id_: each.averaged.tension_n for id_, each in baselines.items()}

    def slack(hanger: Hanger) -> str:
        watched = latest[hanger.id].watched if hanger.id in latest else None
        if hanger.id not in now or watched is None:
            return ""
        level = hanger.thresholds.alert_probability
        is_told = any(d.quantity == TENSION and d.probability >= level for d in watched.drifts)
        of_test = now[hanger.id].averaged.tension_n
        return nearly_slack(hanger, tensions[hanger.id], of_test, is_told=is_told)

    def of_works(hanger: Hanger) -> str:
        point, watched = now.get(hanger.id), latest.get(hanger.id)
        if point is None or point.test in baselines[hanger.id].tests:
            return ""
        if watched is not None and watched.watched.time >= point.time:
            return ""
        windows = [each for each in works if each.covers(hanger.id, point.time)]
        return passed_over(hanger, said_of(windows[-1])) if windows else ""

    return {
        hanger.id: open_warnings(
            hanger,
            baselines[hanger.id].check,
            standing_out(hanger, every, tensions),
            latest[hanger.id].watched if hanger.id in latest else None,
            (slack(hanger), of_works(hanger)),
        )
        for hanger in hangers
        if hanger.id in baselines
    }


MOVES_NOTHING = frozenset(
    {"id", "name", "thresholds", "limits", "models", "effect_priors"}
    | {"scatter.sensor_gain", "scatter.sensor_place_m", "scatter.sensor_turn_deg"}
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
