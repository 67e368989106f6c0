"""Check `cross-check`: do two identifiers agree?"""

from __future__ import annotations

import numpy as np

from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import listed
from shm.values import NAN, FloatArray, QualityCheck, Verdict

_LIMIT = 0.003
"""Largest error of a frequency that the project allows."""
_SAME_MODE = 0.01
_LEAST_COMMON = 0.5
"""In a third of sound simulated tests the fit to frequency responses lacks a weak or close mode."""


def check(inspection: Inspection) -> QualityCheck | None:
    """Largest difference of a common mode's frequency, as a fraction; modes that only one saw.

    Modes nearer than 1 % that are each other's nearest are common. That the second misses some is
    told, and a warning only where it misses most.
    """
    finding, second = inspection.finding, inspection.cross_check
    if finding is None or second is None:
        return None
    one = np.array([mode.frequency_hz for mode in finding.modes])
    other = np.array([mode.frequency_hz for mode in second.modes])
    pairs = _pairs(one, other)
    remedy = "Look at the stabilisation diagram and the fit of these modes before using them."
    if not pairs:
        found = "the second identifier found none of the modes"
        return QualityCheck("cross-check", "warning", NAN, _LIMIT, "", found, remedy)
    differences = [abs(other[j] / one[i] - 1) for i, j in pairs]
    value = float(max(differences))
    worst = one[pairs[int(np.argmax(differences))][0]]
    found = (
        f"{len(pairs)} modes in common, furthest apart by {value:.3%} at {worst:.2f} Hz"
        f"{_alone('this', one, [i for i, _ in pairs])}"
        f"{_alone('the second', other, [j for _, j in pairs])}"
    )
    good = value <= _LIMIT and len(pairs) >= _LEAST_COMMON * len(one)
    verdict: Verdict = "good" if good else "warning"
    return QualityCheck("cross-check", verdict, value, _LIMIT, "", found, "" if good else remedy)


def _pairs(one: FloatArray, other: FloatArray) -> list[tuple[int, int]]:
    if not len(one) or not len(other):
        return []
    apart = np.abs(other[None, :] / one[:, None] - 1)
    nearest, back = apart.argmin(axis=1), apart.argmin(axis=0)
    return [(i, int(j)) for i, j in enumerate(nearest) if back[j] == i and apart[i, j] < _SAME_MODE]


def _alone(who: str, frequency_hz: FloatArray, common: list[int]) -> str:
    alone = np.delete(frequency_hz, common)
    told = listed([f"{value:.2f} Hz" for value in alone])
    return f"; {who} identifier alone saw {told}" if len(alone) else ""
