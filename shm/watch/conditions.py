"""What the conditions of tests leave open: temperatures that nobody wrote down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from shm.values import NAN, FloatArray
from shm.values.drift import OF_ONE_VISIT
from shm.watch.options import WatchOptions

DAYS_PER_YEAR = 365.25  # Julian
OF_ONE_VISIT_YEARS = OF_ONE_VISIT.total_seconds() / 86400 / DAYS_PER_YEAR
_SEASON_YEARS = 60 / DAYS_PER_YEAR  # judgement: so many days are of one season


@dataclass(frozen=True, eq=False)
class Warmth:
    """Of tests (T,): kelvin from the reference, the sd of each, and how many tests of its season
    before it lack their temperature as well, itself among them (1 where it does not)."""

    kelvin: FloatArray
    sd: FloatArray
    shared: FloatArray


def reference_of(temperatures_c: Sequence[float]) -> float:
    """The mean of those known; NaN where none is."""
    known = [value for value in temperatures_c if math.isfinite(value)]
    return float(np.mean(known)) if known else NAN


def warmth_of(
    temperatures_c: FloatArray, years: FloatArray, reference_c: float, options: WatchOptions
) -> Warmth:
    """Of tests at `years` (T,), ascending.

    A temperature that was not measured is as those measured: their mean and standard deviation.
    Tests of one season share what they miss, so that those of 60 days tell no more together than
    one. A thermometer tells the air's, which the steel follows in its own time.
    """
    known = np.isfinite(temperatures_c)
    from_reference = temperatures_c[known] - reference_c
    mean, sd = _unmeasured(from_reference, options.unknown_temperature_sd_k)
    kelvin, of_each = np.full(len(years), mean), np.full(len(years), sd)
    kelvin[known], of_each[known] = from_reference, options.thermometer_sd_k
    lately = (years[:, None] >= years) & (years > years[:, None] - _SEASON_YEARS) & ~known
    in_order = np.tril(lately)  # of tests at the very same time those before
    return Warmth(kelvin, of_each, np.where(known, 1.0, in_order.sum(axis=1)))


def years_between(first: datetime, second: datetime) -> float:
    """From the first to the second, in years of 365.25 days."""
    return (second - first).total_seconds() / 86400 / DAYS_PER_YEAR


def _unmeasured(known_k: FloatArray, otherwise_sd: float) -> tuple[float, float]:
    """Mean and sd where the temperature is unknown; few known ones do not tell their sd."""
    mean = float(np.mean(known_k)) if len(known_k) else 0.0
    spread = float(np.std(known_k, ddof=1)) if len(known_k) > 1 else 0.0
    return mean, max(spread, otherwise_sd)
