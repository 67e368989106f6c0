"""Alerts follow from the tests in force: in order, redone, late or judged again, by one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta

import pytest

from shm.pipeline.conditions import Evidence, conditions_of
from shm.pipeline.reconcile import SHM, reconcile
from shm.store import StoredAlert
from shm.store.rows import AlertNote, Ending
from shm.values import Alert, AlertKind, WatchedTest
from tests.helpers.nouns import NOW, a_drift, a_watched_test, an_alert
from tests.watch.test_agreement import HANGER

WEEK = timedelta(weeks=1)
LOST, SOUND = -0.08, -0.002


def weekly(*shifts: float) -> list[WatchedTest]:
    """A test a week, its tension shifted so far."""
    found = []
    for number, shift in enumerate(shifts):
        made = replace(a_drift(), shift_mean=shift, shift_sd=0.004)
        drift = replace(made, probability=0.999 if shift == LOST else 0.001)
        test = a_watched_test(f"t{number}")
        found.append(replace(test, time=NOW + number * WEEK, drifts=(drift,)))
    return found


def calls_of(tests: Sequence[WatchedTest]) -> dict[str, Alert]:
    """What the watch calls for: the loss, at the second test that shows it."""
    lost = [test for test in tests if test.drifts[0].shift_mean == LOST]
    made = [replace(an_alert(f"loss:{t.test}", t.test), time=t.time, drifts=t.drifts,
                    kinds=("beyond threshold",)) for t in lost[1:2]]  # fmt: skip
    return {alert.test: alert for alert in made}


def decide(
    known: list[StoredAlert],
    tests: Sequence[WatchedTest],
    newest: str,
    called: Sequence[Alert],
    *,
    is_again: bool = False,
) -> list[StoredAlert]:
    """All alerts after one decision, as the store has them then."""
    found = Evidence(HANGER, tests, newest, lambda _: False, called, is_again)
    is_open = [each for each in known if each.resolution is None]
    changes = reconcile(is_open, conditions_of(known, found, 1))
    at = tests[-1].time
    ended = [
        replace(each, resolution=_note(each.id, SHM, at, *changes.to_close[each.id]))
        if each.id in changes.to_close
        else each
        for each in known
    ]
    new = enumerate(changes.to_open, len(known) + 1)
    return ended + [StoredAlert(id_, alert, at, baseline_id=1) for id_, alert in new]


def _note(alert_id: int, who: str, at: datetime, ending: Ending, why: str = "") -> AlertNote:
    return AlertNote(alert_id, who, why, at, ending)


def in_order(tests: Sequence[WatchedTest], known: list[StoredAlert]) -> list[StoredAlert]:
    calls = calls_of(tests)
    for number, test in enumerate(tests, 1):
        called = [calls[test.test]] if test.test in calls else []
        known = decide(known, tests[:number], test.test, called)
    return known


def again(tests: Sequence[WatchedTest], known: list[StoredAlert]) -> list[StoredAlert]:
    return decide(known, tests, tests[-1].test, list(calls_of(tests).values()), is_again=True)


def is_open(known: Sequence[StoredAlert]) -> list[bool]:
    return [each.resolution is None for each in known]


@pytest.mark.parametrize(
    ("shifts", "expected"),
    [
        ((SOUND, LOST, LOST, LOST), [True]),
        ((SOUND, LOST, LOST, SOUND, LOST), [True]),  # one disturbed visit ends nothing
        ((SOUND, LOST, LOST, SOUND, SOUND), [False]),
        ((SOUND, LOST, LOST, SOUND, SOUND, LOST), [False]),  # and one raises nothing
        ((SOUND, LOST, LOST, SOUND, SOUND, LOST, LOST), [False, True]),
    ],
)
def test_tests_done_again_change_no_alert(shifts: tuple[float, ...], expected: list[bool]) -> None:
    tests = weekly(*shifts)
    known = in_order(tests, [])
    assert is_open(known) == expected
    assert again(tests, known) == known
    assert again(tests, again(tests, known)) == known


def test_tests_that_come_late_leave_the_alerts_of_their_order() -> None:
    tests = weekly(SOUND, LOST, LOST, SOUND, SOUND)
    came = [tests[0], tests[3], tests[4]]
    known = in_order(came, [])
    assert known == []
    assert again(tests, known) == []  # two visits since show it no more


def test_a_threshold_that_is_changed_and_put_back_closes_and_raises() -> None:
    tests = weekly(SOUND, LOST, LOST, LOST)
    known = in_order(tests, [])
    closed = decide(known, tests, "t3", [], is_again=True)
    assert is_open(closed) == [False]
    raised = again(tests, closed)
    assert is_open(raised) == [False, True]
    assert raised[1].alert.key == "loss:t2:again-1"
    assert "judged again" in raised[1].alert.message


def test_what_a_person_resolved_rings_only_by_two_later_visits() -> None:
    tests = weekly(SOUND, LOST, LOST, LOST, LOST, LOST)
    (one,) = in_order(tests[:3], [])
    known = [replace(one, resolution=_note(1, "Ann", tests[3].time, Ending.BY_PERSON))]
    assert again(tests[:4], known) == known
    assert again(tests[:5], known) == known
    assert is_open(again(tests, known)) == [False, True]


def test_what_the_alert_of_a_discarded_test_reported_other_tests_report() -> None:
    """The test is discarded months after the tests behind it, and counts again later."""
    tests = weekly(SOUND, LOST, LOST, LOST)
    (one,) = in_order(tests, [])
    out = Ending.TEST_DISCARDED
    ended = replace(one, resolution=_note(1, "Ann", tests[3].time + 30 * WEEK, out))
    without = [test for test in tests if test.test != "t2"]
    raised = again(without, [ended])
    assert is_open(raised) == [False, True]
    assert raised[1].alert.test == "t3"
    assert again(without, raised) == raised
    alone = replace(raised[1], resolution=_note(2, "Ann", tests[3].time + 31 * WEEK, out))
    assert is_open(again(without[:2], [ended, alone])) == [False, False]  # nothing calls for it
    back = again(tests, [ended, alone])
    assert is_open(back) == [False, False, True]
    assert back[2].alert.key == "loss:t2:again-1"


@pytest.mark.parametrize("kind", ["repeat the test", "tests disagree", "check the baseline"])
@pytest.mark.parametrize(("raised", "expected"), [("t1", False), ("t3", True)])
def test_an_alert_of_a_change_answers_notices_of_before(
    kind: AlertKind, raised: str, expected: bool
) -> None:
    tests = weekly(SOUND, LOST, LOST, LOST)
    at = next(test.time for test in tests if test.test == raised)
    notice = replace(an_alert("notice", raised), time=at, kinds=(kind,), drifts=())
    known = in_order(tests, [StoredAlert(1, notice, at, baseline_id=1)])
    assert is_open(known) == [expected, True]


def test_an_alert_that_two_visits_renewed_ends_where_no_call_holds() -> None:
    """Of a loss that was restored most tests are discarded; they count again afterwards."""
    tests = weekly(SOUND, LOST, LOST, SOUND, SOUND, LOST, LOST)
    known = in_order(tests, [])
    assert is_open(known) == [False, True]
    left = [*tests[:5], *(replace(t, drifts=tests[4].drifts) for t in tests[5:])]
    ended = decide(known, left, "t6", list(calls_of(left).values()), is_again=True)
    assert is_open(ended) == [False, False]
