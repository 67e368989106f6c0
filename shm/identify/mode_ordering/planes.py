"""Determine the plane in which a mode vibrates, by its shape; unresolved pairs of both planes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import FoundMode
from shm.values import PLANES, BoolArray, FloatArray, Plane, ResponsePoint, ShapePoint

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
    hz = [mode.frequency_hz for mode in modes]
    for first in range(len(modes) - 1):
        pair = [first, first + 1]
        if planes[first] != planes[first + 1] or not is_close(hz[first], hz[first + 1]):
            continue
        other: Plane = PLANES[1 - PLANES.index(planes[first])]
        in_other = shares if other == PLANES[0] else 1 - shares
        moved = pair[int(np.argmax(in_other[pair]))]
        crowded = any(
            p == other and is_close(f, hz[moved]) for p, f in zip(planes, hz, strict=True)
        )
        if in_other[moved] >= LEAST_SHARE and not crowded:
            planes[moved] = other
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
    inside, largest = _scale(mode, plane, points)
    x_m = np.array([point.x_m for point in points])

    def at(place_m: float) -> ShapePoint:
        along, cross = (x_m == place_m) & inside, (x_m == place_m) & ~inside
        sd = np.fmax(_mean(mode.shape_sd[along]), _mean(mode.shape_sd[cross]))
        return ShapePoint(
            x_m=place_m,
            value=_mean(mode.shape[along]) / largest,
            cross=_mean(mode.shape[cross]) / largest,
            sd=float(sd) / abs(largest),
        )

    return tuple(at(place_m) for place_m in sorted(set(x_m[np.isfinite(x_m)].tolist())))


def sd_in_plane(mode: FoundMode, plane: Plane, points: Sequence[ResponsePoint]) -> float:
    """Return the largest standard deviation of the shape's values in a plane, the largest value 1.

    0 where it is not known. What may turn a shape hardly changes them.
    """
    inside, largest = _scale(mode, plane, points)
    return float(np.nan_to_num(mode.shape_sd[inside]).max() / abs(largest))


def _scale(
    mode: FoundMode, plane: Plane, points: Sequence[ResponsePoint]
) -> tuple[BoolArray, float]:
    """Return the mask (points,) of the channels of a plane, and the mode's largest value there."""
    inside = np.array([(point.plane or plane) == plane for point in points])
    values = mode.shape[inside]
    return inside, float(values[np.argmax(np.abs(values))])


def _mean(values: FloatArray) -> float:
    return float(np.mean(values)) if len(values) else np.nan


SHARE_OF_BOTH = 0.15
"""Of the energy that a mode must have in its weaker plane to stand for both."""
BLUR = 0.1
"""Of the bandwidth: what is not resolved over several hits lies nearer than 0.15 of it (measured:
71 pairs in heavy noise, damping 0.1 to 1 %; the errors' root mean square was 0.035)."""


def moves_in_one_plane(
    mode: FoundMode, points: Sequence[ResponsePoint], turned_rad: float = 0.0
) -> bool | None:
    """Return whether a mode moves in one plane alone; None where only one is measured."""
    if set(PLANES) - {point.plane for point in points}:
        return None
    share = transverse_share(mode.shape, points, turned_rad)
    return not SHARE_OF_BOTH <= share <= 1 - SHARE_OF_BOTH


def is_unresolved_pair(
    mode: FoundMode,
    modes: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
    turned_rad: float = 0.0,
) -> bool:
    """Return whether a mode stands for one of each plane.

    Two modes much closer than their half-power bandwidth may ring down as one, in the direction
    of the hammer. A mode with a close neighbour is no such pair. `turned_rad`: see
    `transverse_share`.
    """
    return moves_in_one_plane(mode, points, turned_rad) is False and not any(
        is_close(mode.frequency_hz, other.frequency_hz) for other in modes if other is not mode
    )


def blur(mode: FoundMode) -> FoundMode:
    """Return an unresolved pair's mode with a tenth of the bandwidth added to its uncertainty.

    The bandwidth is twice damping ratio times frequency; either of the two has its frequency
    within it.
    """
    bandwidth = 2 * mode.damping_ratio * mode.frequency_hz
    sd = float(np.hypot(np.nan_to_num(mode.frequency_sd_hz), BLUR * bandwidth))
    return replace(mode, frequency_sd_hz=sd)
