"""What can be wrong with a test, each as a figure beside its limit and what to do about it.

A check is one file and one line of `CHECKS`.
"""

from __future__ import annotations

from shm.identify.quality.inspection import Check, Inspection
from shm.values import QualityCheck

__all__ = ["CHECKS", "Check", "Inspection", "assess"]

CHECKS: tuple[Check, ...] = ()


def assess(inspection: Inspection) -> tuple[QualityCheck, ...]:
    """The figures of all checks that apply, in the order of `CHECKS`."""
    found = [check(inspection) for check in CHECKS]
    return tuple(figure for figure in found if figure is not None)
