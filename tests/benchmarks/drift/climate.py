"""When a hanger is tested over the years, and how warm it is then."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np

from shm.values import FloatArray

BEGIN = datetime(2020, 1, 1, tzinfo=UTC)
DAYS_A_YEAR = 365.25
TESTS_A_YEAR = 26
MEAN_C = 10.0
_LEAST_GAP_DAYS = 1.0
_LONG_GAP_DAYS = (60.0, 150.0)
_HOURS = (7.0, 18.0)
_WARMEST_DAY, _WARMEST_HOUR = 200.0, 15.0
_DAY_K, _WEATHER_K, _WEATHER_DAYS = 8.0, 3.0, 5.0


def days_of_tests(years: float, rng: np.random.Generator) -> FloatArray:
    """Days since the beginning (tests,): gaps at random, and once one of two to five months."""
    mean = DAYS_A_YEAR / TESTS_A_YEAR - _LEAST_GAP_DAYS
    gaps = _LEAST_GAP_DAYS + rng.exponential(mean, int(2 * years * TESTS_A_YEAR))
    gaps[rng.integers(TESTS_A_YEAR // 2, int(years * TESTS_A_YEAR))] += rng.uniform(*_LONG_GAP_DAYS)
    days = np.floor(np.cumsum(gaps)) + rng.uniform(*_HOURS, len(gaps)) / 24
    return np.asarray(days[days < years * DAYS_A_YEAR])


def temperatures_c(days: FloatArray, season_k: float, rng: np.random.Generator) -> FloatArray:
    """The hanger's temperature at each test: season, hour of the day under clouds, weather."""
    season = season_k * np.cos(2 * np.pi * (days - _WARMEST_DAY) / DAYS_A_YEAR)
    hour = np.cos(2 * np.pi * (24 * (days % 1) - _WARMEST_HOUR) / 24)
    sun = _DAY_K * rng.uniform(0.2, 1.0, len(days)) * hour
    return np.asarray(MEAN_C + season + sun + _weather_k(days, rng))


def _weather_k(days: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Warm and cold spells of some days: a first-order process."""
    drawn = _WEATHER_K * rng.standard_normal(len(days))
    kept = np.exp(-np.diff(days, prepend=days[:1]) / _WEATHER_DAYS)
    for n in range(1, len(days)):
        drawn[n] = kept[n] * drawn[n - 1] + np.sqrt(1 - kept[n] ** 2) * drawn[n]
    return np.asarray(drawn)


def time_of(day: float) -> datetime:
    return BEGIN + timedelta(days=float(day))


def days_since(moment: datetime) -> float:
    """Days since the beginning."""
    return (moment - BEGIN).total_seconds() / 86400
