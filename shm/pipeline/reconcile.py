"""Alerts follow from what is the case now, compared with what is open: one call for all of them.

Tests, limits, silent streams and the sensors' watch each state their conditions. Done again, judged
again, late or after a changed threshold: `reconcile` is given the conditions of now and the alerts
that are open now, and decides what to open and what to close.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from shm.store import Reconciled, StoredAlert
from shm.values import Alert, AlertKind, Change, Drift, Moved

SHM = "shm"
"""Who ends an alert where tests do, and no person."""
State = Literal["holds", "over", "unknown"]

BEYOND: AlertKind = "beyond threshold"
OF_CHANGES = {BEYOND, "sudden change", "slow drift"}
REPEAT = ("repeat the test",)
_SDS = 2.0  # by which two measurements of one change differ once in twenty times


@dataclass(frozen=True)
class Condition:
    """Something that is the case, or was: the alert that tells of it, and why it is over.

    What neither holds nor is over opens and closes nothing. `baseline_id` is that against which
    tests show it, None of all else.
    """

    alert: Alert
    state: State
    why: str = ""
    baseline_id: int | None = None


def reconcile(open_alerts: Iterable[StoredAlert], conditions: Sequence[Condition]) -> Reconciled:
    """Return what to open and what to close so that the open alerts tell of what is the case.

    An open alert is closed whose condition is over. A condition that holds is opened where no alert
    tells of it that stays open or is opened with it.
    """
    over = {each.alert.key: each.why for each in conditions if each.state == "over"}
    to_close: dict[int, str] = {}
    left: list[StoredAlert] = []
    for each in open_alerts:
        if each.alert.key in over:
            to_close[each.id] = over[each.alert.key]
        else:
            left.append(each)
    to_open: list[Alert] = []
    for condition in conditions:
        if condition.state == "holds" and not _is_told(condition, to_open, left):
            to_open.append(condition.alert)
    return Reconciled(tuple(to_open), to_close)


def _is_told(condition: Condition, opened: Sequence[Alert], left: Sequence[StoredAlert]) -> bool:
    alert, own = condition.alert, condition.baseline_id
    same = [each.alert for each in left if each.baseline_id == own]
    # Of tests and of sensors; what was raised against another baseline is another event.
    other = (each.alert for each in left if (each.baseline_id is None) != (own is None))
    return tells([*opened, *same], alert) or any(is_same_event(each, alert) for each in other)


def with_free_key(alert: Alert, known: Iterable[StoredAlert]) -> Alert:
    """Return an alert under a key that none of those `known` has: a condition may come again."""
    first = alert.key.partition(":again-")[0]
    same = [each.id for each in known if each.alert.key.partition(":again-")[0] == first]
    return replace(alert, key=f"{first}:again-{max(same)}") if same else alert


def tells(known: Sequence[Alert], alert: Alert) -> bool:
    """Return True where alerts that are known tell already all that one says.

    Done again, a test may call for the same loss by other rules or a test later; and the watch may
    have taken the first for over, by its own count of visits.
    """
    kinds = set(alert.kinds)
    if any(each.key == alert.key for each in known):
        return True
    if not kinds <= OF_CHANGES:
        return False
    if BEYOND in kinds:
        told = {each for one in known if BEYOND in one.kinds for each in subjects_of(one)}
        if not alert.drifts or not subjects_of(alert) <= told:
            return False
    return kinds == {BEYOND} or any(covers_change(one, alert.change) for one in known)


def covers_change(told: Alert, change: Change | None) -> bool:
    """Return True where an alert tells of a change: of the same way, begun before it was told."""
    if change is None or not change.moved or not set(told.kinds) & OF_CHANGES:
        return False
    first = change.moved[0]
    moved: list[Drift | Moved] = [*told.drifts, *(told.change.moved[:1] if told.change else ())]
    return change.began_by <= told.time and any(
        each.quantity == first.quantity and each.shift_mean * first.shift_mean > 0 for each in moved
    )


def is_same_event(first: Alert, alert: Alert) -> bool:
    """Return True where sensors have told what a test shows, or a test what sensors show: the same
    quantity went the same way, by no more, before that was told. A test that fits none before it
    is what such a change leads to.
    """
    if not set(first.kinds) & OF_CHANGES:
        return False
    told, own = _leading(first), _leading(alert)
    if told is None or not set(alert.kinds) <= {*OF_CHANGES, *REPEAT}:
        return False
    if alert.kinds == REPEAT:
        return True
    if own is None or (alert.change and alert.change.began_after > first.time):
        return False
    is_same = own.quantity == told.quantity and own.shift_mean * told.shift_mean > 0
    more = abs(own.shift_mean) - abs(told.shift_mean)
    return is_same and more <= _SDS * math.hypot(own.shift_sd, told.shift_sd)


def _leading(alert: Alert) -> Drift | Moved | None:
    if alert.change and alert.change.moved:
        return alert.change.moved[0]
    return alert.drifts[0] if alert.drifts else None


def subjects_of(alert: Alert) -> frozenset[tuple[str, float]]:
    """Return what an alert is about, so that one of the same can be told; empty where none rings
    anew."""
    if "held" in alert.kinds or alert.kinds in (REPEAT, ("tests disagree",)):
        return frozenset()
    if not alert.drifts:
        return frozenset((kind, 0.0) for kind in alert.kinds)
    return frozenset(
        (each.quantity, math.copysign(1, each.shift_mean)) for each in alert.drifts
    ) | frozenset((kind, 0.0) for kind in alert.kinds if kind == "gap")
