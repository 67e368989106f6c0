"""A mode that tests keep having wrong: counted, told once, kept from test to test."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from shm.pipeline.ending import why_over
from shm.values import ModeReading, Reading, RepeatedMistake, WatchedTest
from shm.watch.alert_state import AlertState
from shm.watch.quantities import MeasuredMode
from shm.watch.repeated_mistakes import repeated_mistakes
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


def watched(number: int, tests: int) -> WatchedTest:
    mistaken = (RepeatedMistake("transverse", 3, START, tests),) if tests else ()
    still = a_change(probability=0.01, evidence_years=1.0)
    time = START + timedelta(days=number)
    return WatchedTest(f"t{number}", time, 10.0, (), still, mistaken=mistaken)


def test_a_notice_is_given_once_and_again_only_after_the_mode_has_fitted() -> None:
    told, kinds = AlertState(), []
    for number, tests in enumerate((1, 2, 3, 4, 5, 0, 1, 2, 3)):
        told, alert = after(told, watched(number, tests), HANGER_3)
        told = AlertState.from_text(told.to_text())
        kinds.append(alert.kinds if alert else ())
    expected = [("check the modes",) if number in (2, 8) else () for number in range(9)]
    assert kinds == expected


@pytest.mark.parametrize(("tests", "ends"), [(4, False), (1, True), (0, True)])
def test_the_notice_ends_once_the_mode_fits_again(tests: int, ends: bool) -> None:
    _, alert = after(AlertState(), watched(2, 3), HANGER_3)
    assert alert is not None
    why = why_over(alert, watched(3, tests), HANGER_3, gap_stands=False)
    assert bool(why) is ends
