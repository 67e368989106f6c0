"""The tensions of a diagnosis in one unit: kN, or N where none of them reaches 1 kN."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shm.report import words
from shm.report.content import Interval
from shm.values import Diagnosis, TensionEstimate

AFTER = "weighed over all that may be"
"""What the tension after the diagnosis stands for: no gap, every cause and the unknown count by
their probabilities."""

_KILO = 1e3


@dataclass(frozen=True)
class TensionUnit:
    """The unit that all tensions of one diagnosis are told in, and how many N it is."""

    name: str
    newtons: float

    def of(self, tension_n: float) -> float:
        """A tension in this unit."""
        return tension_n / self.newtons

    def interval(self, estimate: TensionEstimate) -> Interval:
        """Mean and 90 % interval in this unit."""
        return Interval(estimate.mean, estimate.q05, estimate.q95).scaled(1 / self.newtons)

    def told(self, estimate: TensionEstimate) -> str:
        """`702 kN (90 % interval 690 to 714 kN)`."""
        interval = self.interval(estimate)
        if math.isnan(interval.width):
            return f"{interval.mean:.0f} {self.name}"
        return words.with_interval(interval, self.name)


def tension_unit(diagnosis: Diagnosis) -> TensionUnit:
    """One unit for both tensions, so that they can be compared at a glance."""
    both = (diagnosis.tension_before_n, diagnosis.tension_after_n)
    small = all(not abs(estimate.mean) >= _KILO for estimate in both)
    return TensionUnit("N", 1.0) if small else TensionUnit("kN", _KILO)
