"""What the sequential watch calls, how soon, and what it says has moved."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from shm.watch.sequential import Watch, watch_over, watched

from shm.errors import BadInput
from shm.values import WatchedTest
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import (
    BOTH_ENDS,
    PLANES_ALONE,
    SPRING_STEP,
    TENSION_ALONE,
    History,
    shifted,
)

CHANGE_AT = 30
SEEDS = range(4)


def watch(history: History, seed: int = 0) -> Watch:
    return watch_over(history.readings(seed), history.quantities, HANGER_3)


def delays(history: History) -> list[int]:
    """Tests from the change to its call, one a seed, the call's own among them; none called before
    the change."""
    found = []
    for seed in SEEDS:
        calls = [call.index for call in watch(history, seed).calls]
        assert calls, "the change was not called"
        assert min(calls) >= history.change_at, "called before it happened"
        found.append(calls[0] - history.change_at + 1)
    return found


def last(tests: tuple[WatchedTest, ...]) -> WatchedTest:
    return tests[-1]


def lost(fraction: float, q: int = 1) -> list[float]:
    return [math.log(1 - fraction), *[0.0] * (q - 1)]


@pytest.mark.parametrize("fraction", [0.02, 0.05, 0.10])
def test_a_lost_share_of_tension_is_called_by_its_fourth_test(fraction: float) -> None:
    history = History(tests=36, change_at=CHANGE_AT, step=lost(fraction), seasons_k=20)

    assert max(delays(history)) <= 4
    assert np.median(delays(history)) <= 3


def test_a_slow_loss_of_two_percent_a_year_is_called_before_it_has_lost_two_percent() -> None:
    history = History(tests=55, change_at=CHANGE_AT, ramp=[-0.02], seasons_k=20)

    assert max(delays(history)) <= 18
    assert np.median(delays(history)) <= 12


def test_a_slow_loss_is_told_from_a_sudden_one() -> None:
    slow = watch(History(tests=60, change_at=CHANGE_AT, ramp=[-0.02]))
    sudden = watch(History(tests=60, change_at=CHANGE_AT, step=lost(0.03)))

    assert slow.calls[0].change.sudden < 0.5 < 0.9 < sudden.calls[0].change.sudden


def test_the_temperature_alone_calls_nothing_over_years() -> None:
    history = History(tests=80, seasons_k=25, per_kelvin=0.002)

    assert not any(watch(history, seed).calls for seed in SEEDS)


def test_a_loss_of_three_percent_is_called_under_a_swing_of_25_kelvin() -> None:
    history = History(tests=36, change_at=CHANGE_AT, step=lost(0.03), seasons_k=25)

    assert max(delays(history)) <= 4


def test_tests_without_temperatures_do_not_call_and_do_not_hide_a_loss() -> None:
    quiet = History(tests=60, temperatures_missing=0.5, seasons_k=20)
    losing = replace(quiet, change_at=CHANGE_AT, step=lost(0.10))

    assert not any(watch(quiet, seed).calls for seed in SEEDS)
    assert max(delays(losing)) <= 8


def test_a_hanger_none_of_whose_temperatures_is_known_can_be_watched() -> None:
    history = History(tests=40, temperatures_missing=1.0, change_at=30, step=lost(0.10))

    assert watch(history).calls[0].change.moved[0].shift_mean == pytest.approx(-0.1, abs=0.03)


@pytest.mark.parametrize("size", [0.03, 0.1, 0.5, 2.0, -0.9])
def test_an_outlier_of_any_size_calls_no_change_and_hardly_moves_the_drift(size: float) -> None:
    readings = History(tests=30, outliers=0).readings(1)

    found = watch_over(shifted(readings, 20, [size]), TENSION_ALONE, HANGER_3)

    assert not found.calls
    assert found.tests[20].change.outlier_probability > 0.5
    for index in (20, 29):
        drift = found.tests[index].drifts[0]
        assert drift.probability < 0.5
        assert abs(drift.shift_mean) < min(2 * drift.shift_sd, 0.005)


def test_an_outlier_along_one_spring_of_many_calls_no_change() -> None:
    history = History(PLANES_ALONE, tests=30, outliers=0)
    readings = shifted(history.readings(1), 20, [0.0, -10 * SPRING_STEP, 0.0])

    found = watch_over(readings, PLANES_ALONE, HANGER_3)

    assert not found.calls
    assert max(drift.probability for drift in found.tests[20].drifts) < 0.8


def test_two_tests_that_agree_on_a_large_loss_call_it() -> None:
    history = History(tests=CHANGE_AT + 2, outliers=0, change_at=CHANGE_AT, step=lost(0.3))

    assert [call.index for call in watch(history).calls] == [CHANGE_AT + 1]


def test_a_called_step_is_called_once_and_a_second_one_anew() -> None:
    once = History(tests=60, change_at=25, step=lost(0.05), outliers=0)
    readings = once.readings(3)
    for index in range(45, 60):
        readings = shifted(readings, index, [0.03])

    alone = watch_over(once.readings(3), TENSION_ALONE, HANGER_3)
    both = watch_over(readings, TENSION_ALONE, HANGER_3)

    assert len(alone.calls) == 1
    assert 25 <= alone.calls[0].index < 28
    assert len(both.calls) == 2
    assert 45 <= both.calls[1].index < 48
    assert both.calls[1].change.began_after == readings[44].time
    expected = math.expm1(math.log(0.95) + 0.03)
    assert last(both.tests).drifts[0].shift_mean == pytest.approx(expected, abs=0.004)


def test_a_loss_that_goes_on_is_followed_after_its_call() -> None:
    history = History(tests=90, change_at=CHANGE_AT, ramp=[-0.02], outliers=0)
    readings = history.readings(2)
    years = (readings[-1].time - readings[CHANGE_AT - 1].time).days / 365.25

    found = watch_over(readings, TENSION_ALONE, HANGER_3)
    drift = last(found.tests).drifts[0]

    assert len(found.calls) == 1
    assert drift.shift_mean == pytest.approx(math.expm1(-0.02 * years), abs=0.004)
    assert drift.shift_sd < 0.004


def test_the_beginning_lies_in_its_interval() -> None:
    history = History(tests=40, change_at=CHANGE_AT, step=lost(0.05))
    readings = history.readings(0)

    change = watch_over(readings, TENSION_ALONE, HANGER_3).calls[0].change

    assert change.began_after <= readings[CHANGE_AT - 1].time
    assert readings[CHANGE_AT].time <= change.began_by <= readings[CHANGE_AT + 2].time


def test_a_loss_of_tension_is_told_from_a_loosened_end() -> None:
    history = History(PLANES_ALONE, tests=36, change_at=CHANGE_AT)
    tension = watch(replace(history, step=lost(0.04, q=3))).calls[0].change.moved
    end = watch(replace(history, step=[0.0, -SPRING_STEP, 0.0])).calls[0].change.moved

    assert (tension[0].quantity, end[0].quantity) == ("tension", "log10_kx")
    assert min(tension[0].probability, end[0].probability) > 0.95
    assert tension[0].alike == end[0].alike == ()
    assert end[0].plane == "transverse"
    assert tension[0].shift_mean == pytest.approx(-0.04, abs=0.01)


def test_ends_that_no_test_tells_apart_are_said_to_be_alike() -> None:
    step = [0.0, -SPRING_STEP, 0.0, 0.0, 0.0]
    history = History(BOTH_ENDS, tests=34, change_at=CHANGE_AT, step=step)

    first, second, third = watch(history).calls[0].change.moved[:3]

    assert {first.quantity, second.quantity} == {"log10_k1", "log10_k3"}
    assert {first.end, second.end} == {"deck", "arch"}
    assert first.alike == (second.quantity,)
    assert second.alike == (first.quantity,)
    assert first.probability == pytest.approx(second.probability, abs=0.02)
    assert first.probability + second.probability > 0.9 > 0.1 > third.probability
    # -0.3 decades by the slope at the baseline, a little more by the curve
    assert first.shift_mean == pytest.approx(-0.3, abs=0.08)


def test_both_planes_of_an_end_that_loosen_together_are_called_and_named_together() -> None:
    history = History(BOTH_ENDS, tests=CHANGE_AT + 3, change_at=CHANGE_AT, outliers=0)
    step = [0.0, -0.5 * SPRING_STEP, -0.7 * SPRING_STEP, 0.0, 0.0]

    call = watch(replace(history, step=step)).calls[0]
    first = call.change.moved[0]
    by_name = {each.quantity: each for each in call.change.moved}

    assert call.index <= CHANGE_AT + 2
    pair = {"log10_k1": "log10_k2", "log10_k3": "log10_k4"}
    pair |= {other: one for one, other in pair.items()}
    assert pair[first.quantity] in first.together
    other = by_name[pair[first.quantity]]
    assert other.probability == pytest.approx(first.probability, abs=0.05)
    # Which end it is no test tells here.
    assert {*first.together, *first.alike} == set(by_name) - {"tension", first.quantity}
    assert by_name["tension"].probability < 0.05


def test_springs_that_loosen_while_a_part_is_read_as_tension_are_called_at_once() -> None:
    pairs = tuple(
        each if each.name == "tension" else replace(each, parameters=("one", "other"))
        for each in PLANES_ALONE
    )
    step = [0.06, -0.6 * SPRING_STEP, -0.7 * SPRING_STEP]
    history = History(pairs, tests=CHANGE_AT + 3, change_at=CHANGE_AT, step=step, outliers=0)

    call = watch(history).calls[0]

    assert call.index <= CHANGE_AT + 2
    assert {each.quantity for each in call.change.moved if each.probability > 0.95} == {
        "tension",
        "log10_kx",
        "log10_ky",
    }
    assert call.change.moved[0].quantity != "tension"


def test_a_small_shift_that_is_not_called_is_told_with_its_uncertainty() -> None:
    gained = 0.005
    step = [math.log(1 + gained)]
    shifts = []
    for seed in range(6):
        history = History(tests=40, change_at=CHANGE_AT, step=step, outliers=0)
        drift = last(watch(history, seed).tests).drifts[0]
        assert drift.probability < 0.01
        assert drift.shift_mean == pytest.approx(gained, abs=3.5 * drift.shift_sd)
        assert 0.0005 < drift.shift_sd < 0.01
        shifts.append(drift.shift_mean)

    assert np.mean(shifts) == pytest.approx(gained, abs=0.002)


@pytest.mark.parametrize("gained", [0.0, 0.01, -0.02])
def test_the_first_test_since_the_baseline_tells_no_less_than_it_leaves_open(gained: float) -> None:
    for seed in range(6):
        history = History(tests=2, change_at=1, step=[math.log(1 + gained)], outliers=0)
        drift = last(watch(history, seed).tests).drifts[0]
        assert drift.probability < 0.05
        assert drift.shift_mean == pytest.approx(gained, abs=3 * drift.shift_sd)
        assert 0.003 < drift.shift_sd < 0.03


def test_a_test_that_sees_nothing_leaves_the_shift_as_open_as_it_was_before() -> None:
    first, second = History(tests=2, outliers=0).readings(1)
    blind = replace(second, information=np.zeros((1, 1)))

    drift = last(watched([first, blind], TENSION_ALONE, HANGER_3)).drifts[0]

    assert drift.shift_mean == pytest.approx(0, abs=0.01)
    assert 1 < drift.shift_sd / TENSION_ALONE[0].step_sd < 2


def test_the_drift_is_the_state_with_the_swing_of_the_temperature_taken_out() -> None:
    history = History(tests=60, seasons_k=25, change_at=40, step=lost(0.08), outliers=0)

    drift = last(watch(history).tests).drifts[0]

    assert drift.value == pytest.approx(0.92 * 700e3, rel=0.004)
    assert drift.baseline == 700e3
    assert drift.threshold == HANGER_3.thresholds.tension_shift_fraction
    assert drift.probability > 0.99


def test_a_result_rests_on_the_readings_up_to_it_alone() -> None:
    readings = History(tests=30, change_at=20, step=lost(0.05)).readings(0)

    early = watched(readings[:24], TENSION_ALONE, HANGER_3)
    late = watched(readings, TENSION_ALONE, HANGER_3)[:24]

    assert [test.change for test in early[1:]] == [test.change for test in late[1:]]
    assert [test.drifts for test in early] == [test.drifts for test in late]


def test_a_reading_that_sees_nothing_changes_nothing() -> None:
    readings = History(tests=12).readings(0)
    blind = replace(readings[6], information=np.zeros((1, 1)), mean=np.zeros(1))

    found = watched([*readings[:6], blind], TENSION_ALONE, HANGER_3)

    before, after = (found[index].drifts[0] for index in (5, 6))
    assert after.shift_mean == pytest.approx(before.shift_mean, abs=before.shift_sd / 2)
    assert found[6].change.evidence_years < 1


def test_readings_out_of_order_or_of_other_quantities_are_refused() -> None:
    readings = History(tests=4).readings(0)

    with pytest.raises(BadInput, match="later"):
        watched(readings[::-1], TENSION_ALONE, HANGER_3)
    with pytest.raises(BadInput, match="3 quantities"):
        watched(readings, PLANES_ALONE, HANGER_3)


def test_no_reading_gives_no_result() -> None:
    assert watched([], TENSION_ALONE, HANGER_3) == ()
