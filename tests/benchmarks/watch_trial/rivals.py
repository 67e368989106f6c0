"""What an engineer sets up without us: two rules on the first frequency.

Its line in the temperature, fitted over the first year, is taken off; no test counts for more than
three standard deviations of that year. Two-sided tabular CUSUM with a reference value of half a
standard deviation: E. S. Page, Biometrika 41 (1954); EWMA with weight 0.2: S. W. Roberts,
Technometrics 1 (1959); D. C. Montgomery, Introduction to Statistical Quality Control (2009), 9.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.values import BoolArray, FloatArray, ModalTest

DAYS_A_YEAR = 365.25
_FIRST = ("transverse", 1)
_REFERENCE, _CLIPPED_AT, _EWMA = 0.5, 3.0, 0.2
_MAD, _FAR = 1.4826, 3.5


def rivals(tests: Sequence[ModalTest], days: FloatArray) -> dict[str, list[float]]:
    """The statistic of each rule at each test; 0 within the first year, which is its baseline."""
    first = np.array(
        [
            next((np.log(m.frequency_hz) for m in t.modes if (m.plane, m.order) == _FIRST), np.nan)
            for t in tests
        ]
    )
    warmth = np.array([t.temperature_c for t in tests])
    year = (days < DAYS_A_YEAR) | (np.arange(len(days)) < 6)
    rest = without_swing(first, warmth, year)
    # A test without a temperature is taken at the mean.
    rest = np.where(np.isfinite(rest), rest, first - np.nanmedian(first[year]))
    clipped = np.clip(standardised(rest, year), -_CLIPPED_AT, _CLIPPED_AT)
    return {
        "CUSUM": cusum(clipped).round(3).tolist(),
        "EWMA": ewma(clipped).round(3).tolist(),
    }


def without_swing(values: FloatArray, warmth_c: FloatArray, known: BoolArray) -> FloatArray:
    """Less a line in the temperature, fitted where `known`; NaN where no temperature is."""
    used = known & np.isfinite(warmth_c) & np.isfinite(values)
    used[used] = sound(values[used])
    for _ in range(2):
        slope, level = np.polyfit(warmth_c[used], values[used], 1)
        rest = np.asarray(values - level - slope * warmth_c)
        used = known & np.isfinite(rest)
        used[used] = sound(rest[used])
    return rest


def standardised(values: FloatArray, baseline: BoolArray) -> FloatArray:
    """By mean and standard deviation of the baseline's sound tests; NaN within the baseline."""
    own = values[baseline & np.isfinite(values)]
    own = own[sound(own)]
    scaled = (values - own.mean()) / max(float(own.std(ddof=1)), 1e-9)
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


def ewma(scaled: FloatArray) -> FloatArray:
    """The moving average's size (tests,); a NaN leaves it as it is."""
    level, found = 0.0, np.zeros(len(scaled))
    for n, value in enumerate(scaled):
        level = level if np.isnan(value) else (1 - _EWMA) * level + _EWMA * value
        found[n] = abs(level)
    return found
