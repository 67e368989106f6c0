"""What stays is a change; what tests did before as often is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.values import Reading
from shm.watch.persistence import Stays
from shm.watch.watcher import Watch
from tests.helpers.synthetic_readings import (
    PLANES_ALONE,
    SPRING_STEP,
    TENSION_ALONE,
    History,
    shifted,
    watch_of,
)

SEEDS = pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.trial)])
QUIET = History(tests=24, outliers=0, seasons_k=5)


def vans(readings: list[Reading], tests: list[int], by: float = 0.04) -> list[Reading]:
    """A load on the deck in some of the tests."""
    for test in tests:
        readings = [*readings[:test], *shifted(readings, test, [by])[test:]]
    return readings


def calls(readings: list[Reading]) -> list[int]:
    return [call.index for call in watch_of(readings, TENSION_ALONE).calls]


@SEEDS
def test_two_tests_in_a_row_under_a_van_call_nothing_and_three_that_stay_do(seed: int) -> None:
    readings = QUIET.readings(seed)

    assert not calls(vans(readings, [12, 13]))
    (called,) = calls(vans(readings, list(range(12, 24))))
    assert 13 <= called <= 15


def test_what_one_test_in_four_did_before_needs_more_tests_than_what_none_did() -> None:
    readings = QUIET.readings(4)

    (never,) = calls(vans(readings, list(range(14, 24))))
    often = calls(vans(readings, [2, 6, 10, *range(14, 24)]))

    assert never <= 16
    assert not often or often[0] > never


@SEEDS
def test_a_change_that_comes_back_at_once_leaves_no_call_behind(seed: int) -> None:
    assert not calls(vans(QUIET.readings(seed), [9, 10, 15, 20, 21], by=-0.03))


@SEEDS
def test_joints_that_give_now_and_then_are_no_loosened_end(seed: int) -> None:
    history = replace(QUIET, quantities=PLANES_ALONE, tests=30)
    readings = history.readings(seed)
    giving = np.random.default_rng(0).random((2, 30))[seed] < 0.2
    for test in np.flatnonzero(giving).tolist():
        readings = shifted(readings, test, [0.0, -3 * SPRING_STEP, 0.0])

    assert not watch_of(readings, PLANES_ALONE).calls


def against(readings: list[Reading]) -> tuple[Watch, list[int]]:
    found = watch_of(readings, TENSION_ALONE)
    return found, [test.change.against_baseline for test in found.tests]


def test_a_baseline_of_one_test_that_stands_alone_is_said_and_calls_nothing() -> None:
    found, counts = against(vans(QUIET.readings(1), [0], by=0.08))

    assert not found.calls
    assert found.tests[-1].change.is_baseline_alone
    assert counts[-1] >= 20
    assert sum(count >= 4 for count in counts) > 15


@SEEDS
@pytest.mark.parametrize(("by", "first"), [(-0.08, 2), (-0.7, 2), (-0.7, 1)])
def test_a_loss_after_a_baseline_of_one_test_and_one_that_agrees_is_called(
    by: float, first: int, seed: int
) -> None:
    """A gross one right after it too."""
    (called,) = calls(vans(QUIET.readings(seed)[:12], list(range(first, 12)), by))
    assert called <= 5


def test_a_baseline_that_stands_alone_hides_no_later_loss() -> None:
    readings = vans(QUIET.readings(2), [0], by=0.08)
    for test in range(16, 24):
        readings = [*readings[:test], *shifted(readings, test, [-0.05])[test:]]

    found, _ = against(readings)

    (call,) = found.calls
    assert 17 <= call.index <= 19
    assert call.change.moved[0].shift_mean == pytest.approx(-0.05, abs=0.01)
    assert found.tests[-1].change.is_baseline_alone


@SEEDS
def test_a_sound_baseline_is_never_said_to_stand_alone(seed: int) -> None:
    _, counts = against(QUIET.readings(seed))
    assert not any(counts)
    assert Stays(0.0).against_baseline == 0
