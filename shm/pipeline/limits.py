"""Alerts of a tension beyond the limits that its owner sets: one a crossing.

The limit judges what the pages say of the latest test; no baseline is needed. The alert ends once
the tension is improbably beyond the limit, or the limit is another.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from math import isfinite

from shm.pipeline.ending import SHM
from shm.store import Store, StoredAlert, Workspace
from shm.store.list_rows import TrendPoint
from shm.values import Alert, AlertKind, Averaged, Hanger

_KIND: AlertKind = "limit"


def heed_limits(
    workspace: Workspace, store: Store, hangers: Iterable[Hanger], at: datetime
) -> None:
    """Raises and ends what the limits of hangers call for, by the latest test of each."""
    standing = store.alerts.list_all(standing=True)
    told = {each.alert.hanger for each in standing if _KIND in each.alert.kinds}
    modelled = (each for each in hangers if each.is_modelled)
    asked = [each for each in modelled if each.id in told or any(_limits(each))]
    points = store.posteriors.latest_trends(asked) if asked else {}
    hooks = [hook.name for hook in workspace.bridge.hooks]
    for hanger in asked:
        if (point := points.get(hanger.id)) is None:
            continue
        alerts = store.alerts.list_all(hanger.id)
        own = [each for each in alerts if _KIND in each.alert.kinds]
        ended = dict(_ended(own, hanger, point))
        for side in _limits(hanger):
            alert = _alert(store, hanger, side, point, own)
            if alert or ended:
                store.alerts.settle(alert, hooks, ended, at)
                ended = {}
        if ended:
            store.alerts.settle(None, hooks, ended, at)


def _limits(hanger: Hanger) -> Iterator[str]:
    """The limits that are set, each as its alerts name it in their keys."""
    limits = hanger.limits
    for side, value_n in (("above", limits.tension_max_n), ("below", limits.tension_min_n)):
        if isfinite(value_n):
            yield f"{side}-{value_n:.6g}"


def _probability(averaged: Averaged, side: str) -> float:
    above = side.startswith("above")
    return averaged.probability_above_limit if above else averaged.probability_slack


def _ended(
    own: Sequence[StoredAlert], hanger: Hanger, point: TrendPoint
) -> Iterator[tuple[int, str]]:
    sides = set(_limits(hanger))
    for each in own:
        side = _side(each)
        if each.resolution is not None:
            continue
        if side not in sides:
            yield each.id, "the limit has been changed"
        elif _probability(point.averaged, side) < hanger.thresholds.end_probability:
            yield each.id, f"test {point.test} has it within the limit"


def _alert(
    store: Store, hanger: Hanger, side: str, point: TrendPoint, own: Sequence[StoredAlert]
) -> Alert | None:
    """That the limit of a side is crossed; None where it is not, or was told."""
    probability, level = _probability(point.averaged, side), hanger.thresholds.alert_probability
    same = [each for each in own if _side(each) == side]
    if not probability >= level or (same and not _is_another_crossing(store, hanger, same[-1])):
        return None
    from shm.report.hanger_status import off_limits  # it computes: not before it is needed

    lead = off_limits(hanger, point.averaged)
    key = f"hanger-{hanger.id}:{_KIND}:{side}:{point.test_id}"
    key += f":again-{same[-1].id}" if same else ""
    sure = "above 0.99" if probability > 0.99 else f"{probability:.2f}"
    return Alert(
        key=key,
        hanger=hanger.id,
        test=point.test,
        time=point.time,
        message=f"{lead.words if lead else ''} Details: probability {sure} that it is {side[:5]} "
        f"the limit of {float(side[6:]) / 1e3:.6g} kN that its owner has set.",
        drifts=(),
        kinds=(_KIND,),
        tension=point.averaged,
    )


def _is_another_crossing(store: Store, hanger: Hanger, last: StoredAlert) -> bool:
    """Whether the tension was back since the last alert: what a person has resolved while it was
    beyond its limit is not told again."""
    if last.resolution is None:
        return False
    if last.resolution.who == SHM:
        return True
    side, end = _side(last), hanger.thresholds.end_probability
    since = store.posteriors.trend(hanger, last.alert.time)
    return any(_probability(each.averaged, side) < end for each in since)


def _side(stored: StoredAlert) -> str:
    return stored.alert.key.split(":")[2]
