"""The state over time: exact where it can be checked, calibrated where it is simulated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from shm.errors import NothingThere, UsageError
from shm.values import FloatArray
from shm.values.drift import Change, Reading, WatchedQuantity
from shm.watch.engine.state import StateHistory, StateOptions, set_free, states

START = datetime(2024, 1, 1, tzinfo=UTC)
BASELINE_N = 711e3
_GRID = np.linspace(-1, 1, 201)
TENSION = WatchedQuantity("tension", BASELINE_N, _GRID, BASELINE_N * np.exp(_GRID), 0.05)
SPRING = WatchedQuantity("log10_k1", 7.0, _GRID, 7 + 40 * np.tanh(_GRID), 0.01, end="deck")
OPTIONS = StateOptions(reference_temperature_c=12.0)
SERIES = 50


def reading(
    day: float, mean: FloatArray | list[float], sd: float = 1e-3, temperature_c: float = 12.0
) -> Reading:
    """A test that sees every quantity with the same sd."""
    where = np.asarray(mean, np.float64)
    time = START + timedelta(days=day)
    return Reading(f"t{day:g}", time, temperature_c, where, np.eye(len(where)) / sd**2)


def weekly(levels: FloatArray, seed: int = 0, sd: float = 1e-3) -> list[Reading]:
    """Weekly readings about `levels` (n,) of the tension."""
    noisy = levels + np.random.default_rng(seed).normal(0, sd, len(levels))
    return [reading(7.0 * week, [x], sd) for week, x in enumerate(noisy)]


@dataclass(frozen=True)
class Simulated:
    """A simulated hanger: its true level (n,), its coefficient, and what is found of them."""

    level: FloatArray
    coefficient: float
    history: StateHistory


def simulated(seed: int) -> Simulated:
    """Two years of irregular tests with seasons, a wandering level, scatter and reading errors."""
    rng = np.random.default_rng(seed)
    days = np.cumsum(rng.exponential(14.0, 50))
    steps = 0.005 * np.sqrt(np.diff(days, prepend=days[0]) / 365.25)
    level = 0.01 * rng.normal() + np.cumsum(steps * rng.normal(size=len(days)))
    temperatures = 12 + 12 * np.sin(2 * np.pi * days / 365.25) + rng.normal(0, 4, len(days))
    coefficient, sds = 2e-3 * rng.normal(), rng.uniform(5e-4, 2e-3, len(days))
    means = level + coefficient * (temperatures - 12) + np.hypot(sds, 1e-3) * rng.normal(size=50)
    readings = [
        reading(float(day), [x], float(sd), float(c))
        for day, x, sd, c in zip(days, means, sds, temperatures, strict=True)
    ]
    return Simulated(level, coefficient, states(readings, [TENSION], options=OPTIONS))


@pytest.fixture(scope="module")
def series() -> list[Simulated]:
    return [simulated(seed) for seed in range(SERIES)]


def held(truth: FloatArray, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Whether the 90 % band holds the truth, (n,)."""
    reach = 1.645 * np.sqrt(covariance[:, 0, 0])
    return np.asarray(np.abs(mean[:, 0] - truth) < reach)


@pytest.mark.trial
def test_ninety_percent_bands_hold_the_true_level_nine_times_in_ten(
    series: list[Simulated],
) -> None:
    filtered, smoothed = [], []
    for each in series:
        found = each.history
        filtered.append(held(each.level, found.filtered_mean, found.filtered_covariance))
        smoothed.append(held(each.level, found.smoothed_mean, found.smoothed_covariance))
    assert 0.84 <= np.mean(filtered) <= 0.95
    assert 0.84 <= np.mean(smoothed) <= 0.95


@pytest.mark.trial
def test_the_temperature_coefficient_is_found_and_its_sd_is_honest(series: list[Simulated]) -> None:
    errors = []
    for each in series:
        (found,) = each.history.temperature_coefficients()
        assert found.sd < 1.5e-4
        errors.append((found.mean - each.coefficient) / found.sd)
    assert 0.8 <= np.mean(np.abs(errors) < 1.645) <= 0.98


def test_known_outliers_of_ten_sd_move_the_level_by_less_than_half_its_sd() -> None:
    clean = weekly(np.zeros(60), seed=3)
    blunders = {11: 1, 30: -1, 31: -1, 59: 1}
    dirty = [
        replace(r, mean=r.mean + 0.01 * blunders[at]) if at in blunders else r
        for at, r in enumerate(clean)
    ]
    weights = np.array([0.999 if at in blunders else 0.003 for at in range(60)])
    before = states(clean, [TENSION], options=OPTIONS)
    after = states(dirty, [TENSION], weights, options=OPTIONS)
    trusting = states(dirty, [TENSION], options=OPTIONS)
    sd = np.sqrt(before.smoothed_covariance[:, 0, 0])
    assert np.all(np.abs(after.smoothed_mean - before.smoothed_mean)[:, 0] < sd / 2)
    assert np.any(np.abs(trusting.smoothed_mean - before.smoothed_mean)[:, 0] > sd)


def test_a_called_step_is_followed_within_one_test() -> None:
    readings = weekly(np.where(np.arange(40) < 25, 0.0, -0.08), seed=4)
    called = states(readings, [TENSION], changes=[readings[25].time], options=OPTIONS)
    assert called.filtered_mean[24, 0] == pytest.approx(0.0, abs=2e-3)
    assert called.filtered_mean[25, 0] == pytest.approx(-0.08, abs=4e-3)
    assert called.smoothed_mean[24, 0] == pytest.approx(0.0, abs=2e-3)
    assert called.level_rate[0] < 0.01
    uncalled = states(readings, [TENSION], options=OPTIONS)
    assert uncalled.level_rate[0] > 5 * called.level_rate[0]


def called(readings: list[Reading], first: int, last: int, sudden: float) -> Change:
    """A change that began after test `first` and by test `last`."""
    return Change(900.0, 100.0, 1.0, sudden, readings[first].time, readings[last].time, ())


def test_a_called_step_frees_the_tests_of_its_beginning_a_ramp_none() -> None:
    readings = weekly(np.zeros(30))
    times = [each.time for each in readings]
    clear, vague = called(readings, 3, 6, 0.9), called(readings, 8, 20, 0.9)
    assert set_free([clear], readings) == tuple(times[4:7])
    assert set_free([clear, clear, vague], readings) == (*times[4:7], times[20])
    assert set_free([called(readings, 3, 6, 0.1), called(readings, 3, 6, math.nan)], readings) == ()


def test_a_test_without_temperature_weighs_less() -> None:
    rng = np.random.default_rng(8)
    warm = 12 + rng.normal(0, 10, 40)
    readings = [
        reading(7.0 * i, [0.001 * (c - 12) + rng.normal(0, 1e-3)], temperature_c=float(c))
        for i, c in enumerate(warm)
    ]
    unknown = replace(readings[-1], temperature_c=math.nan, mean=np.array([0.03]))
    history = states([*readings[:-1], unknown], [TENSION], options=OPTIONS)
    told = states(
        [*readings[:-1], replace(unknown, temperature_c=12.0)], [TENSION], options=OPTIONS
    )
    assert abs(history.filtered_mean[-1, 0]) < 0.2 * abs(told.filtered_mean[-1, 0])
    assert history.coefficient_mean[0] == pytest.approx(0.001, abs=1e-4)


def test_bands_are_in_newtons_and_in_decades() -> None:
    readings = [reading(7.0 * week, [-0.05, 0.01], 1e-4) for week in range(30)]
    history = states(readings, [TENSION, SPRING], options=OPTIONS)
    tension, spring = history.smoothed("tension"), history.smoothed("log10_k1")
    assert tension.middle[-1] == pytest.approx(BASELINE_N * math.exp(-0.05), rel=1e-3)
    assert spring.middle[-1] == pytest.approx(7.4, abs=0.02)
    assert tension.low[-1] < tension.middle[-1] < tension.high[-1]
    assert history.read("tension").middle[3] == pytest.approx(tension.middle[3], rel=1e-3)


def test_what_cannot_be_used_is_refused() -> None:
    with pytest.raises(NothingThere):
        states([], [TENSION])
    with pytest.raises(UsageError, match="Watched: tension"):
        states(weekly(np.zeros(3)), [TENSION]).filtered("log10_k9")
