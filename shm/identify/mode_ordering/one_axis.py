"""Which modes are those of the axis, where sensors of a single axis also show the other plane.

A sensor that is turned by a few degrees, or hears a few percent across, shows the modes of the
other plane as a second series beside those of its own: the same bar with other end stiffness. Both
are numbered together. Which of the two is the axis' own says the strength, as sensors hear their
own plane better, and with several sensors the shape: each is turned by its own angle, so the other
plane's modes do not have the shape of a bar.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.alignment import PlaneModes, tensioned_beam_pattern
from shm.identify.mode_ordering.order import Expected, Numbering, assign_orders
from shm.values import FloatArray

# Fractions within which a weaker mode may be the other plane's of the same order; the cheapest
# numbering decides. Planes of short bars differ most: 6 % in tests/worlds/recordings.py
_REACHES = (0.0, 0.005, 0.01, 0.02, 0.035, 0.05, 0.08, 0.13)
_MISSING_ASKEW = 0.5
"""Cost of an order that the other plane does not show: most it does not."""
# judgement: a sensor turned by up to 5 degrees hears its own plane ten times as well, within a
# factor of three for the directions of the hits
_USUAL_RATIO, _RATIO_SPREAD = float(np.log(10.0)), 1.2
_SHAPE_TOLERANCE = 0.07  # judgement, radians: gains to 2 %, places to centimetres
_MOST_SHAPE_COST = 16.0  # four tolerances, squared: no single shape decides
_GOOD_SHAPE, _ODD_SHAPE = 4.0, 9.0  # two and three tolerances, squared
_DECIDED = 3.0
"""Log of the odds, 20 to 1, from which one of two series is taken for the axis' own."""
_LEAST_POINTS = 2  # of one point every shape is right

ModesOf: TypeAlias = Callable[[Sequence[int]], PlaneModes]


@dataclass(frozen=True, eq=False)
class OneAxis:
    """Orders from 1 (modes,): `own` of the axis' plane, `askew` of the other; None for neither.

    `numbering` is that of both series, `margins` (modes,) those of the numbering; `undecided`
    counts the orders that both planes show where nothing tells which mode is whose: these are in
    neither.
    """

    own: tuple[int | None, ...]
    askew: tuple[int | None, ...]
    margins: tuple[float, ...]
    numbering: Numbering
    undecided: int = 0


def own_series(found: Sequence[FoundMode], modes_of: ModesOf, expected: Expected | None) -> OneAxis:
    """The orders of `found`, sensors of one axis; `modes_of` gives those at some places of it."""
    everything = modes_of(range(len(found)))
    split = _cheapest(found, modes_of, expected)
    if odd := _odd(split, _shape_misfit(everything, {**split.own, **split.askew})):
        split = _cheapest(found, modes_of, expected, odd)
    own, askew = split.own, split.askew
    misfit = _shape_misfit(everything, {**own, **askew})
    pairs = [(i, j) for i, n in own.items() for j, m in askew.items() if n == m]
    swap, undecided = _swapped(found, pairs, misfit)
    for i, j in swap:
        own[j], askew[i] = askew.pop(j), own.pop(i)
    for i, j in undecided:
        del own[i], askew[j]
    return OneAxis(
        tuple(own.get(i) for i in range(len(found))),
        tuple(askew.get(i) for i in range(len(found))),
        tuple(split.margins.get(i, 0.0) for i in range(len(found))),
        split.numbering,
        len(undecided),
    )


@dataclass(frozen=True, eq=False)
class _Split:
    """The places of a stronger and a weaker series, and their common numbering."""

    strong: list[int]
    weak: list[int]
    numbering: Numbering

    @property
    def own(self) -> dict[int, int]:
        return _numbers(self.strong, self.numbering.orders[0])

    @property
    def askew(self) -> dict[int, int]:
        return _numbers(self.weak, self.numbering.orders[1])

    @property
    def margins(self) -> dict[int, float]:
        strong, weak = self.numbering.margins
        return dict(zip([*self.strong, *self.weak], [*strong, *weak], strict=True))


def _numbers(places: Sequence[int], orders: Sequence[int | None]) -> dict[int, int]:
    return {i: n for i, n in zip(places, orders, strict=True) if n is not None}


def _cheapest(
    found: Sequence[FoundMode],
    modes_of: ModesOf,
    expected: Expected | None,
    askew: Sequence[int] = (),
) -> _Split:
    """The stronger and the weaker series whose common numbering costs least; `askew` are weak."""
    tried: dict[tuple[int, ...], _Split] = {}
    for reach in _REACHES:
        weak = _beside_stronger(found, reach, askew)
        if tuple(weak) not in tried:
            strong = [i for i in range(len(found)) if i not in weak]
            nowhere = np.empty(0)  # seen askew, they have no shape of a bar
            other = replace(
                modes_of(weak),
                position=nowhere,
                shapes=np.empty((len(weak), 0)),
                missing_cost=_MISSING_ASKEW,
            )
            numbering = assign_orders([modes_of(strong), other], expected)
            tried[tuple(weak)] = _Split(strong, weak, numbering)
    described = [each for each in tried.values() if each.numbering.basis == "description"]
    return min(described or tried.values(), key=lambda each: each.numbering.cost)


def _beside_stronger(found: Sequence[FoundMode], reach: float, askew: Sequence[int]) -> list[int]:
    """Places of the modes that have a stronger one within a fraction, and of those `askew`."""
    strength = np.nan_to_num([mode.acceleration_m_s2 for mode in found])
    kept: list[int] = []
    weak: list[int] = list(askew)
    for i in np.argsort(-strength, kind="stable").tolist():
        if i in askew:
            continue
        near = any(abs(np.log(found[i].frequency_hz / found[j].frequency_hz)) < reach for j in kept)
        (weak if near else kept).append(i)
    return sorted(weak)


def _shape_misfit(modes: PlaneModes, orders: Mapping[int, int]) -> FloatArray:
    """How badly each mode has the shape of a bar at its order, in tolerances squared, (modes,).

    0 where sensors are too few to say.
    """
    misfit = np.zeros(len(modes.frequency_hz))
    if len(modes.position) < _LEAST_POINTS:
        return misfit
    pattern = tensioned_beam_pattern()
    every = pattern.shapes(modes.position, np.arange(len(pattern.log_xi)))
    for i, order in orders.items():
        expected, shape = every[:, :, order - 1], modes.shapes[i]
        likeness = (expected @ shape) ** 2 / (np.sum(expected**2, axis=-1) * np.sum(shape**2))
        variance = _SHAPE_TOLERANCE**2 + np.nan_to_num(modes.shape_sd[i]) ** 2 / np.sum(shape**2)
        misfit[i] = min((1 - float(np.nanmax(likeness))) / variance, _MOST_SHAPE_COST)
    return misfit


def _swapped(
    found: Sequence[FoundMode], pairs: Sequence[tuple[int, int]], misfit: FloatArray
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Of `pairs` (stronger, weaker) those of which the weaker is the axis' own, and the undecided.

    One plane is the stiffer at all orders, unless the pairs say so one by one.
    """
    if not pairs:
        return [], []
    above = np.array([np.sign(found[i].frequency_hz - found[j].frequency_hz) for i, j in pairs])
    ratio = np.array([_log_ratio(found[i], found[j]) for i, j in pairs])
    by_strength = 2 * _USUAL_RATIO / _RATIO_SPREAD**2 * ratio
    by_shape = np.array([(misfit[j] - misfit[i]) / 2 for i, j in pairs])
    together = float(np.median(above * by_strength) + np.sum(above * by_shape))
    odds = above * together if abs(together) >= _DECIDED else by_strength + by_shape
    return (
        [pair for pair, each in zip(pairs, odds, strict=True) if each <= -_DECIDED],
        [pair for pair, each in zip(pairs, odds, strict=True) if abs(each) < _DECIDED],
    )


def _log_ratio(one: FoundMode, other: FoundMode) -> float:
    """Of the strengths; 0 where they are not known, as in wind."""
    ratio = one.acceleration_m_s2 / other.acceleration_m_s2
    return float(np.log(ratio)) if np.isfinite(ratio) and ratio > 0 else 0.0


def _odd(split: _Split, misfit: FloatArray) -> list[int]:
    """Modes without a partner that have no shape of a bar, where most of the series do."""
    own = split.own
    if 2 * sum(misfit[i] < _GOOD_SHAPE for i in own) < len(own):
        return []
    both = set(own.values()) & set(split.askew.values())
    return [i for i, n in own.items() if n not in both and misfit[i] >= _ODD_SHAPE]
