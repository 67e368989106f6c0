"""What the conditions of tests leave open: temperatures that nobody wrote down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shm.values import NAN, FloatArray
from shm.watch.options import WatchOptions

DAYS_PER_YEAR = 365.25  # Julian
_SEASON_YEARS = 60 / DAYS_PER_YEAR  # judgement: so many days are of one season


@dataclass(frozen=True, eq=False)
class Warmth:
    """What the temperatures of the readings so far say of the next that has none.

    `reference_c` is the mean of the baseline's, or the first one known, NaN before there is any;
    `known_k` are those measured, from it, and `unknown_years` the times of the last tests without.
    """

    reference_c: float
    known_k: FloatArray
    unknown_years: FloatArray

    @classmethod
    def at(cls, temperatures_c: Sequence[float]) -> Warmth:
        """Before any reading; the reference is the mean of the baseline's `temperatures_c`."""
        known = [value for value in temperatures_c if math.isfinite(value)]
        return cls(float(np.mean(known)) if known else NAN, np.zeros(0), np.zeros(0))

    def after(
        self, temperature_c: float, years: float, options: WatchOptions
    ) -> tuple[Warmth, float, float]:
        """The same after one more reading, and what is to be taken for its kelvin and their sd.

        A temperature that was not measured is as those measured before: their mean and standard
        deviation. Tests of one season share what they miss, so that those of 60 days tell no more
        together than one. A thermometer tells the air's, which the steel follows in its own time.
        """
        if math.isfinite(temperature_c):
            reference = self.reference_c if math.isfinite(self.reference_c) else temperature_c
            kelvin = temperature_c - reference
            known = np.append(self.known_k, kelvin)
            warmth = replace(self, reference_c=reference, known_k=known)
            return warmth, kelvin, options.thermometer_sd_k
        lately = self.unknown_years[self.unknown_years > years - _SEASON_YEARS]
        unknown = np.append(lately, years)
        mean, sd = _unmeasured(self.known_k, options.unknown_temperature_sd_k)
        return replace(self, unknown_years=unknown), mean, sd * math.sqrt(len(unknown))


def years_between(first: datetime, second: datetime) -> float:
    """From the first to the second, in years of 365.25 days."""
    return (second - first).total_seconds() / 86400 / DAYS_PER_YEAR


def _unmeasured(known_k: FloatArray, otherwise_sd: float) -> tuple[float, float]:
    """Mean and sd where the temperature is unknown; few known ones do not tell their sd."""
    mean = float(np.mean(known_k)) if len(known_k) else 0.0
    spread = float(np.std(known_k, ddof=1)) if len(known_k) > 1 else 0.0
    return mean, max(spread, otherwise_sd)
