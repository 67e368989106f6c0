"""Which plane a mode vibrates in, by its shape."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.identify.contract import FoundMode
from shm.values import PLANES, FloatArray, Plane, ResponsePoint, ShapePoint

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
    """The plane of each of `modes` (by rising frequency).

    The plane with more energy a channel, on axes that are turned from the sensors' by `turned_rad`;
    of two close modes in one plane, the one with more energy in the other plane goes there, if that
    plane has no mode near. All are transverse where no plane is stated.
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
    """Share of the energy a channel along the transverse axis, turned towards longitudinal."""
    transverse, longitudinal, product = _energies(shape, points)
    cosine, sine = math.cos(turned_rad), math.sin(turned_rad)
    turned = cosine**2 * transverse + 2 * cosine * sine * product + sine**2 * longitudinal
    return turned / (transverse + longitudinal)


def principal_angle(modes: Sequence[FoundMode], points: Sequence[ResponsePoint]) -> float:
    """How far the hanger's planes are turned from the sensors' axes, in radians up to pi/4.

    0 where sensors are not biaxial, and where the modes do not agree on two directions at right
    angles, some in either: then each mode's own energies must do.
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
    """Mean squares in either plane, and the mean product of the two.

    The product is 0 where the planes are not measured at the same places.
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
    """Moves one of the modes `first` and `first + 1` to the other plane where they must differ."""
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
    """Whether two frequencies are too near to be neighbours in one plane."""
    return bool(abs(one / other - 1) < CLOSE)


def shape_points(
    mode: FoundMode, plane: Plane, points: Sequence[ResponsePoint]
) -> tuple[ShapePoint, ...]:
    """The mode's shape by position: value in its plane, cross in the other, largest value 1.

    The standard deviation is the larger of both: where a shape may be turned, that of `cross`.
    Channels without a position are left out; those at one position and in one plane are averaged.
    """
    largest = mode.shape[_largest(mode, plane, points)]
    positions = sorted({point.x_m for point in points if np.isfinite(point.x_m)})
    return tuple(_shape_point(mode, x_m, plane, points, largest) for x_m in positions)


def sd_in_plane(mode: FoundMode, plane: Plane, points: Sequence[ResponsePoint]) -> float:
    """The largest standard deviation of the shape's values in a plane, the largest value 1.

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
