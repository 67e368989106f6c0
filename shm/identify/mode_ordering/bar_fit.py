"""Which of several numberings makes the hanger a bar, where the grid's tolerance fits them all.

Where the lowest modes are missing, orders one higher fit a bar of other tension to a percent, and
to that a hanger strays from the pattern. One that is but a bar in springs, though, is one to a
thousandth with its own orders, and with others seldom: the bar is fitted to each numbering.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.identify.mode_ordering.alignment import HIGHEST_ORDER, PlaneModes, log_frequency
from shm.identify.mode_ordering.order import (
    LEAST_MARGIN,
    STRING_TOLERANCE,
    UNIT_TOLERANCE,
    Expected,
    Numbering,
    Orders,
    assign_orders,
    heavy_tailed,
)
from shm.values import FloatArray

PLAIN_BAR = 0.001
"""Standard deviation of the log frequencies of a hanger that is but a bar, about the fitted one. In
80 tests of tests/worlds/recordings.py (seeds 4100 to 4103) their root mean square is 0.0003 in the
median and above this in seven, three of them of heavy sensors; of orders off by one it is 0.0008
and more. With 0.0015 one more of 112 tests is refused; no order is wrong with either."""
_MOST_OFF = 4.0  # judgement, standard deviations: of a mode that is farther off the order is unsure
LEAST_MODES = 6  # judgement: two more than tension, stiffness and a spring a plane


@dataclass(frozen=True, eq=False)
class Bar:
    """A numbering, the cost of its best bar, and by how much each mode's log frequency is off it.

    `off` (modes,) of both planes one after the other is NaN for modes without an order. `at` is the
    log unit and log xi, then each plane's fixity; `shift`: see `Grid`.
    """

    orders: Orders
    cost: float
    off: FloatArray
    at: FloatArray
    shift: tuple[float, ...] = ()

    def frequencies_hz(self, plane: int, highest: int) -> FloatArray:
        """Of the orders from 1 to `highest` of the plane of that number."""
        orders = np.arange(1.0, highest + 1)
        log_hz = self.at[0] + log_frequency(
            self.at[1], np.full(highest, self.at[2 + plane]), orders
        )
        return np.asarray(np.exp(log_hz + (np.array(self.shift[:highest]) if self.shift else 0.0)))

    @property
    def fits(self) -> bool:
        known = self.off[np.isfinite(self.off)]
        return bool(np.sqrt(np.mean(known**2)) < PLAIN_BAR)


def described_orders(planes: Sequence[PlaneModes], expected: Expected) -> Numbering:
    """By frequencies and shapes; where these make no bar to a thousandth but the orders that the
    frequencies alone are sure of do, by those.

    A sensor's weight, gain or place is one cause for the shapes of all modes: many that are off a
    little say no more than one, and yet outvote the frequencies.
    """
    numbering = borne_out(planes, expected, assign_orders(planes, expected))
    shaped = any(len(plane.position) for plane in planes)
    if not shaped or (_is_sure(numbering) and _is_plain_bar(planes, numbering, expected)):
        return numbering
    bare = [replace(p, position=np.empty(0), shapes=np.empty((0, 0))) for p in planes]
    alone = borne_out(bare, expected, assign_orders(bare, expected))
    plain = _is_sure(alone) and _is_plain_bar(planes, alone, expected)
    return alone if plain else numbering


def _is_sure(numbering: Numbering) -> bool:
    """Whether the description gives each mode its order, and no other fits nearly as well."""
    margins = [
        margin
        for orders, own in zip(numbering.orders, numbering.margins, strict=True)
        for order, margin in zip(orders, own, strict=True)
        if order is not None
    ]
    least = min(margins, default=0.0)
    return numbering.basis == "description" and least >= LEAST_MARGIN


def _is_plain_bar(planes: Sequence[PlaneModes], numbering: Numbering, expected: Expected) -> bool:
    """Whether modes enough to tell are one bar's to a thousandth."""
    if sum(order is not None for own in numbering.orders for order in own) < LEAST_MODES:
        return False
    return fitted_bar([plane.frequency_hz for plane in planes], numbering.orders, expected).fits


def borne_out(planes: Sequence[PlaneModes], expected: Expected, numbering: Numbering) -> Numbering:
    """The orders and margins of the numbering that a bar fits best, where one fits; else as given.

    Tried are shifts of all orders, as far as they fit better, and of one plane's beside the other.
    """
    known = sum(order is not None for own in numbering.orders for order in own)
    least = min((margin for own in numbering.margins for margin in own), default=np.inf)
    if numbering.basis != "description" or known < LEAST_MODES or least >= LEAST_MARGIN:
        return numbering
    frequency_hz = [plane.frequency_hz for plane in planes]
    tried = list(_shifted_while_better(frequency_hz, expected, numbering.orders))
    best = min(tried, key=lambda bar: bar.cost)
    beside = [
        fitted_bar(frequency_hz, _shifted(best.orders, shifts), expected)
        for shifts in ((0, 1), (0, -1))
        if all(len(own_hz) for own_hz in frequency_hz)
    ]
    best, *others = sorted([*tried, *beside], key=lambda bar: bar.cost)
    if not best.fits:
        return numbering
    margin = min((bar.cost for bar in others), default=np.inf) - best.cost
    sure = np.where(np.abs(best.off) < _MOST_OFF * PLAIN_BAR, margin, 0.0)
    apart = np.split(sure, [len(best.orders[0])])
    return replace(
        numbering, orders=best.orders, margins=tuple(tuple(own.tolist()) for own in apart)
    )


def _shifted_while_better(
    frequency_hz: Sequence[FloatArray], expected: Expected, orders: Orders
) -> Iterator[Bar]:
    """Bars of all orders lower and higher, as far as they cost little more than the best so far."""
    first = fitted_bar(frequency_hz, orders, expected)
    yield first
    least = first.cost
    for step in (1, -1):
        bar, shift = first, step
        while bar.cost < least + LEAST_MARGIN and np.isfinite(bar.cost):
            bar = fitted_bar(frequency_hz, _shifted(orders, (shift, shift)), expected)
            least = min(least, bar.cost)
            yield bar
            shift += step


def _shifted(orders: Orders, shifts: Sequence[int]) -> Orders:
    return tuple(
        tuple(None if order is None else order + shift for order in own)
        for own, shift in zip(orders, shifts, strict=True)
    )


def fitted_bar(frequency_hz: Sequence[FloatArray], orders: Orders, expected: Expected) -> Bar:
    """The best bar of each plane's modes: tension and stiffness are common, the springs its own."""
    springs = np.ones(len(frequency_hz))
    start = np.array([expected.log_unit, expected.log_xi, *(springs / 2)])
    numbers = [np.array([order or np.nan for order in own], float) for own in orders]
    number = np.concatenate(numbers)
    if np.nanmin(number) < 1 or np.nanmax(number) > HIGHEST_ORDER:
        return Bar(orders, np.inf, np.full(number.shape, np.nan), start)
    log_hz = np.log(np.concatenate(frequency_hz))
    if expected.shift:  # what turnbuckles do is taken off
        log_hz = log_hz - np.append(np.nan, expected.shift)[np.nan_to_num(number).astype(int)]
    plane_of = np.repeat(np.arange(len(springs)), [len(own) for own in orders])

    def off(at: FloatArray) -> FloatArray:
        return np.asarray(log_hz - at[0] - log_frequency(at[1], at[2:][plane_of], number))

    def misfit(at: FloatArray) -> FloatArray:
        unit = at[0] - expected.log_unit
        string = unit + at[1] - expected.log_xi
        rest = off(at) / PLAIN_BAR
        every = np.append(
            rest[np.isfinite(rest)], [string / STRING_TOLERANCE, unit / UNIT_TOLERANCE]
        )
        return np.asarray(np.sign(every) * np.sqrt(heavy_tailed(every)))

    best = scipy.optimize.least_squares(
        misfit,
        start,
        bounds=([-np.inf, 0.0, *(0 * springs)], [np.inf, np.inf, *springs]),
        method="dogbox",
    )
    return Bar(orders, 2 * float(best.cost), off(best.x), best.x, expected.shift)
