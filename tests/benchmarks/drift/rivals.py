"""The rules that an engineer would set up on the tension alone.

Each gives a statistic for every test; the rule alarms where it is beyond a limit. Two-sided tabular
CUSUM with a reference value of half a standard deviation: E. S. Page, Biometrika 41 (1954); D. C.
Montgomery, Introduction to Statistical Quality Control (2009), 9.1. All are given the benefit of a
baseline cleared of outliers, and of tensions fitted with the end springs held.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.values import BoolArray, FloatArray, Reading
from tests.benchmarks.drift.climate import DAYS_A_YEAR
from tests.benchmarks.drift.outcomes import CUSUM, CUSUM_CLIPPED, CUSUM_WARM, THREE_SIGMA
from tests.benchmarks.drift.years import SOUND_TESTS

_REFERENCE, _CLIPPED_AT = 0.5, 3.0
_MAD, _FAR = 1.4826, 3.5


def statistics(readings: Sequence[Reading], days: FloatArray) -> dict[str, FloatArray]:
    """The statistic of each rule at each test (tests,); 0 within its baseline."""
    tension = np.array([log_tension(reading) for reading in readings])
    warmth = np.array([reading.temperature_c for reading in readings])
    plain = standardised(tension, np.arange(len(tension)) < SOUND_TESTS)
    first_year = days < DAYS_A_YEAR
    warm = standardised(without_swing(tension, warmth, first_year), first_year)
    return {
        THREE_SIGMA: np.abs(np.nan_to_num(plain)),
        CUSUM: cusum(plain),
        CUSUM_WARM: cusum(warm),
        CUSUM_CLIPPED: cusum(np.clip(warm, -_CLIPPED_AT, _CLIPPED_AT)),
    }


def log_tension(reading: Reading) -> float:
    """The log of the tension over the baseline's, were the end springs those of the baseline."""
    return float(reading.information[0] @ reading.mean / reading.information[0, 0])


def without_swing(tension: FloatArray, warmth_c: FloatArray, known: BoolArray) -> FloatArray:
    """Less a line in the temperature, fitted where `known`; NaN where no temperature is."""
    used = known & np.isfinite(warmth_c)
    used[used] = sound(tension[used])
    for _ in range(2):
        slope, level = np.polyfit(warmth_c[used], tension[used], 1)
        rest = np.asarray(tension - level - slope * warmth_c)
        used = known & np.isfinite(rest)
        used[used] = sound(rest[used])
    return rest


def standardised(values: FloatArray, baseline: BoolArray) -> FloatArray:
    """By mean and standard deviation of the baseline's sound tests; NaN within the baseline."""
    own = values[baseline & np.isfinite(values)]
    own = own[sound(own)]
    scaled = (values - own.mean()) / own.std(ddof=1)
    return np.asarray(np.where(baseline, np.nan, scaled))


def sound(values: FloatArray) -> BoolArray:
    """Which values (n,) are within 3.5 robust standard deviations of the median."""
    off = np.abs(values - np.median(values))
    return np.asarray(off <= _FAR * _MAD * np.median(off), bool)


def cusum(scaled: FloatArray) -> FloatArray:
    """The larger of the sums up and down (tests,); a NaN leaves them as they are."""
    up = down = 0.0
    found = np.zeros(len(scaled))
    for n, value in enumerate(scaled):
        if np.isfinite(value):
            up = max(0.0, up + value - _REFERENCE)
            down = max(0.0, down - value - _REFERENCE)
        found[n] = max(up, down)
    return found
