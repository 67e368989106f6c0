"""Options of the watch, and what the temperatures of tests leave open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any, Self

import numpy as np
import scipy

from shm.assumptions import DEFAULTS, Assumptions
from shm.errors import UsageError
from shm.values import NAN, FloatArray
from shm.values.drift import OF_ONE_VISIT
from shm.watch.engine.limits import LIMITS


@dataclass(frozen=True)
class Assumed:
    """Options, some of which are rows of the table of assumptions."""

    @classmethod
    def of(cls, assumed: Assumptions, **given: Any) -> Self:
        """Return options with what is assumed of a hanger, but for those that are given."""
        rows = {each.name: assumed[each.name].value for each in fields(cls) if each.name in assumed}
        return cls(**{**rows, **given})


@dataclass(frozen=True)
class WatchOptions(Assumed):
    """Limits and priors of the sequential test.

    `limit_years` is the mean time to a false call of one hanger, or less than it. The `scatter`
    tuples are what tests may differ by beyond what identification explains: fractions of the
    tension, and shares of a spring's `step_sd`; which pair of them holds is learnt.
    Temperature coefficients have mean 0 and the sds given, of the tension a fraction per kelvin, of
    a spring a share of its `step_sd` per kelvin; likewise per unit of log amplitude, of the bending
    stiffness a share. The first `baseline_tests` readings are taken to
    precede every change. `beginnings` is how many possible beginnings of a change are kept.
    `most_of_one_test` is the share of the limit that no test exceeds by itself, however wild.
    """

    limit_years: float = 100.0
    change_rate_per_year: float = DEFAULTS.change_rate_per_year.value
    outlier_probability: float = DEFAULTS.outlier_probability.value
    tension_scatter: float = DEFAULTS.tension_scatter.value
    spring_scatter_of_step: float = DEFAULTS.spring_scatter_of_step.value
    bending_scatter: float = DEFAULTS.bending_scatter.value
    clock_scatter: float = DEFAULTS.clock_scatter.value
    mode_scatter: float = DEFAULTS.mode_scatter.value
    scatter_scales: tuple[float, ...] = (0.6, 1.0, 1.6, 2.6)
    tension_per_kelvin_sd: float = DEFAULTS.tension_per_kelvin_sd.value
    spring_per_kelvin_sd_of_step: float = DEFAULTS.spring_per_kelvin_sd_of_step.value
    tension_per_amplitude_sd: float = DEFAULTS.tension_per_amplitude_sd.value
    spring_per_amplitude_sd_of_step: float = DEFAULTS.spring_per_amplitude_sd_of_step.value
    bending_per_amplitude_sd: float = DEFAULTS.bending_per_amplitude_sd.value
    creep_per_year_sd: float = DEFAULTS.creep_per_year_sd.value
    unknown_temperature_sd_k: float = DEFAULTS.unknown_temperature_sd_k.value
    thermometer_sd_k: float = DEFAULTS.thermometer_sd_k.value
    unknown_log_amplitude_sd: float = DEFAULTS.unknown_log_amplitude_sd.value
    least_frequency_shift: float = 0.006
    most_of_one_test: float = 0.2
    baseline_tests: int = 1
    beginnings: int = 60

    def __post_init__(self) -> None:
        if not self.scatter_scales:
            raise UsageError("The watch needs one scale of the scatter at least.")
        if self.baseline_tests < 1:
            raise UsageError("The watch needs one baseline test at least.")
        if not 0 < self.outlier_probability < 1:
            raise UsageError("The probability of an outlier must lie between 0 and 1.")
        if self.limit_years <= 0 or self.change_rate_per_year <= 0:
            raise UsageError("The watch's limit and rate of changes must be more than 0.")


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
    """Return the mean of those known; NaN where none is."""
    known = [value for value in temperatures_c if math.isfinite(value)]
    return float(np.mean(known)) if known else NAN


def temperature_offsets(
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


def frost_of(temperatures_c: FloatArray, thermometer_sd_k: float) -> Warmth:
    """Kelvin below 0 C of tests at `temperatures_c` (T,), 0 above it, as far as one knows.

    The deck follows the air in its own time, so that near 0 C its mean is what counts.
    """
    known = np.isfinite(temperatures_c)
    scaled = np.where(known, temperatures_c, 0.0) / thermometer_sd_k
    below = scipy.special.ndtr(-scaled)
    density = np.exp(-(scaled**2) / 2) / math.sqrt(2 * math.pi)
    kelvin = thermometer_sd_k * (scaled * below - density)
    kelvin = np.where(known, kelvin, kelvin[known].mean() if known.any() else 0.0)
    sd = np.where(known, thermometer_sd_k * below, LIMITS.frost_spread_k)
    return Warmth(kelvin, sd, np.ones(len(known)))


def years_between(first: datetime, second: datetime) -> float:
    """From the first to the second, in years of 365.25 days."""
    return (second - first).total_seconds() / 86400 / DAYS_PER_YEAR


def _unmeasured(known_k: FloatArray, otherwise_sd: float) -> tuple[float, float]:
    """Mean and sd where the temperature is unknown; few known ones do not tell their sd."""
    mean = float(np.mean(known_k)) if len(known_k) else 0.0
    spread = float(np.std(known_k, ddof=1)) if len(known_k) > 1 else 0.0
    return mean, max(spread, otherwise_sd)
