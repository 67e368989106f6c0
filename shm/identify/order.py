"""Numbers the modes of each plane so that a missing mode does not shift the others.

Modes are counted, unless leaving orders out fits the pattern of a tensioned beam clearly better.
Every way to leave out a few orders is compared with the pattern over a grid of tensions and end
springs, for both planes at once: they share the tension and nearly the length, not the springs.
Where length and several sensor positions are known, the shapes have a say; where the hanger is
described, so have its bending stiffness and nominal tension, which no shifted numbering meets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations
from math import comb
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shm.identify.pattern import HIGHEST_ORDER, tensioned_beam_pattern
from shm.values import FloatArray, Hanger

IntArray: TypeAlias = NDArray[np.int64]

PATTERN_TOLERANCE = 0.02
"""How far real hangers stray from the pattern: end plates, brackets (fraction of a frequency)."""
SHAPE_TOLERANCE = 0.1
"""How far one minus the modal assurance criterion of a right order strays from zero."""
PLANE_TOLERANCE = 0.03
"""How far the two planes differ beyond what end springs explain (fraction of a frequency)."""
STRING_TOLERANCE = 0.3
"""How far sqrt(T/m)/(2 L) strays from the description (log): tension 0.55 to 1.8 of nominal."""
UNIT_TOLERANCE = 0.3
"""How far sqrt(EI/m)/(2 pi L^2) strays from the description (log): length, strands' stiffness."""
MISSING_COST = 5.0
CLEARLY = 4.0
"""A mode left out must earn its cost, and all of them together this much on top."""
MISSING_COST_DESCRIBED = 2.0
"""The same where the hanger is described: then a numbering is known by its frequencies too."""
_WORST = 25.0
_FIT = 4.0
_MOST_ASSIGNMENTS = 2000
_SHORTLIST = 40
_MISSING_AT_MOST = 3
_MISSING_AT_MOST_DESCRIBED = 8


@dataclass(frozen=True)
class Expected:
    """What a hanger's description says of its frequencies, `unit` times alpha beta of the pattern.

    `log_unit` is the log of sqrt(EI/m)/(2 pi L^2) in Hz, `log_xi` that of L sqrt(T/EI).
    """

    log_unit: float
    log_xi: float

    @classmethod
    def of(cls, hanger: Hanger) -> Expected:
        """From length, section, material and nominal tension."""
        stiffness, mass = hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m
        unit = np.sqrt(stiffness / mass) / (2 * np.pi * hanger.length_m**2)
        xi = hanger.length_m * np.sqrt(hanger.nominal_tension_n / stiffness)
        return cls(float(np.log(unit)), float(np.log(xi)))

    def cost(self, scale: FloatArray, log_xi: FloatArray) -> FloatArray:
        """Misfit of frequency units `scale` (..., tensions, springs) of patterns (tensions,)."""
        string = scale + log_xi[:, np.newaxis] - (self.log_unit + self.log_xi)
        return (string / STRING_TOLERANCE) ** 2 + ((scale - self.log_unit) / UNIT_TOLERANCE) ** 2


@dataclass(frozen=True, eq=False)
class PlaneModes:
    """Modes of one plane by rising frequency.

    `frequency_hz` (modes,); `position` (points,) as x/L, empty where unknown; `shapes`
    (modes, points).
    """

    frequency_hz: FloatArray
    position: FloatArray
    shapes: FloatArray


@dataclass(frozen=True, eq=False)
class _Fits:
    """How well assignments of orders fit.

    `orders` (assignments, modes) counts from 0; `penalty` (assignments,) is for orders left out;
    `cost` and `scale` (assignments, tensions, springs): squared misfits, and the log of the
    frequency unit.
    """

    orders: IntArray
    penalty: FloatArray
    cost: FloatArray
    scale: FloatArray

    def best(self, count: int) -> _Fits:
        """The `count` cheapest assignments and, first of all, plain counting."""
        total = self.cost.min(axis=(1, 2)) + self.penalty
        rest = [index for index in np.argsort(total, kind="stable") if index != 0]
        keep = [0, *rest[: count - 1]]
        return _Fits(self.orders[keep], self.penalty[keep], self.cost[keep], self.scale[keep])


def assign_orders(
    planes: Sequence[PlaneModes], expected: Expected | None = None
) -> list[list[int]]:
    """Orders from 1 for the modes of each of one or two planes; empty for a plane without modes."""
    filled = [plane for plane in planes if 0 < len(plane.frequency_hz) <= HIGHEST_ORDER]
    most = max((len(plane.frequency_hz) for plane in filled), default=0)
    fits = [_fits(plane, most, expected).best(_SHORTLIST) for plane in filled]
    chosen = dict(zip(map(id, filled), _chosen(fits), strict=True))
    return [
        (chosen.get(id(plane), np.arange(len(plane.frequency_hz))) + 1).tolist() for plane in planes
    ]


def _chosen(fits: Sequence[_Fits]) -> list[IntArray]:
    """The cheapest orders of each plane; plain counting unless they are clearly cheaper."""
    if not fits:
        return []
    misfit = _misfit(fits)
    modes = sum(fit.orders.shape[1] for fit in fits)
    total = misfit + reduce(np.add.outer, [fit.penalty for fit in fits])
    best = np.unravel_index(int(np.argmin(total)), total.shape)
    counting = [0] * len(fits)
    clear = total[best] + CLEARLY < total[tuple(counting)] and misfit[best] < _FIT * modes
    picks = [int(index) for index in best] if clear else counting
    return [fit.orders[pick] for fit, pick in zip(fits, picks, strict=True)]


def _misfit(fits: Sequence[_Fits]) -> FloatArray:
    """Least misfit over tensions and springs: (assignments,) of one plane, or of both (a, b)."""
    if len(fits) == 1:
        return np.asarray(fits[0].cost.min(axis=(1, 2)))
    one, two = fits
    least = np.full((len(one.orders), len(two.orders)), np.inf)
    for tension in range(one.cost.shape[1]):
        apart = _each_pair(np.subtract, one.scale[:, tension], two.scale[:, tension])
        cost = _each_pair(np.add, one.cost[:, tension], two.cost[:, tension])
        cost = cost + np.minimum((apart / PLANE_TOLERANCE) ** 2, _WORST)
        least = np.minimum(least, cost.min(axis=(2, 3)))
    return least


def _each_pair(combine: np.ufunc, one: FloatArray, two: FloatArray) -> FloatArray:
    """Two tables (assignments, springs) combined: (a, b, springs of one, springs of two)."""
    return np.asarray(combine(one[:, None, :, None], two[None, :, None, :]))


def _fits(plane: PlaneModes, most_modes: int, hanger: Expected | None) -> _Fits:
    """All assignments with few orders left out against all patterns."""
    pattern = tensioned_beam_pattern()
    most_missing = _MISSING_AT_MOST if hanger is None else _MISSING_AT_MOST_DESCRIBED
    orders = _assignments(len(plane.frequency_hz), most_missing + most_modes)
    expected = np.moveaxis(pattern.log_frequency[:, :, orders], 2, 0)
    difference = np.log(plane.frequency_hz) - expected
    scale = np.median(difference, axis=-1)
    residual = (difference - scale[..., np.newaxis]) / PATTERN_TOLERANCE
    cost = np.minimum(residual**2, _WORST).sum(axis=-1) + _shape_cost(plane, orders)
    if hanger is not None:
        cost = cost + hanger.cost(scale, pattern.log_xi)
    price = MISSING_COST if hanger is None else MISSING_COST_DESCRIBED
    penalty = price * (orders[:, -1] + 1 - orders.shape[1])
    return _Fits(orders, penalty, cost, scale)


def _assignments(modes: int, highest_order: int) -> IntArray:
    """Rising orders from 0, (assignments, modes), plain counting first.

    Orders up to `highest_order` are used, fewer where there were too many ways.
    """
    missing = highest_order - modes
    while missing > 0 and comb(modes + missing, missing) > _MOST_ASSIGNMENTS:
        missing -= 1
    highest = min(modes + missing, HIGHEST_ORDER)
    return np.array(list(combinations(range(highest), modes)))


def _shape_cost(plane: PlaneModes, orders: IntArray) -> FloatArray:
    """Misfit of the shapes, (assignments, tensions, springs); 0 where they say nothing."""
    if len(plane.position) < 2:
        return np.zeros((len(orders), 1, 1))
    expected = tensioned_beam_pattern().shapes(plane.position)
    product = np.einsum("tsop,mp->tsom", expected, plane.shapes) ** 2
    norms = np.einsum("tsop,tsop->tso", expected, expected)[..., np.newaxis]
    likeness = product / (norms * np.sum(plane.shapes**2, axis=1) + np.finfo(float).tiny)
    cost = np.minimum(((1 - likeness) / SHAPE_TOLERANCE) ** 2, _WORST)
    return np.asarray(
        sum(np.moveaxis(cost[:, :, orders[:, mode], mode], 2, 0) for mode in range(orders.shape[1]))
    )
