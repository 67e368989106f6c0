"""Readings as the filters take them: in units of a step, along the directions that a test sees."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from shm.errors import BadInput
from shm.values import FloatArray, Reading, WatchedQuantity
from shm.watch.options import WatchOptions

DAYS_PER_YEAR = 365.25
_SEASON_YEARS = 60 / DAYS_PER_YEAR
_SEEN_AT_ALL = 1e-4
_SEEN_BESIDE_OTHERS = 1e-11


@dataclass(frozen=True, eq=False)
class Measurement:
    """One reading: `values` (d,) = `directions` (q, d)' x + noise of `variances` (d,).

    x is in units of each quantity's `step_sd`. Directions that the test does not see are left out,
    so d <= q. `kelvin` is the temperature from the reference, `kelvin_sd` 0 where it was measured.
    """

    years: float
    kelvin: float
    kelvin_sd: float
    values: FloatArray
    directions: FloatArray
    variances: FloatArray


def measurements(
    readings: Sequence[Reading], quantities: Sequence[WatchedQuantity], options: WatchOptions
) -> list[Measurement]:
    """One for each reading, in years from the first.

    Raises BadInput where times go back, or a reading is not of these quantities.
    """
    _check(readings, len(quantities))
    steps = np.array([quantity.step_sd for quantity in quantities])
    years = [years_between(readings[0].time, reading.time) for reading in readings]
    kelvin = _kelvin([reading.temperature_c for reading in readings], years, options)
    return [
        _measurement(reading, steps, year, *warmth)
        for reading, year, warmth in zip(readings, years, kelvin, strict=True)
    ]


def years_between(first: datetime, second: datetime) -> float:
    """From the first to the second, in years of 365.25 days."""
    return (second - first).total_seconds() / 86400 / DAYS_PER_YEAR


def _check(readings: Sequence[Reading], n: int) -> None:
    for before, after in itertools.pairwise(readings):
        if after.time < before.time:
            raise BadInput(
                f"The watch was given test {after.test} after {before.test}, which is later.",
                remedy="Sort the tests by time.",
            )
    for reading in readings:
        if reading.mean.shape != (n,) or reading.information.shape != (n, n):
            raise BadInput(f"The reading of test {reading.test} is not of {n} quantities.")


def _measurement(
    reading: Reading, steps: FloatArray, years: float, kelvin: float, kelvin_sd: float
) -> Measurement:
    information = steps[:, None] * reading.information * steps
    sizes, vectors = np.linalg.eigh((information + information.T) / 2)
    seen = sizes > max(_SEEN_AT_ALL, _SEEN_BESIDE_OTHERS * float(sizes[-1]))
    sizes, vectors = sizes[seen], vectors[:, seen]
    values = vectors.T @ (steps * (reading.information @ reading.mean)) / sizes
    # Rows of about unit variance keep the innovations well conditioned.
    scale = 1 / np.sqrt(1 + 1 / sizes)
    return Measurement(
        years=years,
        kelvin=kelvin,
        kelvin_sd=kelvin_sd,
        values=values * scale,
        directions=vectors * scale,
        variances=scale**2 / sizes,
    )


def _kelvin(
    temperatures_c: Sequence[float], years: Sequence[float], options: WatchOptions
) -> list[tuple[float, float]]:
    """Temperature from the baseline's mean and its sd, of each test.

    One that was not measured is as those measured before: their mean and standard deviation. Tests
    of one season share what they miss, so that those of 60 days tell no more together than one.
    """
    known = [value for value in temperatures_c if math.isfinite(value)]
    baseline = [v for v in temperatures_c[: options.baseline_tests] if math.isfinite(v)]
    reference = float(np.mean(baseline)) if baseline else (known[0] if known else 0.0)
    found: list[tuple[float, float]] = []
    before: list[float] = []
    unknown: list[float] = []
    for value, year in zip(temperatures_c, years, strict=True):
        if math.isfinite(value):
            before.append(value - reference)
            found.append((value - reference, 0.0))
        else:
            unknown = [*(each for each in unknown if each > year - _SEASON_YEARS), year]
            mean, sd = _unmeasured(before, options.unknown_temperature_sd_k)
            found.append((mean, sd * math.sqrt(len(unknown))))
    return found


def _unmeasured(before: Sequence[float], otherwise_sd: float) -> tuple[float, float]:
    """Mean and sd where the temperature is unknown; few known ones do not tell their sd."""
    mean = float(np.mean(before)) if before else 0.0
    spread = float(np.std(before, ddof=1)) if len(before) > 1 else 0.0
    return mean, max(spread, otherwise_sd)
