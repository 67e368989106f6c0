"""Readings as the filters take them: in units of a step, along the directions that a test sees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shm.errors import BadInput
from shm.values import NAN, FloatArray, Reading
from shm.watch.options import WatchOptions

DAYS_PER_YEAR = 365.25
_SEASON_YEARS = 60 / DAYS_PER_YEAR
_SEEN_AT_ALL = 1e-4
_SEEN_BESIDE_OTHERS = 1e-11


@dataclass(frozen=True, eq=False)
class Measurement:
    """One reading: `values` (d,) = `directions` (q, d)' x + noise of `variances` (d,).

    x is in units of each quantity's `step_sd`. Directions that the test does not see are left out,
    so d <= q. `kelvin` is the temperature from the reference, `kelvin_sd` 0 where it was measured;
    where not, `per_kelvin` (q,) is what the softening of the steel does to x besides.
    """

    years: float
    kelvin: float
    kelvin_sd: float
    per_kelvin: FloatArray
    values: FloatArray
    directions: FloatArray
    variances: FloatArray


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
        together than one.
        """
        if math.isfinite(temperature_c):
            reference = self.reference_c if math.isfinite(self.reference_c) else temperature_c
            kelvin = temperature_c - reference
            known = np.append(self.known_k, kelvin)
            return replace(self, reference_c=reference, known_k=known), kelvin, 0.0
        lately = self.unknown_years[self.unknown_years > years - _SEASON_YEARS]
        unknown = np.append(lately, years)
        mean, sd = _unmeasured(self.known_k, options.unknown_temperature_sd_k)
        return replace(self, unknown_years=unknown), mean, sd * math.sqrt(len(unknown))


def years_between(first: datetime, second: datetime) -> float:
    """From the first to the second, in years of 365.25 days."""
    return (second - first).total_seconds() / 86400 / DAYS_PER_YEAR


def measurement_of(
    reading: Reading, steps: FloatArray, years: float, kelvin: float, kelvin_sd: float
) -> Measurement:
    """A reading of quantities whose steps are `steps` (q,).

    Raises BadInput where it is not of as many.
    """
    n = len(steps)
    if reading.mean.shape != (n,) or reading.information.shape != (n, n):
        raise BadInput(f"The reading of test {reading.test} is not of {n} quantities.")
    information = steps[:, None] * reading.information * steps
    sizes, vectors = np.linalg.eigh((information + information.T) / 2)
    seen = sizes > max(_SEEN_AT_ALL, _SEEN_BESIDE_OTHERS * float(sizes[-1]))
    sizes, vectors = sizes[seen], vectors[:, seen]
    softened = np.zeros(n) if reading.per_kelvin is None else reading.per_kelvin / steps
    values = vectors.T @ (steps * (reading.information @ reading.mean)) / sizes
    values = values - kelvin * (vectors.T @ softened)
    # Rows of about unit variance keep the innovations well conditioned.
    scale = 1 / np.sqrt(1 + 1 / sizes)
    return Measurement(
        years=years,
        kelvin=kelvin,
        kelvin_sd=kelvin_sd,
        per_kelvin=softened,
        values=values * scale,
        directions=vectors * scale,
        variances=scale**2 / sizes,
    )


def _unmeasured(known_k: FloatArray, otherwise_sd: float) -> tuple[float, float]:
    """Mean and sd where the temperature is unknown; few known ones do not tell their sd."""
    mean = float(np.mean(known_k)) if len(known_k) else 0.0
    spread = float(np.std(known_k, ddof=1)) if len(known_k) > 1 else 0.0
    return mean, max(spread, otherwise_sd)
