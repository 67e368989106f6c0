"""Assign two modes at one order to planes, where sensors of one axis measure both planes.

A sensor that is rotated by a few degrees, or has a few percent of cross-axis sensitivity, shows the
modes of the other plane next to those of its plane. The strength decides, as sensors measure their
plane better, and with several sensors the shape: each is rotated by another angle, so the other
plane's modes do not have the shape of a bar.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shm.identify.mode_ordering.bars import described_shapes
from shm.identify.mode_ordering.numbering import PlaneModes
from shm.values import FloatArray, Hanger

_REACH = 0.08
"""Of a frequency: planes of short bars differ most, by 6 % in tests/worlds/recordings.py."""
# judgement: a sensor turned by up to 5 degrees hears its own plane ten times as well, within a
# factor of three for the directions of the hits
_USUAL_RATIO, _RATIO_SPREAD = float(np.log(10.0)), 1.2
COST_OF_RATIO = 4 * _USUAL_RATIO / _RATIO_SPREAD**2
"""By how much it costs less to be the axis' own, for each unit of the log of the strength."""
_SHAPE_TOLERANCE = 0.07  # judgement, radians: gains to 2 %, places to centimetres
_MOST_SHAPE_COST = 16.0  # four tolerances, squared: no single shape decides
_GOOD_SHAPE, _ODD_SHAPE = 4.0, 9.0  # two and three tolerances, squared
_DECIDED = 6.0
"""Of costs: odds of 20 to 1, from which one of two modes is taken for the axis' own."""


@dataclass(frozen=True)
class AxisOrders:
    """Hold orders from 1 (modes,) in the axis' plane and in the other, 0 for neither.

    `undecided` counts the orders with two modes that cannot be assigned: they are in neither.
    """

    in_axis: tuple[int, ...]
    cross_axis: tuple[int, ...]
    undecided: int


def tell_planes(orders: Sequence[int], modes: PlaneModes, hanger: Hanger) -> AxisOrders:
    """Compare each mode with an order with the nearest one that has none.

    Of those without such a neighbour the ones that have no bar's shape are the other plane's, where
    most of the series have one.
    """
    in_axis, cross_axis = list(orders), [0] * len(orders)
    partner = _pair_up(modes.frequency_hz, orders)
    numbered = {i: order for i, order in enumerate(orders) if order}
    misfit = _shape_misfits(modes, numbered | {j: orders[i] for i, j in partner.items()}, hanger)
    if 2 * sum(misfit[i] < _GOOD_SHAPE for i in numbered) >= len(numbered):
        for i in numbered.keys() - partner.keys():
            if misfit[i] >= _ODD_SHAPE:
                in_axis[i], cross_axis[i] = 0, numbered[i]
    first, second = list(partner), list(partner.values())
    cost = modes.strength[first] - modes.strength[second] + misfit[second] - misfit[first]
    above = np.sign(modes.frequency_hz[first] - modes.frequency_hz[second])
    together = float(np.sum(above * cost))  # one plane is the stiffer at all orders
    if abs(together) >= _DECIDED:
        cost = np.where(np.abs(cost) < _DECIDED, above * together, cost)
    for i, j, each in zip(first, second, cost.tolist(), strict=True):
        if abs(each) < _DECIDED:
            in_axis[i] = 0
        elif each > 0:
            cross_axis[j] = orders[i]
        else:
            in_axis[i], in_axis[j], cross_axis[i] = 0, orders[i], orders[i]
    undecided = int(np.sum(np.abs(cost) < _DECIDED))
    return AxisOrders(tuple(in_axis), tuple(cross_axis), undecided)


def _pair_up(frequency_hz: FloatArray, orders: Sequence[int]) -> dict[int, int]:
    """Return for each mode with an order the nearest to it that has none, where one is near."""
    log_hz = np.log(frequency_hz)
    near = sorted(
        (abs(log_hz[i] - log_hz[j]), i, j)
        for i, order in enumerate(orders)
        for j, other in enumerate(orders)
        if order and not other
    )
    partner: dict[int, int] = {}
    for apart, i, j in near:
        if apart < _REACH and i not in partner and j not in partner.values():
            partner[i] = j
    return partner


def _shape_misfits(modes: PlaneModes, at: Mapping[int, int], hanger: Hanger) -> FloatArray:
    """Return how badly modes `at` an order have a bar's shape there, (modes,)."""
    misfit = np.zeros(len(modes.frequency_hz))
    if len(modes.position) < 2 or not at:
        return misfit
    rows, orders = list(at), np.array(list(at.values()))
    expected = described_shapes(modes.position * hanger.length_m, orders, hanger)
    shapes, sd = modes.shapes[rows], np.nan_to_num(modes.shape_sd[rows])
    norm = np.sum(shapes**2, axis=1)
    likeness = np.sum(expected * shapes, axis=-1) ** 2 / (np.sum(expected**2, axis=-1) * norm)
    variance = _SHAPE_TOLERANCE**2 + sd**2 / norm
    misfit[rows] = np.minimum((1 - likeness.max(axis=0)) / variance, _MOST_SHAPE_COST)
    return misfit
