"""Alerts follow from what is the case now, compared with what is open: one call for all of them.

Tests, limits, silent streams and the sensors' watch each state their conditions. Done again, judged
again, late or after a changed threshold: `reconcile` is given the conditions of now and the alerts
that are open now, and decides what to open and what to close.

The conditions of tests end as they begin: by tests of two visits that agree, after which nothing
contradicts. A van on the deck, a wrong hanger or a mistaken mode disturbs one visit, and must not
silence a loss that still stands.

Nothing here imports what computes: the daemon decides it when it keeps what the watch said.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

from shm.store import Reconciled, StoredAlert
from shm.values import Alert, AlertKind, Change, Drift, Hanger, Moved, Posterior, WatchedTest
from shm.values.drift import OF_ONE_VISIT

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
        if condition.state == "holds" and not _is_covered(condition, to_open, left):
            to_open.append(condition.alert)
    return Reconciled(tuple(to_open), to_close)


def _is_covered(condition: Condition, opened: Sequence[Alert], left: Sequence[StoredAlert]) -> bool:
    alert, baseline_id = condition.alert, condition.baseline_id
    same = [each.alert for each in left if each.baseline_id == baseline_id]
    # Of tests and of sensors; what was raised against another baseline is another event.
    other = (each.alert for each in left if (each.baseline_id is None) != (baseline_id is None))
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
        covered = {each for one in known if BEYOND in one.kinds for each in subjects_of(one)}
        if not alert.drifts or not subjects_of(alert) <= covered:
            return False
    return kinds == {BEYOND} or any(covers_change(one, alert.change) for one in known)


def covers_change(known: Alert, change: Change | None) -> bool:
    """Return True where an alert tells of a change: of the same way, begun before it was told."""
    if change is None or not change.moved or not set(known.kinds) & OF_CHANGES:
        return False
    first = change.moved[0]
    moved: list[Drift | Moved] = [*known.drifts, *(known.change.moved[:1] if known.change else ())]
    return change.began_by <= known.time and any(
        each.quantity == first.quantity and each.shift_mean * first.shift_mean > 0 for each in moved
    )


def is_same_event(first: Alert, alert: Alert) -> bool:
    """Return True where sensors have told what a test shows, or a test what sensors show: the same
    quantity went the same way, by no more, before that was told. A test that fits none before it
    is what such a change leads to.
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
    is_same = candidate.quantity == known.quantity and candidate.shift_mean * known.shift_mean > 0
    more = abs(candidate.shift_mean) - abs(known.shift_mean)
    return is_same and more <= _SDS * math.hypot(candidate.shift_sd, known.shift_sd)


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


_HALF = 0.5  # judgement: of a shift, so much must be left of it
_ODD = 0.5  # likelier than not: such a test agrees with nothing, and says nothing of a shift
_REPEATS = (REPEAT, ("tests disagree",))
JUDGED_AGAIN = "judged again with the thresholds in force"

ShowsGap = Callable[[WatchedTest], bool]
"""Whether the gap of an adopted class is still larger at a test than when it was adopted."""


@dataclass(frozen=True)
class Evidence:
    """The last watched tests against a baseline, by time, and what the watch calls for.

    `newest` is the test that was watched just now. `called` are alerts that tests in force call
    for: where tests are done again of all, else of the newest alone.
    """

    hanger: Hanger
    tests: Sequence[WatchedTest]
    newest: str
    shows_gap: ShowsGap
    called: Sequence[Alert]
    is_again: bool = False


def conditions_of(
    known: Sequence[StoredAlert], found: Evidence, baseline_id: int
) -> tuple[Condition, ...]:
    """Return the conditions of all alerts `known` against one baseline, and of those called for."""
    conditions = list(_conditions(known, found))
    return tuple(replace(each, baseline_id=baseline_id) for each in conditions)


def _conditions(known: Sequence[StoredAlert], found: Evidence) -> Iterator[Condition]:
    ended = [each for each in known if each.resolution]
    # What other thresholds closed may be called for again.
    resolved = [each for each in ended if not _is_closed(each)]
    is_open: list[StoredAlert] = []
    for each in (each for each in known if not each.resolution):
        if over := why_over(each.alert, found) or _why_closed(each, found):
            yield Condition(each.alert, "over", over)
        else:
            is_open.append(each)
    for alert in found.called:
        if found.is_again and set(alert.kinds) & OF_CHANGES:
            if not why_over(alert, found) and not _is_past(alert, resolved):
                text = f"{alert.message} Raised when the stored tests were judged again."
                yield Condition(with_free_key(replace(alert, message=text), ended), "holds")
        elif alert.test == found.newest and all(alert.key != each.alert.key for each in known):
            yield Condition(alert, "holds")
    if (renewed := _shown_again(resolved, is_open, found)) is not None:
        yield Condition(renewed, "holds")


def why_over(alert: Alert, found: Evidence) -> str:
    """Return why the condition of an alert has ended; empty while it stands or is unknown.

    The last of the tests and one of a visit before must agree that it is gone, and none in between
    may differ. A shift is gone once both are improbable, by half the level: that it is beyond its
    threshold, and that half of what was told is left. Where no change is behind it, as of two tests
    that agree while their clocks left the watch no time for a change, the probability was low all
    along: the shift must have come back, too. A held test ends by a decision, a silence by samples,
    never here.

    A notice that asks to repeat one test ends with one: that agrees with those before it and does
    not clearly read beyond a threshold. The next odd one asks anew.
    """
    if {"held", "silent"} & set(alert.kinds):
        return ""
    end = found.hanger.thresholds.end_probability
    later = [test for test in found.tests if test.time > alert.time]
    gone = _agreeing(later, lambda test: _left(alert, test, found) < end)
    if not gone:
        return ""
    if alert.kinds == REPEAT:
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


def _why_closed(stored: StoredAlert, found: Evidence) -> str:
    """Return why tests that are done again do not call for an open alert; empty where they do."""
    alert, kinds = stored.alert, set(stored.alert.kinds)
    if not found.is_again or not kinds <= OF_CHANGES:
        return ""
    same = [each for each in found.called if set(each.kinds) & OF_CHANGES == kinds]
    if tells(same, alert):
        return ""
    limits = found.hanger.thresholds
    return (
        f"{JUDGED_AGAIN} (tension {100 * limits.tension_shift_fraction:.3g} %, end stiffness "
        f"{limits.stiffness_shift_decades:.3g} decades, probability "
        f"{limits.alert_probability:.3g}): its tests do not call for it as it was told"
    )


def _is_closed(stored: StoredAlert) -> bool:
    """Return True where other thresholds have closed an alert, not its tests or a person."""
    return stored.resolution is not None and stored.resolution.why.startswith(JUDGED_AGAIN)


def _is_past(alert: Alert, resolved: Sequence[StoredAlert]) -> bool:
    """Return True where a person has looked since into what tests done again call for, or an alert
    told it that has ended."""
    past = [
        each.alert
        for each in resolved
        if (end := each.resolution)
        and alert.time <= (each.alert.time if end.who == SHM else end.at)
    ]
    return tells(past, alert)


def _shown_again(
    resolved: Sequence[StoredAlert], is_open: Iterable[StoredAlert], found: Evidence
) -> Alert | None:
    """Return an alert anew whose condition was resolved and which tests of two visits show again.

    What an open alert tells needs no other. Where a person has resolved one, only tests count that
    are dated later: those before are what was looked into. It must be as probable as an alert asks
    for.
    """
    known = {each for stored in is_open for each in subjects_of(stored.alert)}
    level = found.hanger.thresholds.alert_probability
    for stored in reversed(resolved):
        alert, end = stored.alert, stored.resolution
        subjects = subjects_of(alert)
        if end is None or subjects <= known:
            continue
        known |= subjects
        since = alert.time if end.who == SHM else end.at
        later = [test for test in found.tests if test.time > since]
        shown = _agreeing(later, partial(_is_shown, alert, found, level))
        if len(shown) > 1:
            return _renewed(stored, shown, found.hanger)
    return None


def _is_shown(alert: Alert, found: Evidence, level: float, test: WatchedTest) -> bool:
    return _left(alert, test, found) >= level


def _agreeing(
    tests: Sequence[WatchedTest], holds: Callable[[WatchedTest], bool]
) -> tuple[WatchedTest, ...]:
    """Return the last test and the next one of a visit before, of all of which back to there
    something holds; the last alone where it holds of no such visit; empty where not even of the
    last."""
    last = None
    for test in reversed(tests):
        if not holds(test):
            break
        last = last or test
        if last.time - test.time > OF_ONE_VISIT:
            return test, last
    return () if last is None else (last,)


def _left(alert: Alert, test: WatchedTest, found: Evidence) -> float:
    """Return the probability that what was told is there at a test; NaN where that is not known."""
    if "check the modes" in alert.kinds and not alert.drifts:
        return float(any(each.is_notable for each in test.mistaken))
    if "check the baseline" in alert.kinds:
        return float(test.change.is_baseline_alone)
    is_odd = test.change.outlier_probability > _ODD
    if alert.kinds in _REPEATS:
        return float(is_odd or any(each.is_clearly_beyond for each in test.drifts))
    if "gap" in alert.kinds and found.shows_gap(test):
        return 1.0
    if is_odd or not ("gap" in alert.kinds or alert.drifts):
        return math.nan
    now = {drift.quantity: drift for drift in test.drifts}
    left = [_left_of(alert, announced, now.get(announced.quantity)) for announced in alert.drifts]
    return math.nan if any(map(math.isnan, left)) else max(left, default=0.0)


def _left_of(alert: Alert, drift: Drift, later: Drift | None) -> float:
    """Return the probability that a shift is beyond its threshold as it was, or that half of it is
    left; NaN where that is not known."""
    if later is None or not later.shift_sd > 0 or math.isnan(later.probability):
        return math.nan
    way = math.copysign(1, drift.shift_mean)
    off = way * later.shift_mean - _HALF * abs(drift.shift_mean)
    half = 0.5 * math.erfc(-off / (math.sqrt(2) * later.shift_sd))
    if abs(drift.shift_mean) < drift.threshold:
        return half
    if alert.change is None and later.may_be_beyond(drift.shift_mean):
        return 1.0
    is_same_way = way == math.copysign(1, later.shift_mean)
    return max(half, later.probability if is_same_way else 0.0)


def _renewed(stored: StoredAlert, shown: Sequence[WatchedTest], hanger: Hanger) -> Alert:
    alert, end, test = stored.alert, stored.resolution, shown[-1]
    now = {drift.quantity: drift for drift in test.drifts}
    drifts = tuple(now[each.quantity] for each in alert.drifts)
    since = f" on {end.at:%Y-%m-%d}" if end else ""
    again = (
        f"Alert {stored.id}, which told of it, was resolved{since}; tests {shown[0].test} and "
        f"{test.test}, of two visits, show it again."
    )
    message = f"{_message_now(alert, drifts, test, hanger)} {again}"
    renewed = replace(alert, test=test.test, time=test.time, drifts=drifts, message=message)
    return with_free_key(replace(renewed, tension=None), [stored])


def _message_now(alert: Alert, drifts: Sequence[Drift], test: WatchedTest, hanger: Hanger) -> str:
    """Return what an alert says of what it told, as a later test has it."""
    if not drifts:
        return alert.message
    from shm.watch.alert_text import message_of  # it computes: not before it is needed

    level = hanger.thresholds.alert_probability
    beyond = [drift for drift in drifts if drift.probability >= level]
    if not beyond and alert.change is None:
        beyond = list(drifts)
    return message_of(test, hanger, alert.change, beyond, is_call=False, is_further=False)


def is_gap_larger(baseline: Posterior, current: Posterior) -> bool:
    """Return True where the gap of an adopted class is still larger than when it was adopted."""
    from shm.watch.gap import gap_percent, has_grown  # it computes: not before it is needed

    return has_grown(gap_percent(baseline), gap_percent(current))
