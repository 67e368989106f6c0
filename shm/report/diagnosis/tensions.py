"""The tensions of a diagnosis, all in one unit."""

from __future__ import annotations

import math

from shm.report import words
from shm.report.intervals import Interval
from shm.values import Diagnosis, TensionEstimate
from shm.values.force_units import ForceUnit, force_unit

AFTER = "weighed over all that may be"
"""What the tension after the diagnosis stands for: no gap, every cause and the unknown count by
their probabilities."""


def tension_unit(diagnosis: Diagnosis) -> ForceUnit:
    """One unit for both tensions, so that they can be compared at a glance."""
    return force_unit(diagnosis.tension_before_n.mean, diagnosis.tension_after_n.mean)


def tension_of(estimate: TensionEstimate) -> Interval:
    """Mean and 90 % interval in N."""
    return Interval(estimate.mean, estimate.q05, estimate.q95)


def tension_words(estimate: TensionEstimate, unit: ForceUnit) -> str:
    """`702 kN (90 % interval 690 to 714 kN)`; the mean alone where nothing else is known."""
    tension_n = tension_of(estimate)
    if math.isnan(tension_n.width):
        return words.rounded_tension(estimate.mean, unit)
    return words.tension(tension_n, unit)
