"""A mode that tests keep having wrong: counted, told once, kept from test to test."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from shm.pipeline.conditions import Evidence, why_over
from shm.values import ModeReading, Reading, RepeatedMistake, WatchedTest
from shm.watch.alert_state import AlertState
from shm.watch.kept_state import from_bytes, to_bytes
from shm.watch.notices import repeated_mistakes
from shm.watch.quantities import MeasuredMode
from shm.watch.watching import after
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_change

MODES: list[MeasuredMode] = [("transverse", 1), ("transverse", 2), ("longitudinal", 1)]
START = datetime(2026, 5, 1, tzinfo=UTC)


def reading(number: int, wrong: str = "...", lacks: str = "...") -> Reading:
    """Of three modes, `x` where one is wrong, or lacking."""
    mistaken = np.array([each == "x" for each in wrong])
    absent = np.array([each == "x" for each in lacks])
    variances = np.where(mistaken | absent, np.inf, 1e-6)
    modes = ModeReading(np.zeros(3), variances, np.zeros((3, 1)), np.zeros(3), mistaken)
    time = START + timedelta(days=number)
    return Reading(f"t{number}", time, 10.0, np.zeros(1), np.eye(1), modes=modes)


def runs(*readings: Reading) -> list[tuple[RepeatedMistake, ...]]:
    found: list[tuple[RepeatedMistake, ...]] = [()]
    for each in readings:
        found.append(repeated_mistakes(found[-1], each, MODES))
    return found[1:]


def test_a_run_counts_tests_in_a_row_from_its_first() -> None:
    found = runs(reading(0, ".x."), reading(1, ".xx"), reading(2, ".x."))
    assert [[(str(m), m.tests) for m in each] for each in found] == [
        [("transverse 2", 1)],
        [("transverse 2", 2), ("longitudinal 1", 1)],
        [("transverse 2", 3)],
    ]
    assert found[-1][0].since == START
    assert [each[0].is_notable for each in found] == [False, False, True]


def test_a_test_without_the_mode_neither_counts_nor_ends_the_run() -> None:
    blind = replace(reading(1), modes=None)
    found = runs(reading(0, ".x."), reading(1, lacks=".x."), blind, reading(2, ".x."), reading(3))
    assert [[m.tests for m in each] for each in found] == [[1], [1], [1], [2], []]


def misfitting(number: int) -> Reading:
    """Of eight modes, five of which are off by 2 to 6 % in no order that a tension makes."""
    off = np.array([0.02, 0.0, -0.04, 0.03, 0.0, -0.06, 0.04, 0.0])
    modes = ModeReading(off, np.full(8, 1e-4), np.ones((8, 1)), np.zeros(8), np.zeros(8, bool))
    time = START + timedelta(days=number)
    return Reading(f"t{number}", time, 10.0, np.zeros(1), np.eye(1), modes=modes)


EIGHT: list[MeasuredMode] = [("transverse", order) for order in range(1, 9)]


def test_tests_that_do_not_fit_the_baseline_are_one_notice_which_names_no_mode() -> None:
    told, mistaken, alerts = AlertState(), (), []
    for number in range(8):
        each = misfitting(number)
        if number == 4:  # a further mode
            assert each.modes is not None
            off = each.modes.values + np.where(np.arange(8) == 4, 0.05, 0.0)
            each = replace(each, modes=replace(each.modes, values=off))
        mistaken = repeated_mistakes(mistaken, each, EIGHT)
        test = replace(watched(number, 0), mistaken=mistaken)
        told, alert = after(told, test, HANGER_3)
        alerts += [(number, alert)] if alert else []
    ((number, alert),) = alerts
    assert number == 2
    assert "more of its modes miss the baseline's than one wrong number" in alert.message
    assert "transverse" not in alert.message


def watched(number: int, tests: int) -> WatchedTest:
    mistaken = (RepeatedMistake("transverse", 3, START, tests),) if tests else ()
    still = a_change(probability=0.01, evidence_years=1.0)
    time = START + timedelta(days=number)
    return WatchedTest(f"t{number}", time, 10.0, (), still, mistaken=mistaken)


def rung(wrong: str) -> list[int]:
    """In which tests a notice of the second mode came, `x` being those that have it wrong."""
    told, mistaken, rings = AlertState(), (), []
    for number, each in enumerate(wrong):
        mistaken = repeated_mistakes(mistaken, reading(number, f".{each}."), MODES)
        test = replace(watched(number, 0), mistaken=mistaken)
        told, alert = after(told, test, HANGER_3)
        told = from_bytes(AlertState, to_bytes(told))
        rings += [number] if alert else []
    return rings


def test_a_notice_of_a_mode_that_is_wrong_now_and_then_is_given_once() -> None:
    assert rung("..xxxx.xx.xxx..xxx...xx.xxxx.....xxx") == [4]


def test_it_is_given_again_once_the_mode_was_right_in_six_tests_in_a_row() -> None:
    assert rung("xxx......xx.xxx") == [2, 14]
    assert rung("xxx.....xxxx") == [2]


def test_a_further_mode_is_a_further_notice_that_names_it_alone() -> None:
    first = RepeatedMistake("transverse", 3, START, 5)
    other = RepeatedMistake("longitudinal", 1, START, 3)
    _, alert = after(
        AlertState(noted=frozenset({("transverse", 3)})),
        replace(watched(6, 0), mistaken=(other, first)),
        HANGER_3,
    )
    assert alert is not None
    assert alert.message.startswith("Hanger 3: longitudinal 1 has not fitted the other modes")


@pytest.mark.parametrize(("tests", "ends"), [(4, False), (1, True), (0, True)])
def test_the_notice_ends_once_the_mode_fits_again(tests: int, ends: bool) -> None:
    _, alert = after(AlertState(), watched(2, 3), HANGER_3)
    assert alert is not None
    later = [watched(number, tests) for number in (3, 6)]

    def is_over(tests: list[WatchedTest]) -> bool:
        return bool(why_over(alert, Evidence(HANGER_3, tests, "", lambda _: False, ())))

    assert not is_over(later[:1])
    assert is_over(later) is ends
