"""Tension and end stiffness over time: local levels with the temperature as regressor.

level_t = level_{t-1} + N(0, rate^2 dt), reading_t = level_t + coefficient (temperature_t -
reference) + scatter + the reading's own error, of all quantities jointly. What the sequential test
has found goes in: outliers get a wide noise, at a called change the level is set free.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from shm.assumptions import DEFAULTS, Assumptions
from shm.errors import NothingThere, UsageError
from shm.values import FloatArray
from shm.values.drift import TENSION, Change, Reading, TemperatureCoefficient, WatchedQuantity
from shm.values.kinds import NAN
from shm.values.rounding import NINETY_PERCENT
from shm.watch.options import reference_of
from shm.watch.quantities import value_at

if TYPE_CHECKING:
    from shm.watch.local_level import Course, LocalLevels


@dataclass(frozen=True, eq=False)
class Band:
    """Median and 90 % interval of a quantity at each test, each (n,); NaN where nothing is known.

    The tension is in N, a stiffness is log10 of it in the unit of its parameter.
    """

    low: FloatArray
    middle: FloatArray
    high: FloatArray


@dataclass(frozen=True, eq=False)
class StateHistory:
    """Levels of all watched quantities over the tests of a hanger, in the watch's coordinates.

    `filtered_mean` (n, q) and `filtered_covariance` (n, q, q) rest on the tests up to each, the
    smoothed ones on all. Every level holds at `reference_temperature_c`: the swing with the
    temperature is taken out. `coefficient_mean` and `coefficient_sd` (q,) are of the coordinates
    per kelvin, `coefficient_prior_sd` is the sd before any test; `level_rate` (q,) is the sd by
    which a level wanders in a year, `scatter` (q,) the sd from test to test beyond the readings'
    own errors. Both are the likeliest given the whole history, for the filtered levels too; how
    little is known of them widens the covariances.
    """

    quantities: tuple[WatchedQuantity, ...]
    readings: tuple[Reading, ...]
    reference_temperature_c: float
    filtered_mean: FloatArray
    filtered_covariance: FloatArray
    smoothed_mean: FloatArray
    smoothed_covariance: FloatArray
    coefficient_mean: FloatArray
    coefficient_sd: FloatArray
    coefficient_prior_sd: FloatArray
    level_rate: FloatArray
    scatter: FloatArray

    @property
    def tests(self) -> tuple[str, ...]:
        return tuple(reading.test for reading in self.readings)

    @property
    def times(self) -> tuple[datetime, ...]:
        return tuple(reading.time for reading in self.readings)

    @property
    def temperatures_c(self) -> FloatArray:
        """(n,), NaN where a test has none."""
        return np.array([reading.temperature_c for reading in self.readings], np.float64)

    def filtered(self, name: str) -> Band:
        """What was known at each test of quantity `name`, from that test and those before."""
        return self._level(name, self.filtered_mean, self.filtered_covariance)

    def smoothed(self, name: str) -> Band:
        """What is known today of quantity `name` at each test."""
        return self._level(name, self.smoothed_mean, self.smoothed_covariance)

    def read(self, name: str) -> Band:
        """What each test by itself says of quantity `name` at the reference temperature.

        A test may not tell all quantities apart, so the others are taken as smoothed and their
        uncertainty is added. The interval holds the reading's own error, not the scatter.
        """
        j = self._place(name)
        pairs = np.array([self._alone(test, j) for test in range(len(self.readings))])
        return _band(self.quantities[j], pairs[:, 0], pairs[:, 1])

    def temperature_coefficients(self) -> tuple[TemperatureCoefficient, ...]:
        """Per kelvin, at the baseline: a fraction of the tension, decades of a stiffness."""
        return tuple(
            TemperatureCoefficient(
                quantity.name, float(slope * mean), float(slope * sd), float(slope * prior_sd)
            )
            for quantity, mean, sd, prior_sd in zip(
                self.quantities,
                self.coefficient_mean,
                self.coefficient_sd,
                self.coefficient_prior_sd,
                strict=True,
            )
            for slope in [_slope_at_baseline(quantity)]
        )

    def _place(self, name: str) -> int:
        names = [quantity.name for quantity in self.quantities]
        if name not in names:
            raise UsageError(f"{name} is not watched.", remedy=f"Watched: {', '.join(names)}.")
        return names.index(name)

    def _level(self, name: str, mean: FloatArray, covariance: FloatArray) -> Band:
        j = self._place(name)
        sd = np.sqrt(np.maximum(covariance[:, j, j], 0))
        return _band(self.quantities[j], mean[:, j], sd)

    def _alone(self, test: int, j: int) -> tuple[float, float]:
        """Mean and sd of coordinate `j` by this test, the others as smoothed."""
        reading = self.readings[test]
        own = float(reading.information[j, j])
        if not (own > 0 and np.all(np.isfinite(reading.mean))):
            return np.nan, np.nan
        warmth = reading.temperature_c - self.reference_temperature_c
        swing = self.coefficient_mean * (warmth if np.isfinite(warmth) else 0.0)
        pull = np.delete(reading.information[j], j) / own
        off = np.delete(self.smoothed_mean[test] + swing - reading.mean, j)
        others = np.delete(np.delete(self.smoothed_covariance[test], j, 0), j, 1)
        mean = reading.mean[j] - swing[j] - pull @ off
        return float(mean), float(np.sqrt(1 / own + pull @ others @ pull))


def _band(quantity: WatchedQuantity, mean: FloatArray, sd: FloatArray) -> Band:
    ends = [value_at(quantity, mean + sign * NINETY_PERCENT * sd) for sign in (-1, 1)]
    return Band(np.minimum(*ends), value_at(quantity, mean), np.maximum(*ends))


def _slope_at_baseline(quantity: WatchedQuantity) -> float:
    """Fraction of the tension, or decades, per unit of the coordinate.

    Over a step's sd to either side: at an end that is as good as clamped the slope at one point
    has no bounds.
    """
    if quantity.name == TENSION:
        return 1.0
    reach = quantity.step_sd
    low = max(-reach, float(quantity.coordinates[0]))
    high = min(reach, float(quantity.coordinates[-1]))
    return (value_at(quantity, high) - value_at(quantity, low)) / (high - low)


_SECONDS_A_YEAR = 365.25 * 86400  # Julian
_UNSEEN = 1e-6  # of a step: an sd of a thousand steps sees nothing
_ROUNDING = 1e-9  # technical
_FEW = 5  # fewer give an sd no better than to a third
_A_STEP, _CLEAR = 0.5, 3  # likelier a step than a ramp; tests: judgement, see `set_free`


@dataclass(frozen=True)
class StateOptions:
    """Weak priors of the state over time; one to three tests leave them as they are.

    `reference_temperature_c` is that of the baseline; NaN: the mean of the known ones. In units of
    a quantity's `step_sd`: the level wanders by `rate_of_step` in a year, readings scatter by
    `scatter_of_step` beyond their errors, the level lies within `jump_of_step` before the first
    test and after a called change. The first two are medians of log-normal priors with the sds
    `rate_log_sd`, `scatter_log_sd` of the natural logarithm. Temperature coefficients have mean 0
    and the sds given, of the tension a fraction per kelvin, of a spring a share of its `step_sd`
    per kelvin. A temperature that is not known lies `unknown_temperature_sd_k` off the reference
    where fewer than five are known, else by the sd of those. The variance of an outlier's noise
    grows by `largest_inflation` at most.
    """

    reference_temperature_c: float = NAN
    rate_of_step: float = 0.1
    rate_log_sd: float = 1.5
    scatter_of_step: float = 0.04
    scatter_log_sd: float = 1.0
    tension_per_kelvin_sd: float = DEFAULTS.tension_per_kelvin_sd.value
    spring_per_kelvin_sd_of_step: float = DEFAULTS.spring_per_kelvin_sd_of_step.value
    unknown_temperature_sd_k: float = DEFAULTS.unknown_temperature_sd_k.value
    jump_of_step: float = 3.0
    largest_inflation: float = 1e4

    @classmethod
    def of(cls, assumed: Assumptions, **given: Any) -> StateOptions:
        """Return options with what is assumed of a hanger, but for those that are given."""
        rows = {each.name: assumed[each.name].value for each in fields(cls) if each.name in assumed}
        return cls(**{**rows, **given})


def states(
    readings: Sequence[Reading],
    quantities: Sequence[WatchedQuantity],
    weights: FloatArray | None = None,
    changes: Sequence[datetime] = (),
    options: StateOptions | None = None,
) -> StateHistory:
    """Filtered and smoothed levels of all quantities at each of n readings, oldest first.

    `weights` (n,) are probabilities of being an outlier (None: no outliers; NaN: not known, taken
    as 0). At each of `changes` the level is set free just before the first reading at that time or
    after it (see `set_free`). Raises NothingThere without readings, UsageError where they are
    not in order or weights do not fit.
    """
    chosen = options or StateOptions()
    given = np.zeros(len(readings)) if weights is None else np.asarray(weights, np.float64)
    outlier = np.nan_to_num(given, nan=0.0)
    _check(readings, outlier)
    reference_c = _reference(readings, chosen)
    course = _course(readings, quantities, outlier, changes, reference_c, chosen)
    return _history(*_fitted(course), readings, quantities, reference_c, chosen)


def set_free(calls: Sequence[Change], readings: Sequence[Reading]) -> tuple[datetime, ...]:
    """The `changes` of `states` that called changes make.

    A step that began within three tests frees the level at each of them; of one whose beginning is
    less clear at the last alone, since a level that is free at every test knows nothing but that
    test. A ramp frees nothing: the level follows it as it wanders.
    """
    free: list[datetime] = []
    for call in calls:
        times = [each.time for each in readings if call.began_after < each.time <= call.began_by]
        if call.sudden > _A_STEP:
            free += times if len(times) <= _CLEAR else times[-1:]
    return tuple(sorted(set(free)))


def _fitted(course: Course) -> tuple[LocalLevels, FloatArray]:
    """The model with its parameters.

    Where temperatures are not known it is fitted twice: what the others say of the coefficients
    tells how much that matters.
    """
    from shm.watch.local_level import LocalLevels

    model = LocalLevels(course)
    z = model.fitted()
    if np.any(course.extra_variance):
        per_prior = course.extra_variance / course.coefficient_sd**2
        known = replace(course, extra_variance=per_prior * model.coefficient_square(z))
        model = LocalLevels(known)
        z = model.fitted()
    return model, z


def _check(readings: Sequence[Reading], outlier: FloatArray) -> None:
    if not readings:
        raise NothingThere("No test has a reading.", remedy="Ingest tests of this hanger first.")
    if outlier.shape != (len(readings),) or not np.all(np.abs(outlier - 0.5) <= 0.5 + _ROUNDING):
        raise UsageError(
            f"The outlier weights of {len(readings)} readings are not as many probabilities.",
            remedy="Give one in 0 to 1 for each reading.",
        )
    times = [reading.time for reading in readings]
    if times != sorted(times):
        raise UsageError("The readings are not in the order of time.", remedy="Sort them first.")


def _reference(readings: Sequence[Reading], options: StateOptions) -> float:
    if np.isfinite(options.reference_temperature_c):
        return options.reference_temperature_c
    return reference_of([reading.temperature_c for reading in readings])


def _known_temperatures_c(readings: Sequence[Reading]) -> FloatArray:
    all_c = np.array([reading.temperature_c for reading in readings], np.float64)
    return all_c[np.isfinite(all_c)]


def _course(
    readings: Sequence[Reading],
    quantities: Sequence[WatchedQuantity],
    outlier: FloatArray,
    changes: Sequence[datetime],
    reference_c: float,
    options: StateOptions,
) -> Course:
    from shm.watch.local_level import Course

    step_sd = np.array([quantity.step_sd for quantity in quantities], np.float64)
    parts = [_seen(reading, step_sd) for reading in readings]
    seen, directions, variance = (np.stack(part) for part in zip(*parts, strict=True))
    warmth_k = np.array([reading.temperature_c for reading in readings]) - reference_c
    coefficient_sd = _coefficient_sd(quantities, options)
    seconds = np.array([reading.time.timestamp() for reading in readings], np.float64)
    return Course(
        seen=seen,
        directions=directions,
        variance=variance,
        warmth_k=np.where(np.isfinite(warmth_k), warmth_k, 0.0),
        extra_variance=_unknown_warmth(readings, coefficient_sd, options),
        inflation=1 / np.clip(1 - outlier, 1 / options.largest_inflation, 1.0),
        years=np.diff(seconds) / _SECONDS_A_YEAR,
        jump_variance=_jumps(readings, changes, options.jump_of_step * step_sd),
        coefficient_sd=coefficient_sd,
        rate=options.rate_of_step * step_sd,
        scatter=options.scatter_of_step * step_sd,
        rate_log_sd=options.rate_log_sd,
        scatter_log_sd=options.scatter_log_sd,
    )


def _coefficient_sd(quantities: Sequence[WatchedQuantity], options: StateOptions) -> FloatArray:
    """Of each coordinate (q,), per kelvin."""
    return np.array(
        [
            options.tension_per_kelvin_sd
            if quantity.name == TENSION
            else options.spring_per_kelvin_sd_of_step * quantity.step_sd
            for quantity in quantities
        ]
    )


def _seen(reading: Reading, step_sd: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Values (q,), directions (q, q; a row each) and variances (q,) that do not depend on another.

    Along the eigenvectors of the information in units of `step_sd`, since coordinates differ in
    size by orders; the value is NaN where there is next to no information.
    """
    count = len(step_sd)
    if not (np.all(np.isfinite(reading.information)) and np.all(np.isfinite(reading.mean))):
        return np.full(count, np.nan), np.diag(1 / step_sd), np.ones(count)
    information = (reading.information + reading.information.T) / 2 * np.outer(step_sd, step_sd)
    strength, vectors = np.linalg.eigh(information)
    there = strength > max(_UNSEEN, _ROUNDING * strength[-1])
    directions = vectors.T / step_sd
    values = np.where(there, directions @ reading.mean, np.nan)
    return values, directions, 1 / np.where(there, strength, 1.0)


def _unknown_warmth(
    readings: Sequence[Reading], coefficient_sd: FloatArray, options: StateOptions
) -> FloatArray:
    """Variance (n, q) of each coordinate for not knowing a test's temperature."""
    known = _known_temperatures_c(readings)
    spread = known.std() if len(known) >= _FEW else options.unknown_temperature_sd_k
    unknown = np.array([not np.isfinite(reading.temperature_c) for reading in readings])
    return np.asarray(unknown[:, None] * (coefficient_sd * spread) ** 2, np.float64)


def _jumps(
    readings: Sequence[Reading], changes: Sequence[datetime], jump_sd: FloatArray
) -> FloatArray:
    """Variance (n, q) of the level just before each reading."""
    times = [reading.time for reading in readings]
    variance = np.zeros((len(times), len(jump_sd)))
    variance[[0, *(at for at in (bisect_left(times, c) for c in changes) if at < len(times))]] = (
        jump_sd**2
    )
    return variance


def _history(
    model: LocalLevels,
    z: FloatArray,
    readings: Sequence[Reading],
    quantities: Sequence[WatchedQuantity],
    reference_c: float,
    options: StateOptions,
) -> StateHistory:
    count = len(quantities)
    found = model.course_of_states(z)
    rate, scatter = model.rate_and_scatter(z)
    last = found.smoothed_covariance[-1].diagonal()[count:]
    return StateHistory(
        quantities=tuple(quantities),
        readings=tuple(readings),
        reference_temperature_c=reference_c,
        filtered_mean=found.filtered_mean[:, :count],
        filtered_covariance=found.filtered_covariance[:, :count, :count],
        smoothed_mean=found.smoothed_mean[:, :count],
        smoothed_covariance=found.smoothed_covariance[:, :count, :count],
        coefficient_mean=found.smoothed_mean[-1, count:],
        coefficient_sd=np.sqrt(np.maximum(last, 0)),
        coefficient_prior_sd=_coefficient_sd(quantities, options),
        level_rate=rate,
        scatter=scatter,
    )
