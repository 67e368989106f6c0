"""Determine the plane in which a mode vibrates, by its shape.

Also: unresolved pairs of both planes, and whether sensors at several positions see each mode move
in one direction, as a bar does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from shm.identify.contract import FoundMode
from shm.values import PLANES, FloatArray, Plane, QualityCheck, ResponsePoint, ShapePoint, Verdict

CLOSE = 0.02
"""Two modes nearer than this fraction cannot be neighbours in one plane of a hanger: orders of the
longest lie 1/30 apart (judgement)."""
LEAST_SHARE = 0.2
"""Of the energy that a mode must have in a plane to be moved there (judgement)."""
# Directions of n modes by chance agree so far with probability exp(-0.49 n): 14 % of 4, 0.7 % of 10
# (Rayleigh). judgement: a quarter in a plane is one mode of four
_LEAST_MODES = 4
_LEAST_AGREEMENT = 0.7
_LEAST_IN_A_PLANE = 0.25


def planes_of(
    modes: Sequence[FoundMode], points: Sequence[ResponsePoint], turned_rad: float = 0.0
) -> list[Plane]:
    """Return the plane of each of `modes` (by rising frequency).

    The plane with more energy a channel, on axes that are turned from the sensors' by
    `turned_rad`; of two close modes in one plane, the one with more energy in the other plane
    goes there, if that plane has no mode near. All are transverse where no plane is stated.
    """
    known = [plane for plane in PLANES if any(point.plane == plane for point in points)]
    if len(known) < 2:
        return [known[0] if known else "transverse"] * len(modes)
    shares = np.array([transverse_share(mode.shape, points, turned_rad) for mode in modes])
    planes: list[Plane] = ["transverse" if share >= 0.5 else "longitudinal" for share in shares]
    frequencies = np.array([mode.frequency_hz for mode in modes])
    for first in range(len(modes) - 1):
        _separate(first, planes, shares, frequencies)
    return planes


def transverse_share(
    shape: FloatArray, points: Sequence[ResponsePoint], turned_rad: float = 0.0
) -> float:
    """Return the energy share of a channel along the transverse axis, rotated to longitudinal."""
    transverse, longitudinal, product = _energies(shape, points)
    cosine, sine = math.cos(turned_rad), math.sin(turned_rad)
    turned = cosine**2 * transverse + 2 * cosine * sine * product + sine**2 * longitudinal
    return turned / (transverse + longitudinal)


def principal_angle(modes: Sequence[FoundMode], points: Sequence[ResponsePoint]) -> float:
    """Return the angle between the hanger's planes and the sensors' axes, in radians up to pi/4.

    0 where sensors are not biaxial, and where the modes do not agree on two directions at right
    angles, some in either: then each mode's energies must do.
    """
    if set(PLANES) - {point.plane for point in points} or len(modes) < _LEAST_MODES:
        return 0.0
    energies = np.array([_energies(mode.shape, points) for mode in modes])
    transverse, longitudinal, product = energies.T
    direction = np.arctan2(2 * product, transverse - longitudinal) / 2
    mean = np.mean(np.exp(4j * direction))
    angle = float(np.angle(mean)) / 4
    near_transverse = float(np.mean(np.cos(direction - angle) ** 2 > 0.5))
    agreed = abs(mean) >= _LEAST_AGREEMENT
    both = _LEAST_IN_A_PLANE <= near_transverse <= 1 - _LEAST_IN_A_PLANE
    return angle if agreed and both and np.any(product) else 0.0


def _energies(shape: FloatArray, points: Sequence[ResponsePoint]) -> tuple[float, float, float]:
    """Return mean squares in either plane, and the mean product of the two.

    The product is 0 where the planes are not measured at the same positions.
    """
    one, two = (
        [(p.x_m, v) for p, v in zip(points, shape, strict=True) if p.plane == plane]
        for plane in PLANES
    )
    biaxial = sorted(x for x, _ in one) == sorted(x for x, _ in two)
    other = dict(two)
    product = np.mean([value * other[x_m] for x_m, value in one]) if biaxial else 0.0
    transverse, longitudinal = (np.mean([v**2 for _, v in plane]) for plane in (one, two))
    return float(transverse), float(longitudinal), float(product)


def _separate(first: int, planes: list[Plane], shares: FloatArray, frequencies: FloatArray) -> None:
    """Move one of the modes `first` and `first + 1` to the other plane where they must differ."""
    pair = [first, first + 1]
    if planes[first] != planes[first + 1] or not is_close(
        frequencies[pair[0]], frequencies[pair[1]]
    ):
        return
    other: Plane = PLANES[1 - PLANES.index(planes[first])]
    share = shares if other == "transverse" else 1 - shares
    moved = pair[int(np.argmax(share[pair]))]
    crowded = any(
        planes[index] == other and is_close(frequencies[index], frequencies[moved])
        for index in range(len(planes))
    )
    if share[moved] >= LEAST_SHARE and not crowded:
        planes[moved] = other


def is_close(one: float, other: float) -> bool:
    """Return whether two frequencies are too close to be neighbours in one plane."""
    return bool(abs(one / other - 1) < CLOSE)


def shape_points(
    mode: FoundMode, plane: Plane, points: Sequence[ResponsePoint]
) -> tuple[ShapePoint, ...]:
    """Return the mode's shape by position: value in its plane, cross in the other, largest value 1.

    The standard deviation is the larger of both: where a shape may be turned, that of `cross`.
    Channels without a position are left out; those at one position and in one plane are
    averaged.
    """
    largest = mode.shape[_largest(mode, plane, points)]
    positions = sorted({point.x_m for point in points if np.isfinite(point.x_m)})
    return tuple(_shape_point(mode, x_m, plane, points, largest) for x_m in positions)


def sd_in_plane(mode: FoundMode, plane: Plane, points: Sequence[ResponsePoint]) -> float:
    """Return the largest standard deviation of the shape's values in a plane, the largest value 1.

    0 where it is not known. What may turn a shape hardly changes them.
    """
    inside = [(point.plane or plane) == plane for point in points]
    largest = abs(mode.shape[_largest(mode, plane, points)])
    return float(np.nan_to_num(mode.shape_sd[inside]).max() / largest)


def _largest(mode: FoundMode, plane: Plane, points: Sequence[ResponsePoint]) -> int:
    inside = [index for index, point in enumerate(points) if (point.plane or plane) == plane]
    return max(inside, key=lambda index: abs(mode.shape[index]))


def _shape_point(
    mode: FoundMode, x_m: float, plane: Plane, points: Sequence[ResponsePoint], scale: float
) -> ShapePoint:
    here = np.array([point.x_m == x_m for point in points])
    inside = here & np.array([(point.plane or plane) == plane for point in points])
    outside = here & ~inside
    return ShapePoint(
        x_m=x_m,
        value=_mean(mode.shape[inside]) / scale,
        cross=_mean(mode.shape[outside]) / scale,
        sd=float(np.fmax(_mean(mode.shape_sd[inside]), _mean(mode.shape_sd[outside]))) / abs(scale),
    )


def _mean(values: FloatArray) -> float:
    return float(np.mean(values)) if len(values) else np.nan


SHARE_OF_BOTH = 0.15
"""Of the energy that a mode must have in its weaker plane to stand for both."""
BLUR = 0.1
"""Of the bandwidth: what is not resolved over several hits lies nearer than 0.15 of it (measured:
71 pairs in heavy noise, damping 0.1 to 1 %; the errors' root mean square was 0.035)."""


def with_both_planes(
    modes: Sequence[FoundMode],
    planes: Sequence[Plane],
    points: Sequence[ResponsePoint],
    turned_rad: float = 0.0,
) -> tuple[list[FoundMode], list[Plane]]:
    """Return `modes` and `planes` with each possible unresolved pair in either plane.

    Two modes much closer than their half-power bandwidth may ring down as one, in the direction
    of the hammer. A mode with a close neighbour is no such pair. `turned_rad`: see
    `transverse_share`.
    """
    both: list[tuple[FoundMode, Plane]] = []
    single = bool(set(PLANES) - {point.plane for point in points})
    for mode, plane in zip(modes, planes, strict=True):
        twice = not single and _is_unresolved_pair(mode, modes, points, turned_rad)
        both += [(mode, each) for each in PLANES] if twice else [(mode, plane)]
    return [mode for mode, _ in both], [plane for _, plane in both]


def _is_unresolved_pair(
    mode: FoundMode, modes: Sequence[FoundMode], points: Sequence[ResponsePoint], turned_rad: float
) -> bool:
    share = transverse_share(mode.shape, points, turned_rad)
    alone = not any(
        is_close(mode.frequency_hz, other.frequency_hz) for other in modes if other is not mode
    )
    return alone and SHARE_OF_BOTH <= share <= 1 - SHARE_OF_BOTH


def moves_in_one_plane(mode: FoundMode, points: Sequence[ResponsePoint], turned_rad: float) -> bool:
    """Return whether it is seen to: on one axis the other plane's modes are heard, too."""
    if set(PLANES) - {point.plane for point in points}:
        return False
    share = transverse_share(mode.shape, points, turned_rad)
    return not SHARE_OF_BOTH <= share <= 1 - SHARE_OF_BOTH


def blur(mode: FoundMode) -> FoundMode:
    """Return an unresolved pair's mode with a tenth of the bandwidth added to its uncertainty.

    The bandwidth is twice damping ratio times frequency; either of the two has its frequency
    within it.
    """
    bandwidth = 2 * mode.damping_ratio * mode.frequency_hz
    sd = float(np.hypot(np.nan_to_num(mode.frequency_sd_hz), BLUR * bandwidth))
    return replace(mode, frequency_sd_hz=sd)


def pair_note(mode: FoundMode) -> str:
    """Return the note on an unresolved pair for the reader."""
    return (
        f"the mode at {mode.frequency_hz:.2f} Hz moves in both planes: it stands for one of each, "
        "uncertain by a tenth of its bandwidth"
    )


LARGEST_DEGREES = 15.0
"""Judgement: three times what a sensor clamped on by eye is off; it then sees 7 % of the other
plane's energy."""
_EXCHANGED_DEGREES = 45.0  # beyond it the other plane's name fits better
_SHARE_SEEN = 0.25  # judgement, of the largest motion: nearer to a node the direction is noise
_MODES_SEEN = 3  # a median that one mode cannot make


def directions(modes: Sequence[FoundMode], points: Sequence[ResponsePoint]) -> QualityCheck | None:
    """Compare places pair by pair; None where fewer than two have axes in both planes."""
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
    """Return by position in both planes the indices of its two components in a shape."""
    found = [
        {p.x_m: row for row, p in enumerate(points) if p.plane == plane and not math.isnan(p.x_m)}
        for plane in PLANES
    ]
    return {x_m: (found[0][x_m], found[1][x_m]) for x_m in found[0].keys() & found[1].keys()}


def _apart(modes: Sequence[FoundMode], one: tuple[int, int], other: tuple[int, int]) -> float:
    """Return the degrees, 0 to 90, between directions at two positions; the median over modes."""
    found = []
    for mode in modes:
        here, there = mode.shape[list(one)], mode.shape[list(other)]
        if min(np.hypot(*here), np.hypot(*there)) >= _SHARE_SEEN:
            found.append(_angle(here, there))
    return float(np.median(found)) if len(found) >= _MODES_SEEN else math.nan


def _angle(here: FloatArray, there: FloatArray) -> float:
    cosine = abs(float(here @ there)) / float(np.hypot(*here) * np.hypot(*there))
    return math.degrees(math.acos(min(cosine, 1.0)))
