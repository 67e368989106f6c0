"""Compare what is the case with the alerts that are open: one call opens and closes them all.

Tests, limits, silent streams and the watch of sensors state conditions; `reconcile` decides, on
whatever occasion it is called (record 0019).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from shm.store import Reconciled, StoredAlert
from shm.store.rows import Ending
from shm.values import Alert, AlertKind, Change, Drift, Moved

SHM = "shm"
"""Who ends an alert where tests do, and no person."""
State = Literal["holds", "over", "unknown"]

BEYOND: AlertKind = "beyond threshold"
OF_CHANGES = {BEYOND, "sudden change", "slow drift"}
REPEAT = ("repeat the test",)
OF_ONE_TEST = (REPEAT, ("tests disagree",))
_SDS = 2.0  # by which two measurements of one change differ once in twenty times


@dataclass(frozen=True)
class Condition:
    """State of what an alert reports; where it is over, how it ended and why.

    An unknown one opens and closes nothing. `baseline_id` is that of the tests that show it, None
    for other conditions.
    """

    alert: Alert
    state: State
    why: str = ""
    ending: Ending = Ending.OVER
    baseline_id: int | None = None


def reconcile(open_alerts: Iterable[StoredAlert], conditions: Sequence[Condition]) -> Reconciled:
    """Close open alerts whose condition is over; open what holds and no open alert reports."""
    over = {e.alert.key: (e.ending, e.why) for e in conditions if e.state == "over"}
    is_open = list(open_alerts)
    to_close = {each.id: over[each.alert.key] for each in is_open if each.alert.key in over}
    left = [each for each in is_open if each.id not in to_close]
    to_open: list[Alert] = []
    for condition in conditions:
        if condition.state == "holds" and not _is_covered(condition, to_open, left):
            to_open.append(condition.alert)
    return Reconciled(tuple(to_open), to_close)


def _is_covered(condition: Condition, opened: Sequence[Alert], left: Sequence[StoredAlert]) -> bool:
    """Return True where alerts report a condition: of its source, or of sensors beside tests.

    What was raised against another baseline is another event.
    """
    alert, baseline_id = condition.alert, condition.baseline_id
    same = [each.alert for each in left if each.baseline_id == baseline_id]
    other = (each.alert for each in left if (each.baseline_id is None) != (baseline_id is None))
    return is_reported(alert, [*opened, *same]) or any(is_same_event(e, alert) for e in other)


def with_free_key(alert: Alert, known: Iterable[StoredAlert]) -> Alert:
    """Return an alert under a key that none of those `known` has: a condition may come again."""
    first = alert.key.partition(":again-")[0]
    same = [each.id for each in known if each.alert.key.partition(":again-")[0] == first]
    return replace(alert, key=f"{first}:again-{max(same)}") if same else alert


def is_reported(alert: Alert, known: Sequence[Alert]) -> bool:
    """Return True where known alerts report all of an alert, by other rules or a later test too."""
    kinds = set(alert.kinds)
    if any(each.key == alert.key for each in known):
        return True
    if not kinds <= OF_CHANGES:
        return False
    if BEYOND in kinds:
        covered = {each for one in known if BEYOND in one.kinds for each in subjects_of(one)}
        if not alert.drifts or not subjects_of(alert) <= covered:
            return False
    return kinds == {BEYOND} or any(_reports_change(one, alert.change) for one in known)


def _reports_change(known: Alert, change: Change | None) -> bool:
    """Return True where an alert reports a change: in the same direction, begun before it."""
    if change is None or not change.moved or not set(known.kinds) & OF_CHANGES:
        return False
    first = change.moved[0]
    moved: list[Drift | Moved] = [*known.drifts, *(known.change.moved[:1] if known.change else ())]
    return change.began_by <= known.time and any(_is_same_way(each, first) for each in moved)


def is_same_event(first: Alert, alert: Alert) -> bool:
    """Return True where sensors have reported what a test shows, or a test what sensors show.

    The same quantity changed in the same direction, by no more, before that was reported. A test
    that fits none before it is what such a change leads to.
    """
    if not set(first.kinds) & OF_CHANGES:
        return False
    known, candidate = _leading(first), _leading(alert)
    if known is None or not set(alert.kinds) <= {*OF_CHANGES, *REPEAT}:
        return False
    if alert.kinds == REPEAT:
        return True
    if candidate is None or (alert.change and alert.change.began_after > first.time):
        return False
    more = abs(candidate.shift_mean) - abs(known.shift_mean)
    is_no_more = more <= _SDS * math.hypot(candidate.shift_sd, known.shift_sd)
    return _is_same_way(candidate, known) and is_no_more


def _is_same_way(one: Drift | Moved, other: Drift | Moved) -> bool:
    return one.quantity == other.quantity and one.shift_mean * other.shift_mean > 0


def _leading(alert: Alert) -> Drift | Moved | None:
    if alert.change and alert.change.moved:
        return alert.change.moved[0]
    return alert.drifts[0] if alert.drifts else None


def subjects_of(alert: Alert) -> frozenset[tuple[str, float]]:
    """Return what an alert is about, its quantities with their directions or else its kinds.

    Empty for what is never raised again.
    """
    if alert.kinds in OF_ONE_TEST:
        return frozenset()
    moved = {(each.quantity, math.copysign(1, each.shift_mean)) for each in alert.drifts}
    kinds = {(kind, 0.0) for kind in alert.kinds if kind == "gap" or not moved}
    return frozenset(moved | kinds)
