"""The state of a hanger over time as people see it: bands of tension and stiffness at each test."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

import numpy as np

from shm.errors import UsageError
from shm.values import FloatArray
from shm.values.drift import TENSION, Reading, TemperatureCoefficient, WatchedQuantity
from shm.values.rounding import NINETY_PERCENT
from shm.watch.quantities import value_at


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
