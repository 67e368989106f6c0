"""Alerts of a tension beyond the limits that its owner sets: one a crossing.

The limit judges what the pages say of the latest test; no baseline is needed. The alert ends once
the tension is improbably beyond the limit, or the limit is another.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from math import isclose, isfinite, isnan

from shm.pipeline.reconcile import Condition, reconcile
from shm.store import Store, StoredAlert, Workspace
from shm.store.posteriors import find_latest_trends, list_trend
from shm.store.rows import Ending, TrendPoint
from shm.values import Alert, AlertKind, Averaged, CrossedLimit, Hanger

_KIND: AlertKind = "limit"


def evaluate_limit_alerts(
    workspace: Workspace, store: Store, hangers: Iterable[Hanger], at: datetime
) -> None:
    """Open and close what the limits of hangers call for, by the latest test of each."""
    hooks = [hook.name for hook in workspace.bridge.hooks]
    for hanger in (each for each in hangers if each.is_modelled):
        known = [e for e in store.alerts.list_all(hanger.id) if _KIND in e.alert.kinds]
        is_open = [each for each in known if each.resolution is None]
        if not is_open and not any(_limits(hanger)):
            continue
        if (point := find_latest_trends(store, [hanger]).get(hanger.id)) is not None:
            conditions = list(_conditions(workspace, store, hanger, point, known))
            store.alerts.settle(reconcile(is_open, conditions), hooks, at)


def _conditions(
    workspace: Workspace,
    store: Store,
    hanger: Hanger,
    point: TrendPoint,
    known: Sequence[StoredAlert],
) -> Iterator[Condition]:
    limits, thresholds = tuple(_limits(hanger)), hanger.thresholds
    for each in known:
        if each.resolution is None and not any(_is_of(each.alert, limit) for limit in limits):
            yield Condition(each.alert, "over", "the limit has been changed")
    for limit in limits:
        probability = _probability(point.averaged, limit.side)
        same = [each for each in known if _is_of(each.alert, limit)]
        for each in same:
            if each.resolution is None and probability < thresholds.end_probability:
                yield Condition(each.alert, "over", f"test {point.test} has it within the limit")
        is_already_covered = same and not _is_another_crossing(store, hanger, same[-1])
        if probability >= thresholds.alert_probability and not is_already_covered:
            yield Condition(_alert(workspace, store, hanger, limit, point, same), "holds")


def _limits(hanger: Hanger) -> Iterator[CrossedLimit]:
    """Give the limits that are set."""
    limits = hanger.limits
    if isfinite(limits.tension_max_n):
        yield CrossedLimit("above", limits.tension_max_n)
    if isfinite(limits.tension_min_n):
        yield CrossedLimit("below", limits.tension_min_n)


def _probability(averaged: Averaged, side: str) -> float:
    return averaged.probability_above_limit if side == "above" else averaged.probability_slack


def _alert(
    workspace: Workspace,
    store: Store,
    hanger: Hanger,
    limit: CrossedLimit,
    point: TrendPoint,
    same: Sequence[StoredAlert],
) -> Alert:
    """Return the alert that a limit is crossed.

    It names its test where the best estimate since the last change is another tension.
    """
    # They compute: not before they are needed.
    from shm.pipeline.bridge_reporting import hanger_summaries
    from shm.report.hanger_status import off_limits

    probability = _probability(point.averaged, limit.side)
    (now,) = hanger_summaries(workspace, store, point.time, [hanger])
    is_headline = now.tension is not None and now.tension.tension_n == point.averaged.tension_n
    lead = off_limits(hanger, point.averaged, "" if is_headline else f" by test {point.test}")
    key = f"hanger-{hanger.id}:{_KIND}:{limit.side}-{limit.tension_n:.12g}:{point.test_id}"
    key += f":again-{same[-1].id}" if same else ""
    sure = "above 0.99" if probability > 0.99 else f"{probability:.2f}"
    return Alert(
        key=key,
        hanger=hanger.id,
        test=point.test,
        time=point.time,
        message=f"{lead.words if lead else ''} Details: probability {sure} that it is {limit.side} "
        f"the limit of {limit.tension_n / 1e3:.6g} kN that its owner has set.",
        drifts=(),
        kinds=(_KIND,),
        tension=point.averaged,
        limit=limit,
    )


def _is_another_crossing(store: Store, hanger: Hanger, last: StoredAlert) -> bool:
    """Return True where the tension was back since the last alert: what a person has resolved while
    it was beyond its limit is not told again."""
    if last.resolution is None:
        return False
    if last.resolution.ending is not Ending.BY_PERSON:
        return True
    side, end = _side(last.alert), hanger.thresholds.end_probability
    since = list_trend(store, hanger, last.alert.time)
    return any(_probability(each.averaged, side) < end for each in since)


def _is_of(alert: Alert, limit: CrossedLimit) -> bool:
    """Return True if an alert is of a limit; those of shm 1.0.0 are known by their side alone."""
    if alert.limit is None:
        return _side(alert) == limit.side
    same_value = isclose(alert.limit.tension_n, limit.tension_n, rel_tol=1e-9)
    return alert.limit.side == limit.side and same_value


def _side(alert: Alert) -> str:
    if alert.limit is not None:
        return alert.limit.side
    if alert.tension is None or isnan(alert.tension.probability_slack):
        return "above"
    above = alert.tension.probability_above_limit
    return "above" if above > alert.tension.probability_slack else "below"
