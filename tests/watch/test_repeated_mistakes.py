"""A mode that tests keep having wrong: counted, told once, kept from test to test."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from shm.values import ModeReading, Reading, RepeatedMistake, WatchedTest
from shm.watch.engine.causes import Columns
from shm.watch.engine.kept_state import from_bytes, to_bytes
from shm.watch.watching import AlertState, after
from shm.watch.words.notices import repeated_mistakes
from tests.helpers.hangers import HANGER_3
from tests.helpers.nouns import a_change

MODES = (("transverse", 1), ("transverse", 2), ("longitudinal", 1))
THREE = Columns(MODES, {}, np.zeros((3, 3)), slopes=np.zeros((3, 1)))
START = datetime(2026, 5, 1, tzinfo=UTC)


def reading(number: int, wrong: str = "...", lacks: str = "...") -> Reading:
    """Of three modes, `x` where one is wrong, or lacking."""
    mistaken = np.array([each == "x" for each in wrong])
    absent = np.array([each == "x" for each in lacks])
    variances = np.where(mistaken | absent, np.inf, 1e-6)
    modes = ModeReading(np.zeros(3), variances, np.zeros(3), mistaken)
    time = START + timedelta(days=number)
    return Reading(f"t{number}", time, 10.0, np.zeros(1), np.eye(1), modes=modes)


def misfitting(number: int) -> Reading:
    """Of eight modes, five of which are off by 2 to 6 % in no order that a tension makes."""
    off = np.array([0.02, 0.0, -0.04, 0.03, 0.0, -0.06, 0.04, 0.0])
    modes = ModeReading(off, np.full(8, 1e-4), np.zeros(8), np.zeros(8, bool))
    time = START + timedelta(days=number)
    return Reading(f"t{number}", time, 10.0, np.zeros(1), np.eye(1), modes=modes)


EIGHT = Columns(
    tuple(("transverse", order) for order in range(1, 9)),
    {},
    np.zeros((8, 8)),
    slopes=np.ones((8, 1)),
)


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
        mistaken = repeated_mistakes(mistaken, reading(number, f".{each}."), THREE)
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
