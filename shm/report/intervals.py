"""A mean with its central 90 % interval, and how intervals combine."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shm.values import (
    Averaged,
    FloatArray,
    Summary,
)
from shm.values.rounding import ForceUnit

NORMAL_90 = 1.6448536269514722
"""Half width of the central 90 % of a normal distribution, in standard deviations."""


_WIDE = 0.5  # judgement: an interval of half the value decides little


@dataclass(frozen=True)
class Interval:
    """A mean with its central 90 % interval.

    `repeatability_sd` is the standard deviation with which the same test would give it again, less
    than the interval says where part of that is the same in all tests; None: not known.
    """

    mean: float
    low: float
    high: float
    repeatability_sd: float | None = None

    @classmethod
    def of_samples(cls, samples: FloatArray) -> Interval:
        """From equally weighted draws, shape (samples,)."""
        low, high = np.quantile(samples, [0.05, 0.95])
        return cls(float(samples.mean()), float(low), float(high))

    @classmethod
    def normal(cls, mean: float, sd: float) -> Interval:
        """From a mean and a standard deviation, taken as normal."""
        return cls(mean, mean - NORMAL_90 * sd, mean + NORMAL_90 * sd)

    @classmethod
    def of_summary(cls, summary: Summary) -> Interval:
        """From what was kept of samples."""
        return cls(summary.mean, summary.q05, summary.q95)

    @classmethod
    def of_averaged(cls, averaged: Averaged) -> Interval:
        """Of a tension over all model classes, in N."""
        return cls.of_summary(averaged.tension_n).repeating(averaged.repeatability_sd_n)

    def repeating(self, sd: float) -> Interval:
        """The same with the standard deviation of a repetition; NaN is not known."""
        return replace(self, repeatability_sd=sd if math.isfinite(sd) else None)

    def scaled(self, factor: float) -> Interval:
        """The same quantity in a unit 1/`factor` as large."""
        own = self.repeatability_sd
        repeats = None if own is None else own * factor
        return Interval(self.mean * factor, self.low * factor, self.high * factor, repeats)

    def in_unit(self, unit: ForceUnit) -> Interval:
        """A force in N in another unit."""
        return self.scaled(1 / unit.newtons)

    @property
    def width(self) -> float:
        return self.high - self.low

    @property
    def is_wide(self) -> bool:
        """Whether it is wider than half its mean, so that a shift could hardly be seen in it."""
        return self.width > _WIDE * abs(self.mean)

    def since(self, then: Interval) -> Interval:
        """The relative change from `then`: repeatabilities in squares.

        Where one is not known, of two independent estimates: widths in squares.
        """
        ratio = self.mean / then.mean
        widths = [each.width / 2 for each in (self, then)]
        if self.repeatability_sd is not None and then.repeatability_sd is not None:
            widths = [NORMAL_90 * self.repeatability_sd, NORMAL_90 * then.repeatability_sd]
        half = math.hypot(widths[0], ratio * widths[1]) / abs(then.mean)
        return Interval(ratio - 1, ratio - 1 - half, ratio - 1 + half)

    def less(self, then: Interval) -> Interval:
        """The difference from `then`, of two independent estimates: widths in squares."""
        half = math.hypot(self.width, then.width) / 2
        shift = self.mean - then.mean
        return Interval(shift, shift - half, shift + half)
