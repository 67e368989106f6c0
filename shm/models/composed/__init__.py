"""A hanger as a diagnosis sees it: a baseline, as made, with effects of the catalogue."""

from __future__ import annotations

from shm.models.composed.baseline import (
    AS_DESCRIBED,
    DEVIATIONS,
    Baseline,
    Deviation,
    deviations_of,
    scattered,
)
from shm.models.composed.hanger import ComposedHanger

__all__ = [
    "AS_DESCRIBED",
    "DEVIATIONS",
    "Baseline",
    "ComposedHanger",
    "Deviation",
    "deviations_of",
    "scattered",
]
