"""What the first tests say against a baseline of one or two is an alert that says both causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from shm.pipeline.conditions import Evidence, why_over
from shm.values import Alert, Beside, Drift, ModalTest, WatchedTest
from shm.watch import WatchOptions, watch_newest
from shm.watch.baseline_check import check_baseline
from shm.watch.watching import DatedTest
from shm.watch.words.notices import alert_of_baseline
from tests.helpers.modelled_tests import misnamed
from tests.helpers.nouns import a_change
from tests.watch.test_agreement import BEGIN, HANGER, a_test, baseline_of

WEEK = timedelta(weeks=1)


def weekly(*tensions: float, temperature_c: float = 12.0) -> list[ModalTest]:
    return [
        replace(a_test(n, tension, temperature_c), time=BEGIN + n * WEEK)
        for n, tension in enumerate(tensions)
    ]


def rung(tests: Sequence[ModalTest], baseline_tests: int = 1) -> list[tuple[int, Alert]]:
    """The alerts of tests that come one by one, each with the number of its test."""
    first, found = tests[:baseline_tests], []
    posterior, _ = baseline_of(first[0])
    dated: list[DatedTest] = [(test, test.time or BEGIN) for test in first]
    kept = None
    for n, test in enumerate(tests[baseline_tests:], baseline_tests):
        before = tests[baseline_tests:n][::-1][:2]
        newest = watch_newest(
            posterior,
            dated,
            [(test, test.time or BEGIN)],
            HANGER,
            WatchOptions(),
            kept,
            Beside(came=(before, ()), dated=(before, ())),
        )
        assert newest is not None
        kept = newest.kept
        if newest.alert and newest.alert.kinds != ("repeat the test",):
            found.append((n, newest.alert))
    return found


@pytest.mark.parametrize("tension", [0.94, 0.92, 0.85, 1.08, 1.25])
def test_a_change_right_after_a_baseline_of_one_is_told_once_by_the_third_test(
    tension: float,
) -> None:
    """As an alert where no load on the deck does as much."""
    ((number, alert),) = rung(weekly(1.0, *[tension] * 9))
    assert number == 3
    is_no_load = abs(tension - 1) > 0.1
    assert alert.kinds[0] == ("beyond threshold" if is_no_load else "check the baseline")
    for drift in alert.drifts:
        assert drift.shift_mean == pytest.approx(tension - 1, abs=0.04)
    assert bool(alert.drifts) is is_no_load
    way = "fell" if tension < 1 else "rose"
    assert alert.message.startswith(f"Hanger 3: either tension {way} by ")
    assert "or the baseline was disturbed. Within a week, " in alert.message


def test_nothing_is_told_of_a_hanger_that_keeps_still() -> None:
    assert rung(weekly(1.0, 1.01, 0.99, 1.0, 0.985, 1.01, 1.0, 0.99)) == []


def test_three_tests_of_one_visit_say_no_more_than_one() -> None:
    tests = weekly(1.0, *[0.92] * 3)
    visit = [
        replace(each, time=BEGIN + WEEK + n * timedelta(hours=1))
        for n, each in enumerate(tests[1:])
    ]
    assert not any("either" in alert.message for _, alert in rung([tests[0], *visit]))


def test_what_the_season_may_have_done_is_not_told() -> None:
    cold = [replace(each, temperature_c=-25.0) for each in weekly(*[0.94] * 5)[1:]]
    assert [n for n, _ in rung([*weekly(1.0), *cold]) if n < 4] == []


def test_a_mistaken_mode_of_the_only_baseline_test_is_no_loss() -> None:
    tests = weekly(*[1.0] * 8)
    tests[0] = misnamed(tests[0], "transverse", 2)
    check = check_baseline(tests[:1], HANGER)
    assert [(each.plane, each.order) for each in check.modes] == [("transverse", 2)]
    assert rung([check.without_mistakes(tests[0]), *tests[1:]]) == []


def test_a_mode_that_is_mistaken_in_the_baseline_unseen_is_at_most_a_notice() -> None:
    """By as little as an end that moved: the check leaves it in."""
    for plane, order, off in (("transverse", 4, 1.02), ("longitudinal", 1, 0.98)):
        tests = weekly(*[1.0] * 8)
        modes = tuple(
            replace(mode, frequency_hz=mode.frequency_hz * off)
            if (mode.plane, mode.order) == (plane, order)
            else mode
            for mode in tests[0].modes
        )
        assert {
            kind
            for _, alert in rung([replace(tests[0], modes=modes), *tests[1:]])
            for kind in alert.kinds
        } <= {"check the modes", "check the baseline"}


def alone(*drifts: Drift) -> WatchedTest:
    change = a_change(probability=0.01, evidence_years=1.0)
    return WatchedTest("t3", BEGIN, 10.0, drifts, replace(change, against_baseline=3))


def drift(quantity: str, mean: float, sd: float) -> Drift:
    threshold = 0.05 if quantity == "tension" else 0.5
    return Drift(
        3, "t3", BEGIN, quantity, 700e3, 700e3 * (1 + mean), mean, sd, threshold, float(np.nan)
    )


def test_the_alert_stays_while_one_test_is_disturbed_and_ends_once_the_shift_has_come_back() -> (
    None
):
    alert = alert_of_baseline(alone(drift("tension", -0.18, 0.01)), HANGER)

    def later(mean: float, weeks: int) -> WatchedTest:
        test = alone(replace(drift("tension", mean, 0.01), probability=0.001))
        change = replace(test.change, against_baseline=0)
        return replace(test, time=BEGIN + weeks * WEEK, change=change)

    def why(*means: float) -> str:
        tests = [later(mean, weeks) for weeks, mean in enumerate(means, 1)]
        return why_over(alert, Evidence(HANGER, tests, "", lambda _: False, ()))

    assert not why(-0.18)
    assert not why(-0.18, -0.005)
    assert not why(-0.005, -0.18, -0.005)
    assert why(-0.18, -0.005, -0.005)


def test_what_a_load_may_do_is_a_notice_that_says_both() -> None:
    small = alert_of_baseline(alone(drift("tension", -0.08, 0.005)), HANGER)
    assert small.kinds == ("check the baseline",)
    assert "either tension fell by 8.00 ± 0.82 %" in small.message
    none = alert_of_baseline(alone(drift("tension", -0.02, 0.02)), HANGER)
    assert none.kinds == ("check the baseline",)
    assert none.drifts == ()
