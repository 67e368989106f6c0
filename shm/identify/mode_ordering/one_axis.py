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

from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.bars import described_bars
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


def tell_planes(
    found: Sequence[FoundMode], orders: Sequence[int], modes: PlaneModes, hanger: Hanger
) -> AxisOrders:
    """Compare each mode with an order with the nearest one that has none.

    Of those without such a neighbour the ones that have no bar's shape are the other plane's, where
    most of the series have one.
    """
    in_axis, cross_axis = list(orders), [0] * len(orders)
    pairs = _pairs(found, orders)
    at = {i: order for i, order in enumerate(orders) if order}
    misfit = _shape_misfits(modes, at | {j: orders[i] for i, j in pairs}, hanger)
    if 2 * sum(misfit[i] < _GOOD_SHAPE for i in at) >= len(at):
        for i in at.keys() - {i for i, _ in pairs}:
            if misfit[i] >= _ODD_SHAPE:
                in_axis[i], cross_axis[i] = 0, at[i]
    cost = np.array([
        COST_OF_RATIO * _log_ratio(found[i], found[j]) + misfit[j] - misfit[i] for i, j in pairs
    ])  # fmt: skip
    above = np.array([np.sign(found[i].frequency_hz - found[j].frequency_hz) for i, j in pairs])
    together = float(np.sum(above * cost))  # one plane is the stiffer at all orders
    if abs(together) >= _DECIDED:
        cost = np.where(np.abs(cost) < _DECIDED, above * together, cost)
    undecided = 0
    for (i, j), each in zip(pairs, cost.tolist(), strict=True):
        order = orders[i]
        if abs(each) < _DECIDED:
            in_axis[i], undecided = 0, undecided + 1
        elif each > 0:
            cross_axis[j] = order
        else:
            in_axis[i], in_axis[j], cross_axis[i] = 0, order, order
    return AxisOrders(tuple(in_axis), tuple(cross_axis), undecided)


def _pairs(found: Sequence[FoundMode], orders: Sequence[int]) -> Sequence[tuple[int, int]]:
    """Return each mode with an order and the nearest to it that has none, where one is near."""
    log_hz = np.log([mode.frequency_hz for mode in found])
    near = sorted(
        (abs(log_hz[i] - log_hz[j]), i, j)
        for i, order in enumerate(orders)
        for j, other in enumerate(orders)
        if order and not other
    )
    partners: dict[int, int] = {}
    for apart, i, j in near:
        if apart < _REACH and i not in partners and j not in partners.values():
            partners[i] = j
    return list(partners.items())


def _shape_misfits(modes: PlaneModes, at: Mapping[int, int], hanger: Hanger) -> FloatArray:
    """Return how badly modes `at` an order have a bar's shape there, (modes,)."""
    misfit = np.zeros(len(modes.frequency_hz))
    if len(modes.position) < 2 or not at:
        return misfit
    every = described_bars(hanger).shapes(modes.position)
    for mode, order in at.items():
        expected = every[:, :, order - 1]
        shape, sd = modes.shapes[mode], float(np.nan_to_num(modes.shape_sd[mode]))
        norm = np.sum(shape**2)
        likeness = (expected @ shape) ** 2 / (np.sum(expected**2, axis=-1) * norm)
        variance = _SHAPE_TOLERANCE**2 + sd**2 / norm
        misfit[mode] = min((1 - float(likeness.max())) / variance, _MOST_SHAPE_COST)
    return misfit


def _log_ratio(one: FoundMode, other: FoundMode) -> float:
    """Return that of the strengths; 0 where they are not known, as in wind."""
    ratio = one.acceleration_m_s2 / other.acceleration_m_s2
    return float(np.log(ratio)) if np.isfinite(ratio) and ratio > 0 else 0.0
