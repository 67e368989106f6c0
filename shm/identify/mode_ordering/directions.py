"""Whether sensors at several places see each mode move in one direction, as a bar does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from shm.identify.contract import FoundMode
from shm.values import PLANES, FloatArray, QualityCheck, ResponsePoint, Verdict

LARGEST_DEGREES = 15.0
"""Judgement: three times what a sensor clamped on by eye is off; it then sees 7 % of the other
plane's energy."""
_EXCHANGED_DEGREES = 45.0  # beyond it the other plane's name fits better
_LEAST_SHARE = 0.25  # judgement, of the largest motion: nearer to a node the direction is noise
_LEAST_MODES = 3  # a median that one mode cannot make


def directions(modes: Sequence[FoundMode], points: Sequence[ResponsePoint]) -> QualityCheck | None:
    """Compares places pair by pair; None where fewer than two have axes in both planes."""
    biaxial = _biaxial(points)
    if len(biaxial) < 2:
        return None
    apart = [
        (degrees, one, other)
        for one, other in combinations(sorted(biaxial), 2)
        if not math.isnan(degrees := _apart(modes, biaxial[one], biaxial[other]))
    ]
    if not apart:
        return None
    worst, one, other = max(apart)
    about = f"the sensors at {one:g} m and {other:g} m see the modes move {worst:.0f} degrees apart"
    verdict: Verdict = "good"
    remedy = ""
    if worst > LARGEST_DEGREES:
        verdict, remedy = "warning", "Align both sensors with the planes of the bridge."
    if worst > _EXCHANGED_DEGREES:
        verdict = "refused"
        remedy = "The planes of one of them are exchanged: correct its axes or its description."
    return QualityCheck("directions", verdict, worst, LARGEST_DEGREES, "degrees", about, remedy)


def _biaxial(points: Sequence[ResponsePoint]) -> dict[float, tuple[int, int]]:
    """Of each place that is measured in both planes, where in a shape its two components are."""
    found = [
        {p.x_m: row for row, p in enumerate(points) if p.plane == plane and not math.isnan(p.x_m)}
        for plane in PLANES
    ]
    return {x_m: (found[0][x_m], found[1][x_m]) for x_m in found[0].keys() & found[1].keys()}


def _apart(modes: Sequence[FoundMode], one: tuple[int, int], other: tuple[int, int]) -> float:
    """Degrees, 0 to 90, between the directions at two places; the median of modes seen at both."""
    found = []
    for mode in modes:
        here, there = mode.shape[list(one)], mode.shape[list(other)]
        if min(np.hypot(*here), np.hypot(*there)) >= _LEAST_SHARE:
            found.append(_angle(here, there))
    return float(np.median(found)) if len(found) >= _LEAST_MODES else math.nan


def _angle(here: FloatArray, there: FloatArray) -> float:
    cosine = abs(float(here @ there)) / float(np.hypot(*here) * np.hypot(*there))
    return math.degrees(math.acos(min(cosine, 1.0)))
