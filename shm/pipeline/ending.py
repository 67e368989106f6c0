"""When the condition that an alert told of has ended, so that those who were told hear of it.

An alert ends as it begins: by tests of two visits that agree, after which nothing contradicts. A
van on the deck, a wrong hanger or a mistaken mode disturbs one visit, and must not silence a loss
that still stands. Where an alert was resolved all the same and tests of two visits show again what
it told, it is raised anew: the watch itself takes a change that it has called for known.

Nothing here imports what computes: the daemon decides it when it keeps what the watch said.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from shm.store import StoredAlert
from shm.values import Alert, AlertKind, Change, Drift, Hanger, Moved, Posterior, WatchedTest
from shm.values.drift import OF_ONE_VISIT

SHM = "shm"
"""Who ends an alert where tests do, and no person."""

_HALF = 0.5  # judgement: of a shift, so much must be left of it
_ODD = 0.5  # likelier than not: such a test agrees with nothing, and says nothing of a shift
_SDS = 2.0  # by which two measurements of one change differ once in twenty times
BEYOND: AlertKind = "beyond threshold"
OF_CHANGES = {BEYOND, "sudden change", "slow drift"}
_REPEAT = ("repeat the test",)
_REPEATS = (_REPEAT, ("tests disagree",))

GapStands = Callable[[WatchedTest], bool]
"""Whether the gap of an adopted class is still larger at a test than when it was adopted."""


def why_over(
    alert: Alert, tests: Sequence[WatchedTest], hanger: Hanger, *, gap_stands: GapStands
) -> str:
    """Why the condition of an alert has ended; empty while it stands or is unknown.

    `tests` are the last ones watched against the baseline of the alert, by time. The last of them
    and one of a visit before must agree that it is gone, and none in between may differ. A shift is
    gone once both are improbable, by half the level: that it is beyond its threshold, and that half
    of what was told is left. Where no change is behind it, as of two tests that agree while their
    clocks left the watch no time for a change, the probability was low all along: the shift must
    have come back, too. A held test ends by a decision, a silence by samples, never here.

    A notice that asks to repeat one test ends with one: that agrees with those before it and does
    not clearly read beyond a threshold. The next odd one asks anew.
    """
    if {"held", "silent"} & set(alert.kinds):
        return ""
    end = hanger.thresholds.end_probability
    later = [test for test in tests if test.time > alert.time]
    gone = _agreeing(later, lambda test: _left(alert, test, hanger, gap_stands) < end)
    if not gone:
        return ""
    if alert.kinds == _REPEAT:
        return f"test {gone[-1].test} agrees with those before it"
    if len(gone) < 2:
        return ""
    both = f"tests {gone[0].test} and {gone[1].test}, of two visits,"
    if "check the modes" in alert.kinds and not alert.drifts:
        return f"all modes of {both} fit again"
    if "check the baseline" in alert.kinds:
        return f"{both} do not speak against the baseline any more"
    if alert.kinds in _REPEATS:
        return f"{both} agree with those before them"
    return f"{both} do not show it any more"


def is_told(alert: Alert, known: Sequence[Alert]) -> bool:
    """Whether alerts that are known tell already all that one says.

    Done again, a test may call for the same loss by other rules or a test later; and the watch may
    have taken the first for over, by its own count of visits.
    """
    kinds = set(alert.kinds)
    if not kinds <= OF_CHANGES:
        return False
    if BEYOND in kinds:
        told = {each for one in known if BEYOND in one.kinds for each in conditions_of(one)}
        if not alert.drifts or not conditions_of(alert) <= told:
            return False
    return kinds == {BEYOND} or any(tells(one, alert.change) for one in known)


def tells(told: Alert, change: Change | None) -> bool:
    """Whether an alert tells of a change: of the same way, begun before it was told."""
    if change is None or not change.moved or not set(told.kinds) & OF_CHANGES:
        return False
    first = change.moved[0]
    moved: list[Drift | Moved] = [*told.drifts, *(told.change.moved[:1] if told.change else ())]
    return change.began_by <= told.time and any(
        each.quantity == first.quantity and each.shift_mean * first.shift_mean > 0 for each in moved
    )


def told_by_other(
    alert: Alert | None, stored: Sequence[StoredAlert], *, of_stream: bool
) -> StoredAlert | None:
    """The standing alert of a stream, which is against no baseline (else of a test), that has told
    the same event: the same quantity went the same way, by no more, before that was told. A test
    that fits none before it is what such a change leads to.
    """
    if alert is None or not set(alert.kinds) <= {*OF_CHANGES, *_REPEAT}:
        return None
    own = _change_of(alert)
    for first in stored:
        told = _change_of(first.alert)
        if first.resolution or (first.baseline_id is None) != of_stream or told is None:
            continue
        if not set(first.alert.kinds) & OF_CHANGES:
            continue
        if alert.kinds == _REPEAT:
            return first
        if own is None or (alert.change and alert.change.began_after > first.alert.time):
            continue
        is_same = own.quantity == told.quantity and own.shift_mean * told.shift_mean > 0
        more = abs(own.shift_mean) - abs(told.shift_mean)
        if is_same and more <= _SDS * math.hypot(own.shift_sd, told.shift_sd):
            return first
    return None


def _change_of(alert: Alert) -> Drift | Moved | None:
    """What an alert leads with."""
    if alert.change and alert.change.moved:
        return alert.change.moved[0]
    return alert.drifts[0] if alert.drifts else None


def seen_again(
    resolved: Sequence[StoredAlert],
    standing: Sequence[StoredAlert],
    tests: Sequence[WatchedTest],
    hanger: Hanger,
    *,
    gap_stands: GapStands,
) -> Alert | None:
    """An alert anew whose condition was resolved and which tests of two visits show once more.

    All alerts are against one baseline, the oldest first, `tests` as in `why_over`. What stands
    needs no other alert. Where a person has resolved one, only tests count that are dated later:
    those before are what was looked into. It must be as probable as an alert asks for.
    """
    known = {each for stored in standing for each in conditions_of(stored.alert)}
    level = hanger.thresholds.alert_probability
    for stored in reversed(resolved):
        alert, end = stored.alert, stored.resolution
        own = conditions_of(alert)
        if end is None or own <= known:
            continue
        known |= own
        since = alert.time if end.who == SHM else end.at
        later = [test for test in tests if test.time > since]
        stands = partial(_stands, alert, hanger, gap_stands, level)
        shown = _agreeing(later, stands)
        if len(shown) > 1:
            return _anew(stored, shown, hanger)
    return None


def _agreeing(
    tests: Sequence[WatchedTest], holds: Callable[[WatchedTest], bool]
) -> tuple[WatchedTest, ...]:
    """The last test and the next one of a visit before, of all of which back to there something
    holds; the last alone where it holds of no such visit; empty where not even of the last."""
    last = None
    for test in reversed(tests):
        if not holds(test):
            break
        last = last or test
        if last.time - test.time > OF_ONE_VISIT:
            return test, last
    return () if last is None else (last,)


def _left(alert: Alert, test: WatchedTest, hanger: Hanger, gap_stands: GapStands) -> float:
    """The probability that what was told is there at a test; NaN where that is not known."""
    if "check the modes" in alert.kinds and not alert.drifts:
        return float(any(each.is_notable for each in test.mistaken))
    if "check the baseline" in alert.kinds:
        return float(test.change.is_baseline_alone)
    is_odd = test.change.outlier_probability > _ODD
    if alert.kinds in _REPEATS:
        return float(is_odd or any(each.is_clearly_beyond for each in test.drifts))
    if "gap" in alert.kinds and gap_stands(test):
        return 1.0
    if is_odd or not ("gap" in alert.kinds or alert.drifts):
        return math.nan
    now = {drift.quantity: drift for drift in test.drifts}
    found = [_left_of(alert, told, now.get(told.quantity)) for told in alert.drifts]
    return math.nan if any(map(math.isnan, found)) else max(found, default=0.0)


def _stands(
    alert: Alert, hanger: Hanger, gap_stands: GapStands, level: float, test: WatchedTest
) -> bool:
    return _left(alert, test, hanger, gap_stands) >= level


def _left_of(alert: Alert, told: Drift, later: Drift | None) -> float:
    """The probability that a shift is beyond its threshold as it was, or that half of it is left;
    NaN where that is not known."""
    if later is None or not later.shift_sd > 0 or math.isnan(later.probability):
        return math.nan
    way = math.copysign(1, told.shift_mean)
    off = way * later.shift_mean - _HALF * abs(told.shift_mean)
    half = 0.5 * math.erfc(-off / (math.sqrt(2) * later.shift_sd))
    if abs(told.shift_mean) < told.threshold:
        return half
    if alert.change is None and later.may_be_beyond(told.shift_mean):
        return 1.0
    is_same_way = way == math.copysign(1, later.shift_mean)
    return max(half, later.probability if is_same_way else 0.0)


def conditions_of(alert: Alert) -> frozenset[tuple[str, float]]:
    """What an alert is about, so that one of the same can be told; empty where none rings anew."""
    if "held" in alert.kinds or alert.kinds in _REPEATS:
        return frozenset()
    if not alert.drifts:
        return frozenset((kind, 0.0) for kind in alert.kinds)
    return frozenset(
        (each.quantity, math.copysign(1, each.shift_mean)) for each in alert.drifts
    ) | frozenset((kind, 0.0) for kind in alert.kinds if kind == "gap")


def _anew(stored: StoredAlert, shown: Sequence[WatchedTest], hanger: Hanger) -> Alert:
    alert, end, test = stored.alert, stored.resolution, shown[-1]
    now = {drift.quantity: drift for drift in test.drifts}
    drifts = tuple(now[each.quantity] for each in alert.drifts)
    since = f" on {end.at:%Y-%m-%d}" if end else ""
    again = (
        f"Alert {stored.id}, which told of it, was resolved{since}; tests {shown[0].test} and "
        f"{test.test}, of two visits, show it again."
    )
    return replace(
        alert,
        key=f"{alert.key.partition(':again-')[0]}:again-{stored.id}",
        test=test.test,
        time=test.time,
        drifts=drifts,
        tension=None,
        message=f"{message_anew(alert, drifts, test, hanger)} {again}",
    )


def message_anew(alert: Alert, drifts: Sequence[Drift], test: WatchedTest, hanger: Hanger) -> str:
    """What an alert says of what it told, as a later test has it."""
    if not drifts:
        return alert.message
    from shm.watch.alert_text import message_of  # it computes: not before it is needed

    level = hanger.thresholds.alert_probability
    beyond = [drift for drift in drifts if drift.probability >= level]
    if not beyond and alert.change is None:
        beyond = list(drifts)
    return message_of(test, hanger, alert.change, beyond, is_call=False, is_further=False)


def gap_stands(baseline: Posterior, current: Posterior) -> bool:
    """Whether the gap of an adopted class is still larger than when it was adopted."""
    from shm.watch.gap import gap_percent, has_grown  # it computes: not before it is needed

    return has_grown(gap_percent(baseline), gap_percent(current))
