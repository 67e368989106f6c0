"""What the watch takes for granted before any test, and what conditions of tests leave open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

import numpy as np
import scipy

from shm.assumptions import DEFAULTS, Assumptions
from shm.errors import UsageError
from shm.values import NAN, FloatArray
from shm.values.drift import OF_ONE_VISIT


@dataclass(frozen=True)
class WatchOptions:
    """What the watch takes for granted: limits, priors, and how much it computes.

    `limit_years` is the mean time to a false detection of one hanger, or less than it. The
    `scatter` standard deviations are of tests beyond what identification explains: fractions of the
    tension, and of a spring's `step_sd`. Temperature coefficients have mean 0: of the tension a
    fraction per kelvin, of a spring a fraction of its `step_sd`; likewise per unit of log
    amplitude. The first `baseline_tests` readings precede every change.

    - `sizes`, `size_shares`: of a change, in units of its prior, and how often: what may not be
      missed, what nobody can miss, and what only a mistake that stays does.
    - `checked_errors`: of errors of the measurement so few pass the check of a baseline.
    - `share_visits`: so many visits say as much of how often each disturbance comes as its table.
    - `spell_visits`: so many visits at most may one disturbance last, as a windy fortnight.
    - `least_frequency_shift`: a change that moves no plane's first frequency, nor its mean, by more
      is not detected.
    - `scatter_prior_tests`: so many tests say as much of the scatter as what is assumed; of a
      difference all counts up to `scatter_up_to_sds`, nothing from `change_from_sds` on.
    - `unnamed_nats`: causes whose evidence is within 20 to 1 are named together.
    - `beginnings`, `refined`, `rounds`, `leading`, `draws`: how many beginnings of a change are
      looked at, how many changes closely, by how many rounds of the labels, of how many a summary
      is made, and of how many samples.
    """

    limit_years: float = 100.0
    change_rate_per_year: float = DEFAULTS.change_rate_per_year.value
    tension_scatter: float = DEFAULTS.tension_scatter.value
    spring_scatter_of_step: float = DEFAULTS.spring_scatter_of_step.value
    bending_scatter: float = DEFAULTS.bending_scatter.value
    clock_scatter: float = DEFAULTS.clock_scatter.value
    mode_scatter: float = DEFAULTS.mode_scatter.value
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
    baseline_tests: int = 1
    sizes: tuple[float, ...] = (1.0, 6.0, 36.0, 216.0)
    size_shares: tuple[float, ...] = (0.9, 0.09, 0.009, 0.001)
    checked_errors: float = 0.12
    share_visits: float = 20.0
    spell_visits: int = 3
    scatter_prior_tests: float = 6.0
    scatter_up_to_sds: float = 3.0
    change_from_sds: float = 6.0
    scatter_rounds: int = 4
    unnamed_nats: float = 3.0
    beginnings: int = 60
    refined: int = 8
    rounds: int = 4
    leading: int = 24
    draws: int = 500

    @classmethod
    def of(cls, assumed: Assumptions, **given: Any) -> WatchOptions:
        """Return options with what is assumed of a hanger, but for those that are given."""
        rows = {each.name: assumed[each.name].value for each in fields(cls) if each.name in assumed}
        return cls(**{**rows, **given})

    def __post_init__(self) -> None:
        if self.baseline_tests < 1:
            raise UsageError("The watch needs one baseline test at least.")
        if self.limit_years <= 0 or self.change_rate_per_year <= 0:
            raise UsageError("The watch's limit and rate of changes must be more than 0.")


DAYS_PER_YEAR = 365.25  # Julian
OF_ONE_VISIT_YEARS = OF_ONE_VISIT.total_seconds() / 86400 / DAYS_PER_YEAR
_FROST_SPREAD_K = 2.0  # of frost where no thermometer was read: judgement, a mild winter's days
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


def frost_of(temperatures_c: FloatArray, thermometer_sd_k: float) -> Warmth:
    """Return kelvin below 0 C of tests at `temperatures_c` (T,), 0 above it, as far as known.

    The deck follows the air in its own time, so that near 0 C its mean is what counts.
    """
    known = np.isfinite(temperatures_c)
    scaled = np.where(known, temperatures_c, 0.0) / thermometer_sd_k
    below = scipy.special.ndtr(-scaled)
    density = np.exp(-(scaled**2) / 2) / math.sqrt(2 * math.pi)
    kelvin = thermometer_sd_k * (scaled * below - density)
    kelvin = np.where(known, kelvin, kelvin[known].mean() if known.any() else 0.0)
    sd = np.where(known, thermometer_sd_k * below, _FROST_SPREAD_K)
    return Warmth(kelvin, sd, np.ones(len(known)))


def years_between(first: datetime, second: datetime) -> float:
    """From the first to the second, in years of 365.25 days."""
    return (second - first).total_seconds() / 86400 / DAYS_PER_YEAR


def _unmeasured(known_k: FloatArray, otherwise_sd: float) -> tuple[float, float]:
    """Mean and sd where the temperature is unknown; few known ones do not tell their sd."""
    mean = float(np.mean(known_k)) if len(known_k) else 0.0
    spread = float(np.std(known_k, ddof=1)) if len(known_k) > 1 else 0.0
    return mean, max(spread, otherwise_sd)
