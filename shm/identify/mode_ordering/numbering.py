"""Number modes by one likelihood over bars.

On each bar a mode takes the nearest order or is foreign. The cheapest bar numbers the modes; the
next cheapest that gives a mode another order tells how sure its number is.

Both planes share the tension and nearly the length, not the springs. Where length and sensor
positions are known, shapes count. A hanger that is a bar in springs fits to a thousandth with its
orders and seldom with others: there one least-squares bar decides between orders that the grid
leaves open, and shows where an order is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

import numpy as np
import scipy

from shm.identify.mode_ordering.bars import (
    HIGHEST_ORDER,
    TENSION_SD,
    UNIT_SD,
    Bars,
    Description,
    any_bars,
    described_bars,
    heavy_tailed,
    log_factor,
    turnbuckle_shift,
)
from shm.values import FloatArray, Hanger, IntArray

LEAST_MARGIN = 6.0
"""Of costs, by which another order is 20 times less likely: in 112 tests of
tests/worlds/recordings.py all of the wrong orders were below, and 4 of 107 right ones."""
PLAIN_BAR = 0.001
"""Root mean square misfit of a hanger that is but a bar in springs, as a fraction of a frequency.
In 214 tests of tests/worlds/recordings.py such are 120, of 1,664 modes, to a median of 0.0002."""
LEAST_MODES = 6  # judgement: tension, stiffness and two springs fit four frequencies of any order
FOREIGN = 12.0
"""Cost of a mode that is none of the plane: a good fit is believed up to 3.5 tolerances."""
_IRREGULAR, _FARTHEST_BELOW = 8.0, 0.2
"""Cost of a first order off the others' bar: a sag raises it, by up to two fifths, a section lost
near an end lowers it by no more than a fifth, and it alone tells of either."""
_MOST_SHAPE_COST = 9.0  # three standard deviations, squared: a shape alone makes no mode foreign
_TOLERANCES = ((0.012, 0.08), (0.03, 0.24))
"""Of frequencies (fraction) and shapes (radians), of bars in plain springs and of those with
plates, brackets or turnbuckles; what is looser pays for it."""
PLANE_SD = 0.03  # how far the planes differ beyond what end springs explain
MOST_FOREIGN = 0.4  # share of the modes from which on the bars themselves are doubted
_MOST_FOREIGN_ONE_AXIS = 0.7  # one axis hears the other plane, too
_FREE = 2  # level and xi: two frequencies fit some bar
_MOST_OFF = 3.0  # standard deviations of a plain bar, beyond which a mode's order stays open
_SHIFTS = 2  # orders up and down: what the grid leaves open

Basis: TypeAlias = Literal["description", "pattern", "counting"]
Orders: TypeAlias = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class PlaneModes:
    """Modes of one plane by rising frequency.

    `frequency_hz` (modes,); `strength` (modes,), by which of two modes at one order the stronger is
    preferred, in costs; `position` (points,) as x/L, empty where unknown; `shapes` (modes, points)
    and the standard deviation of their values `shape_sd` (modes,).
    """

    frequency_hz: FloatArray
    strength: FloatArray
    position: FloatArray = field(default_factory=lambda: np.empty(0))
    shapes: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    shape_sd: FloatArray = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Numbering:
    """Orders from 1 of the modes of each plane, 0 for a foreign one, and how they are known.

    `margins` (planes, modes): how much more it costs at least to give a mode another order.
    `irregular` (planes,): whether the first order is off the bar that the others follow.
    """

    orders: Orders
    margins: tuple[tuple[float, ...], ...]
    irregular: tuple[bool, ...]
    basis: Basis

    @property
    def least_margin(self) -> float:
        """Return the least margin of a mode with an order; inf where none has one."""
        orders, margins = _flat(self.orders), np.concatenate([*self.margins, [np.inf]])
        return float(np.min(margins[:-1][orders > 0], initial=np.inf))


def number_modes(planes: Sequence[PlaneModes], hanger: Hanger | None) -> Numbering:
    """Assign orders to the modes of one or two planes.

    Where too many would be foreign, first the description is dropped, then the bar: without
    either, modes are counted.
    """
    counts = [len(plane.frequency_hz) for plane in planes]
    if 0 < max(counts) <= HIGHEST_ORDER:
        if hanger:
            bars = described_bars(hanger)
            found = _cheapest(planes, bars, "description")
            if _is_believed(planes, found, bars):
                return decided_by_bar(planes, found, hanger)
        lowest_hz = min(p.frequency_hz[0] for p in planes if len(p.frequency_hz))
        found = _cheapest(planes, any_bars(lowest_hz), "pattern")
        if _is_believed(planes, found, None):
            return found
    counted = tuple(tuple(range(1, count + 1)) for count in counts)
    none = tuple((0.0,) * count for count in counts)
    return Numbering(counted, none, (False,) * len(counts), "counting")


def _is_believed(planes: Sequence[PlaneModes], found: Numbering, bars: Bars | None) -> bool:
    """Return whether so few modes are foreign that the bars themselves are not doubted.

    What lies below any bar that the description allows is the deck's and says nothing of the
    hanger. Without a description, the first few modes only find out what bar it is.
    """
    lowest_hz = float(np.exp(bars.log_factor.min() + bars.offset.min())) if bars else 0.0
    frequency_hz = np.concatenate([plane.frequency_hz for plane in planes])
    orders = _flat(found.orders)[frequency_hz >= lowest_hz]
    most = MOST_FOREIGN if len(planes) > 1 or not bars else _MOST_FOREIGN_ONE_AXIS
    free = 0 if bars else _FREE
    return int(np.sum(orders == 0)) <= most * max(len(orders) - free, 0)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Hold the fit of modes on a grid of (tensions, units), at the best springs.

    `total` is the cost, `number` the orders from 1, 0 for foreign, and `misfit` the error of
    the frequency, both (modes, tensions, units).
    """

    total: FloatArray
    number: IntArray
    misfit: FloatArray


def _cheapest(planes: Sequence[PlaneModes], bars: Bars, basis: Basis) -> Numbering:
    """Return the orders by the cheapest bar over both tolerances."""
    fits = [_fit(planes, bars, tolerance) for tolerance in _TOLERANCES]
    best = min(fits, key=lambda fit: float(fit.total.min()))
    tension, unit = divmod(int(best.total.argmin()), best.total.shape[1])
    orders, misfits = best.number[:, tension, unit], best.misfit[:, tension, unit]
    others = [np.where((fit.number > 0) & (fit.number != orders[:, None, None]), fit.total, np.inf)
              for fit in fits]  # fmt: skip
    margins = np.min(others, axis=(0, 2, 3)) - best.total.min()
    irregular = _apart((orders == 1) & (misfits >= FOREIGN), planes)
    return Numbering(
        _apart(orders, planes), _apart(margins, planes), tuple(map(any, irregular)), basis
    )


def _apart(values: Any, planes: Sequence[PlaneModes]) -> tuple[tuple[Any, ...], ...]:
    """Return values of the modes of all planes (modes,) plane by plane."""
    ends = np.cumsum([len(plane.frequency_hz) for plane in planes])[:-1]
    return tuple(tuple(part.tolist()) for part in np.split(np.asarray(values), ends))


def _flat(orders: Orders) -> IntArray:
    """Return orders plane by plane as those of the modes of all planes, (modes,)."""
    return np.array([order for of_plane in orders for order in of_plane], dtype=int)


def _fit(planes: Sequence[PlaneModes], bars: Bars, tolerance: tuple[float, float]) -> _Fit:
    """Return the fit of one or two planes; the second may be stiffer or softer."""
    one, *others = (_fit_plane(plane, bars, tolerance) for plane in planes)
    total, numbers, misfits = one.total + bars.prior, [one.number], [one.misfit]
    reach, units = round(2.5 * PLANE_SD / bars.unit_step), one.total.shape[1]
    t, u = np.ogrid[: one.total.shape[0], :units]
    for other in others:
        padded = np.pad(other.total, ((0, 0), (reach, reach)), constant_values=np.inf)
        tried = np.array([
            padded[:, reach + by : reach + by + units] + (by * bars.unit_step / PLANE_SD) ** 2
            for by in range(-reach, reach + 1)
        ])  # fmt: skip
        at = np.clip(u + tried.argmin(axis=0) - reach, 0, units - 1)
        total = total + tried.min(axis=0)
        numbers.append(other.number[:, t, at])
        misfits.append(other.misfit[:, t, at])
    return _Fit(total, np.concatenate(numbers), np.concatenate(misfits))


def _fit_plane(plane: PlaneModes, bars: Bars, tolerance: tuple[float, float]) -> _Fit:
    """Return the fit of a plane's modes, each at its nearest order, at the best springs."""
    logs = bars.log_factor
    limits = ((logs[..., 1:] + logs[..., :-1]) / 2)[:, np.newaxis]
    shaped = _shape_costs(plane, bars, tolerance[1])
    t, _, s = np.ogrid[: len(logs), :1, : logs.shape[1]]
    loose = 2 * np.log(tolerance[0] / _TOLERANCES[0][0])
    grid = (len(plane.frequency_hz), *bars.offset.shape, logs.shape[1])
    number, cost, misfit = np.zeros(grid, dtype=int), np.empty(grid), np.empty(grid)
    for mode, hz in enumerate(plane.frequency_hz):
        log_ratio = (np.log(hz) - bars.offset)[:, :, np.newaxis]
        near = np.sum(log_ratio[..., np.newaxis] > limits, axis=-1)
        off = log_ratio - logs[t, s, near]
        squared = (off / tolerance[0]) ** 2
        first = (near == 0) & (off > -_FARTHEST_BELOW)
        misfit[mode] = squared + loose
        cost[mode] = np.where(first, np.minimum(squared, _IRREGULAR), squared) + loose
        if shaped is not None:
            cost[mode] += shaped[mode][t, s, near]
        number[mode] = np.where(cost[mode] < FOREIGN, near + 1, 0)
    _leave_one_of_each_order(number, cost, plane.strength)
    _cut_off(number, cost, bars.missing_cost)
    passed_over = number.max(axis=0, initial=0) - (number > 0).sum(axis=0)
    total = np.where(number > 0, cost, FOREIGN).sum(axis=0) + bars.missing_cost * passed_over
    spring = total.argmin(axis=-1)[..., np.newaxis]
    total, number, misfit = (
        np.take_along_axis(each, spring if each.ndim == 3 else spring[np.newaxis], -1)[..., 0]
        for each in (total, number, misfit)
    )
    return _Fit(total, number, misfit)


def _leave_one_of_each_order(number: IntArray, cost: FloatArray, strength: FloatArray) -> None:
    """Leave of two modes at one order the likelier one; the other is foreign."""
    for i in range(len(number)):
        for j in range(i - 1, -1, -1):  # by rising frequency: only neighbours share an order
            clash = (number[i] == number[j]) & (number[i] > 0)
            if not clash.any() and i - j > 1:
                break
            loses = cost[i] - strength[i] >= cost[j] - strength[j]
            number[i][clash & loses] = 0
            number[j][clash & ~loses] = 0


def _cut_off(number: IntArray, cost: FloatArray, missing_cost: float) -> None:
    """Make the highest modes foreign where that costs less than the orders they pass over."""
    above = np.zeros(number.shape[1:], dtype=bool)
    for mode in range(len(number) - 1, -1, -1):
        passed_over = number[mode] - number[:mode].max(axis=0, initial=0) - 1
        dear = cost[mode] + missing_cost * passed_over > FOREIGN
        number[mode][dear & ~above] = 0
        above |= number[mode] > 0
        if above.all():
            break


def _shape_costs(plane: PlaneModes, bars: Bars, tolerance: float) -> FloatArray | None:
    """Return the misfit of shapes, (modes, tensions, fixities, orders); None of a single place."""
    if len(plane.position) < 2 or not len(plane.shapes):
        return None
    expected = bars.shapes(plane.position)
    norm = np.sum(plane.shapes**2, axis=1)[:, np.newaxis, np.newaxis, np.newaxis]
    product = np.tensordot(plane.shapes, expected, axes=(1, 3)) ** 2
    likeness = product / (np.sum(expected**2, axis=-1) * norm + np.finfo(float).tiny)
    sd = np.nan_to_num(plane.shape_sd)[:, np.newaxis, np.newaxis, np.newaxis]
    return np.asarray(np.minimum((1 - likeness) / (tolerance**2 + sd**2 / norm), _MOST_SHAPE_COST))


@dataclass(frozen=True, eq=False)
class FittedBar:
    """The bar of least cost in given orders; `off` (modes,): log frequencies beside its own.

    `at` is the log unit and log xi, then each plane's fixity; `shift`: see `Bars`.
    """

    orders: Orders
    cost: float
    off: FloatArray
    at: FloatArray
    shift: FloatArray

    def frequencies_hz(self, plane: int, highest: int) -> FloatArray:
        """Return those of the orders from 1 to `highest` of the plane of that number."""
        fixity = np.full(highest, self.at[2 + plane])
        factor = log_factor(self.at[1], fixity, np.arange(1.0, highest + 1))
        return np.asarray(np.exp(self.at[0] + factor + self.shift[:highest]))

    @property
    def is_plain(self) -> bool:
        """Return whether the modes are its own to a thousandth."""
        return bool(np.sqrt(np.nanmean(self.off**2)) < PLAIN_BAR)


def fit_bar(planes: Sequence[FloatArray], orders: Orders, hanger: Hanger) -> FittedBar:
    """Fit tension, stiffness and each plane's fixity to frequencies in Hz of given orders."""
    described, shift, number = Description.of(hanger), turnbuckle_shift(hanger), _flat(orders)
    known = number > 0
    plane_of = np.repeat(np.arange(len(planes)), [len(of_plane) for of_plane in orders])[known]
    log_hz = np.log(np.concatenate(planes))[known] - shift[number[known] - 1]

    def off(at: FloatArray) -> FloatArray:
        factor = log_factor(at[1], at[2:][plane_of], number[known].astype(float))
        return np.asarray(log_hz - at[0] - factor)

    def misfit(at: FloatArray) -> FloatArray:
        unit = at[0] - described.log_unit
        string = unit + at[1] - described.log_xi
        every = np.append(off(at) / PLAIN_BAR, [string / TENSION_SD, unit / UNIT_SD])
        return np.asarray(np.sign(every) * np.sqrt(heavy_tailed(every)))

    start = np.array([described.log_unit, described.log_xi, *([0.5] * len(planes))])
    low = np.array([-np.inf, 0.0, *([0.0] * len(planes))])
    high = np.array([np.inf, np.inf, *([1.0] * len(planes))])
    best = scipy.optimize.least_squares(misfit, start, bounds=(low, high), method="dogbox")
    every_off = np.full(number.shape, np.nan)
    every_off[known] = off(best.x)
    return FittedBar(orders, 2 * float(best.cost), every_off, best.x, shift)


def decided_by_bar(planes: Sequence[PlaneModes], found: Numbering, hanger: Hanger) -> Numbering:
    """Return the orders and margins of the shift that a bar fits to a thousandth, where one does.

    Tried are shifts of all orders, and of one plane's beside the other. Shapes have no say: a
    sensor's gain or place is one cause for the shapes of all modes.
    """
    if np.sum(_flat(found.orders) > 0) < LEAST_MODES:
        return found
    frequency_hz = [plane.frequency_hz for plane in planes]
    first = fit_bar(frequency_hz, found.orders, hanger)
    if found.least_margin >= LEAST_MARGIN and first.is_plain:
        return found
    tried = [
        fit_bar(frequency_hz, orders, hanger)
        for by in range(-_SHIFTS, _SHIFTS + 1)
        for orders in _shifted(found.orders, (by, by))
    ]
    best = min(tried, key=lambda bar: bar.cost)
    if sum(map(any, found.orders)) > 1:
        tried += [
            fit_bar(frequency_hz, orders, hanger)
            for by in (1, -1)
            for orders in _shifted(best.orders, (0, by))
        ]
    best, *others = sorted(tried, key=lambda bar: bar.cost)
    if not best.is_plain:
        return found
    margin = min((bar.cost for bar in others), default=np.inf) - best.cost
    sure = np.where(np.abs(best.off) < _MOST_OFF * PLAIN_BAR, margin, 0.0)
    return replace(found, orders=best.orders, margins=_apart(sure, planes))


def _shifted(orders: Orders, shifts: Sequence[int]) -> list[Orders]:
    """Return orders higher by `shifts`, one a plane; nothing where one would be outside."""
    moved = tuple(
        tuple(order + by if order else 0 for order in of_plane)
        for of_plane, by in zip(orders, shifts, strict=False)
    )
    numbered = _flat(moved)[_flat(orders) > 0]
    return [moved] if numbered.min() >= 1 and numbered.max() <= HIGHEST_ORDER else []
