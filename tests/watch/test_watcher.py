"""What the watch calls, how soon, and what it says has moved."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from shm.errors import BadInput
from shm.values import WatchedTest
from shm.watch.engine.causes import TIMEBASE
from shm.watch.engine.options import WatchOptions
from shm.watch.watcher import Watch
from tests.helpers.hangers import HANGER_3
from tests.helpers.synthetic_readings import (
    BOTH_ENDS,
    MODES,
    PLANES_ALONE,
    SPRING_STEP,
    TENSION_ALONE,
    History,
    off_by,
    shifted,
    slopes,
    watch_of,
    without_modes,
)

CHANGE_AT = 10


def watch(history: History, seed: int = 0) -> Watch:
    return watch_of(history.readings(seed), history.quantities)


def last(tests: tuple[WatchedTest, ...]) -> WatchedTest:
    return tests[-1]


def lost(fraction: float, q: int = 1) -> list[float]:
    return [math.log(1 - fraction), *[0.0] * (q - 1)]


@pytest.mark.parametrize("size", [0.03, 0.1, 0.5, 2.0, -0.9])
def test_an_outlier_of_any_size_calls_no_change_and_hardly_moves_the_drift(size: float) -> None:
    readings = History(tests=14, outliers=0).readings(1)

    found = watch_of(shifted(readings, 9, [size]), TENSION_ALONE)

    assert not found.calls
    # Of three hundredths nobody could say whether it is the scatter.
    assert found.tests[9].change.outlier_probability > (0.5 if abs(size) > 0.05 else -1)
    for index in (9, 13):
        drift = found.tests[index].drifts[0]
        assert drift.probability < 0.5
        assert abs(drift.shift_mean) < min(2 * drift.shift_sd, 0.015)


def test_a_called_step_is_called_once_and_a_second_one_anew() -> None:
    once = History(tests=30, change_at=8, step=lost(0.05), outliers=0)
    readings = once.readings(3)
    for index in range(20, 30):
        readings = shifted(readings, index, [0.03])

    alone = watch_of(once.readings(3), TENSION_ALONE)
    both = watch_of(readings, TENSION_ALONE)

    assert len(alone.calls) == 1
    assert 8 <= alone.calls[0].index < 11
    assert len(both.calls) == 2
    assert 20 <= both.calls[1].index < 24
    assert both.calls[1].change.began_after == readings[19].time
    expected = math.expm1(math.log(0.95) + 0.03)
    assert last(both.tests).drifts[0].shift_mean == pytest.approx(expected, abs=0.004)


def test_a_loss_that_goes_on_is_followed_after_its_call() -> None:
    history = History(tests=45, change_at=CHANGE_AT, ramp=[-0.02], outliers=0)
    readings = history.readings(2)
    years = (readings[-1].time - readings[CHANGE_AT - 1].time).days / 365.25

    found = watch_of(readings, TENSION_ALONE)
    drift = last(found.tests).drifts[0]

    assert len(found.calls) == 1
    assert drift.shift_mean == pytest.approx(math.expm1(-0.02 * years), abs=0.004)
    assert drift.shift_sd < 0.02


def test_both_planes_of_an_end_that_loosen_together_are_called_and_named_together() -> None:
    history = History(BOTH_ENDS, tests=CHANGE_AT + 3, change_at=CHANGE_AT, outliers=0)
    step = [0.0, -1.6 * SPRING_STEP, -2 * SPRING_STEP, 0.0, 0.0]

    call = watch(replace(history, step=step)).calls[0]
    index, change = call.index, call.change
    first = change.moved[0]
    by_name = {each.quantity: each for each in change.moved}

    assert index <= CHANGE_AT + 2
    pair = {"log10_k1": "log10_k2", "log10_k3": "log10_k4"}
    pair |= {other: one for one, other in pair.items()}
    assert pair[first.quantity] in first.together
    other = by_name[pair[first.quantity]]
    assert other.probability == pytest.approx(first.probability, abs=0.05)
    # Which end it is no test tells here.
    springs = {each.name for each in BOTH_ENDS} - {"tension"}
    assert springs - {first.quantity} <= {*first.together, *first.alike}
    assert by_name["tension"].probability < 0.05


def test_springs_that_loosen_while_a_part_is_read_as_tension_are_called_in_five_tests() -> None:
    pairs = tuple(
        each if each.name == "tension" else replace(each, parameters=("one", "other"))
        for each in PLANES_ALONE
    )
    step = [0.06, -1.8 * SPRING_STEP, -2.1 * SPRING_STEP]
    history = History(pairs, tests=CHANGE_AT + 6, change_at=CHANGE_AT, step=step, outliers=0)

    call = watch(history).calls[0]
    index, change = call.index, call.change

    assert index <= CHANGE_AT + 4
    assert {each.quantity for each in change.moved if each.probability > 0.95} == {
        "tension",
        "log10_kx",
        "log10_ky",
    }
    assert change.moved[0].quantity != "tension"


def test_the_drift_is_the_state_with_the_swing_of_the_temperature_taken_out() -> None:
    history = History(tests=26, seasons_k=25, change_at=16, step=lost(0.08), outliers=0)

    drift = last(watch(history).tests).drifts[0]

    assert drift.value == pytest.approx(0.92 * 700e3, rel=0.004)
    assert drift.baseline == 700e3
    assert drift.threshold == HANGER_3.thresholds.tension_shift_fraction
    assert drift.probability > 0.99


def test_readings_out_of_order_or_of_other_quantities_are_refused() -> None:
    readings = History(tests=4).readings(0)

    with pytest.raises(BadInput, match="later"):
        watch_of(readings[::-1], TENSION_ALONE)
    with pytest.raises(BadInput, match="3 quantities"):
        watch_of(readings, PLANES_ALONE)


def test_tests_of_one_day_say_no_more_than_one() -> None:
    lost_readings = History(tests=10, change_at=8, step=lost(0.02), outliers=0).readings(2)
    of_a_day = [
        replace(lost_readings[8], test=f"same{n}", time=lost_readings[8].time + timedelta(hours=n))
        for n in range(6)
    ]

    one = watch_of(lost_readings[:9], TENSION_ALONE).tests[-1].change
    many = watch_of([*lost_readings[:8], *of_a_day], TENSION_ALONE).tests[-1].change

    assert not many.called
    assert many.evidence_years < 10
    assert many.probability == pytest.approx(one.probability, abs=0.15)
    two = watch_of(lost_readings, TENSION_ALONE).tests[-1].change
    assert two.evidence_years > 3 * many.evidence_years


def test_a_clock_that_is_off_is_named_and_a_trifle_is_not_called() -> None:
    steady = WatchOptions(tension_scatter=3e-4, bending_scatter=3e-4, mode_scatter=2e-4)
    impatient = replace(steady, limit_years=0.1)
    history = History(
        tests=18, change_at=CHANGE_AT, outliers=0, scatter=2e-4, seasons_k=0, days_k=1
    )

    def clock(by: float, options: WatchOptions, seed: int) -> Watch:
        return watch_of(replace(history, mode_step=[by]).readings(seed), TENSION_ALONE, options)

    # Of five seeds the trifle's evidence is thousands of times its limit in this one.
    off, trifle = clock(0.008, steady, 0), clock(0.003, impatient, 1)

    first = off.calls[0].change.moved[0]
    assert TIMEBASE in (first.quantity, *first.alike)
    assert not trifle.calls
    # It is no want of evidence: what it does is less than what is to be told.
    assert trifle.tests[-1].change.evidence_years > impatient.limit_years
    assert trifle.tests[-1].change.material_probability < 0.5


def test_modes_that_a_test_lacks_and_an_unknown_amplitude_are_no_change() -> None:
    rng = np.random.default_rng(6)
    history = History(PLANES_ALONE, tests=18, change_at=13, step=lost(0.06, q=3), outliers=0)
    readings = [
        without_modes(each, rng.choice(len(MODES), rng.integers(0, 7), replace=False).tolist())
        for each in history.readings(4)
    ]
    loud = [
        replace(each, amplitude=float(np.exp(rng.normal(0, 0.5)))) if n % 2 else each
        for n, each in enumerate(readings)
    ]

    for given in (readings, loud):
        (call,) = watch_of(given, PLANES_ALONE).calls
        index, change = call.index, call.change
        assert 13 <= index <= 16
        assert change.moved[0].quantity == "tension"


def test_what_goes_with_the_excitation_is_learnt_and_not_called() -> None:
    rng = np.random.default_rng(7)
    levels = rng.normal(0, 0.4, 16)
    levels[10:] += 1.0  # another hammer from then on
    readings = [
        replace(off_by(each, slopes(1)[:, 0] * -0.004 * level), amplitude=float(np.exp(level)))
        for each, level in zip(History(tests=16, outliers=0).readings(7), levels, strict=True)
    ]

    assert not watch_of(readings, TENSION_ALONE).calls
