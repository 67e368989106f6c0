"""State the conditions of tests: what tests call for, what is over, and what is shown again.

Pure functions of the tests in force and the alerts raised so far, whatever made the flow ask. The
last tests decide, where those of two visits agree: a van on the deck, a wrong hanger or a mistaken
mode disturbs one visit, and must not end the alert of a loss. Nothing here imports what computes:
the daemon asks it when it stores what the watch found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from shm.pipeline.reconcile import (
    OF_CHANGES,
    OF_ONE_TEST,
    REPEAT,
    Condition,
    is_reported,
    subjects_of,
    with_free_key,
)
from shm.store import StoredAlert
from shm.store.rows import Ending
from shm.values import Alert, Drift, Hanger, Posterior, WatchedTest
from shm.values.drift import OF_ONE_VISIT

_HALF = 0.5  # judgement: of a shift, so much must be left of it
_ODD = 0.5  # likelier than not: such a test agrees with nothing, and says nothing of a shift

ShowsGap = Callable[[WatchedTest], bool]
"""Whether the gap of an adopted class is still larger at a test than when it was adopted."""


@dataclass(frozen=True)
class Evidence:
    """The last watched tests against a baseline, by time, and the alerts that they call for.

    `newest` is the test that was watched just now; where tests are done again (`is_again`) the
    calls are those of all tests, else its own.
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
    return tuple(replace(each, baseline_id=baseline_id) for each in _conditions(known, found))


def _conditions(known: Sequence[StoredAlert], found: Evidence) -> Iterator[Condition]:
    ended = [each for each in known if each.resolution]
    # What other thresholds or a discarded test have closed may be called for again, as if it had
    # never been raised.
    undone = (Ending.JUDGED_AGAIN, Ending.TEST_DISCARDED)
    past = [e for e in ended if e.resolution and e.resolution.ending not in undone]
    called = list(_called_for(found, ended, past))
    yield from called
    is_open: set[tuple[str, float]] = set()
    unended = [each.alert for each in known if not each.resolution]
    reported = [*unended, *(each.alert for each in called)]
    for alert in unended:
        if why := why_over(alert, found) or _why_answered(alert, reported):
            yield Condition(alert, "over", why)
        elif why := _why_not_called(alert, found):
            yield Condition(alert, "over", why, Ending.JUDGED_AGAIN)
        else:
            is_open |= subjects_of(alert)
    for each in reversed(past):
        subjects = subjects_of(each.alert)
        if not subjects <= is_open:
            is_open |= subjects
            later = [test for test in found.tests if test.time > _judged_until(each)]
            shown = _last_agreeing(each.alert, found, later, is_shown=True)
            if len(shown) > 1:
                yield Condition(_renewed(each, shown, found.hanger), "holds")


def _called_for(
    found: Evidence, ended: Sequence[StoredAlert], past: Sequence[StoredAlert]
) -> Iterator[Condition]:
    """Return what the tests call for and no alert of the `past` has reported."""
    for alert in found.called:
        is_change = bool(set(alert.kinds) & OF_CHANGES)
        is_past = is_reported(alert, [e.alert for e in past if alert.time <= _judged_until(e)])
        if not (is_change or alert.test == found.newest) or is_past or why_over(alert, found):
            continue
        if is_change and found.is_again:
            text = f"{alert.message} Raised when the stored tests were judged again."
            alert = replace(alert, message=text)
        yield Condition(with_free_key(alert, ended), "holds")


def _judged_until(stored: StoredAlert) -> datetime:
    """Return the time from which on tests may raise an ended alert again.

    A person who resolves one knows the tests until then.
    """
    end = stored.resolution
    return end.at if end and end.ending is Ending.BY_PERSON else stored.alert.time


def why_over(alert: Alert, found: Evidence) -> str:
    """Return why the condition of an alert has ended; empty while it holds or is unknown.

    It ends with two visits that agree, or with a further change since, which rests on two; a notice
    on one test with one that agrees with those before it and does not clearly read beyond a
    threshold.
    """
    # Its own test speaks, too: judged again it may agree with one that came late or counts again.
    since = [test for test in found.tests if test.time >= alert.time]
    gone = _last_agreeing(alert, found, since, is_shown=False)
    if gone and alert.kinds == REPEAT:
        return f"test {gone[-1].test} agrees with those before it"
    if gone and (further := gone[-1].change).called and further.began_by > alert.time:
        return f"test {gone[-1].test}, which shows a further change, does not show it any more"
    if len(gone) < 2:
        return ""
    both = f"tests {gone[0].test} and {gone[1].test}, of two visits,"
    if "check the modes" in alert.kinds and not alert.drifts:
        return f"all modes of {both} fit again"
    if "check the baseline" in alert.kinds:
        return f"{both} do not speak against the baseline any more"
    if alert.kinds in OF_ONE_TEST:
        return f"{both} agree with those before them"
    return f"{both} do not show it any more"


def _why_not_called(alert: Alert, found: Evidence) -> str:
    """Return why tests that are done again do not call for an open alert; empty where they do."""
    kinds, limits = set(alert.kinds), found.hanger.thresholds
    if not found.is_again or not kinds <= OF_CHANGES:
        return ""
    same = [each for each in found.called if set(each.kinds) & OF_CHANGES == kinds]
    if is_reported(alert, [each for each in same if not why_over(each, found)]):
        return ""
    return (
        "judged again with the thresholds in force "
        f"(tension {100 * limits.tension_shift_fraction:.3g} %, end stiffness "
        f"{limits.stiffness_shift_decades:.3g} decades, probability "
        f"{limits.alert_probability:.3g}): its tests no longer raise it in this form"
    )


def _why_answered(alert: Alert, reported: Sequence[Alert]) -> str:
    """Return why a notice of what may have changed is answered: an alert since then reports it."""
    if alert.kinds not in (*OF_ONE_TEST, ("check the baseline",)):
        return ""
    since = (e for e in reported if set(e.kinds) & OF_CHANGES and e.time >= alert.time)
    answer = next(since, None)
    return f"the alert of test {answer.test} reports what has changed" if answer else ""


def _last_agreeing(
    alert: Alert, found: Evidence, tests: Sequence[WatchedTest], *, is_shown: bool
) -> tuple[WatchedTest, ...]:
    """Return the last of `tests` and one of a visit before, if no test from there on disagrees.

    They agree that what was reported is there, or that it is gone. The last test is returned alone
    where it has no such partner, nothing where the last one disagrees.
    """
    thresholds, last = found.hanger.thresholds, None
    for test in reversed(tests):
        left = _left(alert, test, found)
        is_there = left >= thresholds.alert_probability
        if not (is_there if is_shown else left < thresholds.end_probability):
            break
        last = last or test
        if last.time - test.time > OF_ONE_VISIT:
            return test, last
    return () if last is None else (last,)


def _left(alert: Alert, test: WatchedTest, found: Evidence) -> float:
    """Return the probability that what was reported is there at a test; NaN where not known."""
    if "check the modes" in alert.kinds and not alert.drifts:
        return float(any(each.is_notable for each in test.mistaken))
    if "check the baseline" in alert.kinds:
        return float(test.change.is_baseline_alone)
    is_odd = test.change.outlier_probability > _ODD
    if alert.kinds in OF_ONE_TEST:
        return float(is_odd or any(each.is_clearly_beyond for each in test.drifts))
    if "gap" in alert.kinds and found.shows_gap(test):
        return 1.0
    if is_odd or not ("gap" in alert.kinds or alert.drifts):
        return math.nan
    now = {drift.quantity: drift for drift in test.drifts}
    left = [_left_of(alert, drift, now.get(drift.quantity)) for drift in alert.drifts]
    return math.nan if any(map(math.isnan, left)) else max(left, default=0.0)


def _left_of(alert: Alert, drift: Drift, later: Drift | None) -> float:
    """Return the probability that a shift is beyond its threshold, or half of it is left; or NaN.

    Where two tests agree and their clocks leave no time for a change, the probability was low all
    along: such a shift is gone only once it cannot be beyond its threshold.
    """
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
    """Return an ended alert anew, with the shifts that the last of two visits shows."""
    alert, end, test = stored.alert, stored.resolution, shown[-1]
    now = {drift.quantity: drift for drift in test.drifts}
    drifts, message = tuple(now[each.quantity] for each in alert.drifts), alert.message
    if drifts:
        from shm.watch.words.alert_text import message_of  # it computes: not before it is needed

        level = hanger.thresholds.alert_probability
        beyond = [drift for drift in drifts if drift.probability >= level]
        if not beyond and alert.change is None:
            beyond = list(drifts)
        message = message_of(test, hanger, alert.change, beyond, is_call=False, is_further=False)
    since = f" on {end.at:%Y-%m-%d}" if end else ""
    message += (
        f" Alert {stored.id}, which reported it, was resolved{since}; tests {shown[0].test} and "
        f"{test.test}, of two visits, show it again."
    )
    renewed = replace(alert, test=test.test, time=test.time, drifts=drifts, message=message)
    return with_free_key(replace(renewed, tension=None), [stored])


def is_gap_larger(baseline: Posterior, current: Posterior) -> bool:
    """Return True where the gap of an adopted class is still larger than when it was adopted."""
    from shm.watch.gap import gap_percent, has_grown  # it computes: not before it is needed

    return has_grown(gap_percent(baseline), gap_percent(current))
