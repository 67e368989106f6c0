"""How well the modes of one plane fit tensioned beams, with orders left out and modes set aside.

Every mode takes the order nearest to it, at the cost of its misfit in frequency and shape, or is
set aside at a fixed cost; of two modes at one order the better one takes it. Each order passed over
costs, too. Costs are twice negative log likelihoods.

What the modes of a tensioned beam look like whatever its length, tension and end springs.

Used to number modes when some are missing; a yardstick of about one percent, not a model to update.
Far from its ends a tensioned Euler-Bernoulli beam vibrates as sin(beta s + theta), s = x/L, plus an
edge term exp(-alpha s) at either end, alpha^2 = xi^2 + beta^2, xi = L sqrt(T/EI). A rotational
spring kappa = k L/EI sets tan(theta) = -kappa beta/(alpha^2 + beta^2 + kappa alpha), and
beta + 2 theta = n pi numbers the modes; the frequency goes as alpha beta. (Standard beam theory,
the overlap of the two edge terms left out: below 1 % in frequency, and only for n = 1, xi = 0.)
Springs are spread by their fixity, kappa/(kappa + sqrt(xi^2 + pi^2)): theta is nearly proportional
to it, and two springs that differ act on the frequencies as two of their mean fixity do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from shm.values import NAN, BoolArray, FloatArray, IntArray

Costs: TypeAlias = NDArray[np.float32]

ASIDE_COST = 12.0
"""Of a mode that is none of the plane: a good fit is believed up to three tolerances."""
IRREGULAR_COST = 8.0
"""Of a first order off the others' beam: a sag raises it, by up to two fifths, a section lost near
an end lowers it, and it alone tells of either."""
_FARTHEST_BELOW = 0.2  # judgement: a section lost near an end takes no more; else it is no first
_MOST_SHAPE_COST = 9.0  # three standard deviations, squared: a shape alone sets no mode aside
_ORDINARY = 0.012  # the first of TOLERANCES in `order`: what is looser pays for it
HIGHEST_ORDER = 60  # technical: of tables; the longest hangers have 30 orders in the band
STEP = 0.002
"""Of log frequency in the tables of the nearest order."""
# xi from a bar without tension to nearly a string, by 10 %; 0.5, whose pinned frequency is 1.3 %
# above that of 0, stands for 0 on the logarithmic scale. Fixity: as the module's text says.
_TENSION = np.concatenate(([0.0], np.geomspace(1.0, 300.0, 58), [1000.0]))
_NO_TENSION = 0.5
_FIXITY = np.array([0.0, 0.25, 0.5, 0.75, 1.0])


@dataclass(frozen=True)
class Tolerance:
    """How far a hanger strays from the pattern: its frequencies (fraction) and shapes (radians).

    A shape is a direction in the space of its points; it strays by an angle.
    """

    frequency: float
    shape: float


@dataclass(frozen=True, eq=False)
class PlaneModes:
    """Modes of one plane by rising frequency.

    `frequency_hz` (modes,); `position` (points,) as x/L, empty where unknown; `shapes`
    (modes, points); `shape_sd` and `doubt` (modes,), empty for none: standard deviation of the
    shape's values, and the cost of taking each for a mode of the hanger at all. `missing_cost`, NaN
    for the grid's, is that of an order of this plane without a mode.
    """

    frequency_hz: FloatArray
    position: FloatArray = field(default_factory=lambda: np.empty(0))
    shapes: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    shape_sd: FloatArray = field(default_factory=lambda: np.empty(0))
    doubt: FloatArray = field(default_factory=lambda: np.empty(0))
    missing_cost: float = NAN


@dataclass(frozen=True, eq=False)
class Grid:
    """The beams that are tried.

    `tensions` (tensions,) are indices of the pattern; `levels` (levels,) logs of the first pinned
    frequency in Hz; `missing_cost` is that of an order without a mode; `shift` (orders,), empty for
    none, is the log of the frequencies beside those of a uniform beam.
    """

    tensions: IntArray
    levels: FloatArray
    missing_cost: float
    shift: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Alignment:
    """Costs over a grid: `total` (levels, tensions, springs), `orders` from 0 and `costs` a mode.

    `orders`, `costs` and `irregular`, whether a mode is a first order so far off the beam that it
    would be set aside, have shape (modes, levels, tensions, springs).
    """

    total: Costs
    orders: Sequence[IntArray]
    costs: Sequence[Costs]
    irregular: Sequence[BoolArray]

    def numbers(self, level: int, tension: int) -> list[int | None]:
        """Orders from 1 at the best springs of one beam; None for a mode set aside."""
        spring = int(np.argmin(self.total[level, tension]))
        found: list[int | None] = []
        best: dict[int, tuple[float, int]] = {}
        for mode, (orders, costs) in enumerate(zip(self.orders, self.costs, strict=True)):
            order, cost = int(orders[level, tension, spring]), float(costs[level, tension, spring])
            found.append(None)
            if cost < best.get(order, (ASIDE_COST, 0))[0]:
                best[order] = (cost, mode)
        for order, (_, mode) in best.items():
            found[mode] = order + 1
        return found

    def all_numbers(self) -> IntArray:
        """Orders from 1 at the best springs of every beam, 0 aside: (modes, levels, tensions)."""
        spring = np.argmin(self.total, axis=2)[..., np.newaxis]
        rows = [
            np.where(
                np.take_along_axis(costs, spring, axis=2) < ASIDE_COST,
                np.take_along_axis(orders, spring, axis=2) + 1,
                0,
            )[..., 0]
            for orders, costs in zip(self.orders, self.costs, strict=True)
        ]
        return np.asarray(rows, dtype=int).reshape(len(rows), *self.total.shape[:2])

    def is_first_irregular(self, level: int, tension: int) -> bool:
        """Whether the first order at the best springs of one beam is off that beam's."""
        numbers = self.numbers(level, tension)
        if 1 not in numbers:
            return False
        spring = int(np.argmin(self.total[level, tension]))
        return bool(self.irregular[numbers.index(1)][level, tension, spring])


def aligned(plane: PlaneModes, grid: Grid, tolerance: Tolerance) -> Alignment:
    """The modes of a plane against every beam of the grid."""
    nearest = nearest_orders(grid.shift)
    order_table = nearest.order[:, grid.tensions]
    residual_table = nearest.residual[:, grid.tensions]
    shape_costs = _shape_costs(plane, grid, tolerance)
    doubt = plane.doubt if len(plane.doubt) else np.zeros(len(plane.frequency_hz))
    spread = 2 * np.log(tolerance.frequency / _ORDINARY)
    orders, costs, irregular = [], [], []
    for mode, log_frequency in enumerate(np.log(plane.frequency_hz)):
        entry = nearest.entry(log_frequency - grid.levels)
        order = order_table[entry]
        residual = residual_table[entry]
        misfit = (residual / tolerance.frequency) ** 2
        first = (order == 0) & (residual > -_FARTHEST_BELOW)
        cost = np.where(first, np.minimum(misfit, IRREGULAR_COST), misfit) + spread + doubt[mode]
        if shape_costs is not None:
            cost += _of_orders(shape_costs[mode], order)
        orders.append(order)
        costs.append(np.minimum(cost, ASIDE_COST).astype(np.float32))
        irregular.append(first & (misfit + spread + doubt[mode] >= ASIDE_COST))
    missing_cost = grid.missing_cost if np.isnan(plane.missing_cost) else plane.missing_cost
    total = _total(orders, costs, grid, np.float32(missing_cost))
    return Alignment(total, orders, costs, irregular)


def _of_orders(table: Costs, order: IntArray) -> Costs:
    """Entries of `table` (tensions, springs, orders) for `order` (levels, tensions, springs)."""
    tension, spring = np.ogrid[: table.shape[0], : table.shape[1]]
    return np.asarray(table[tension, spring, order])


def _total(
    orders: Sequence[IntArray], costs: Sequence[Costs], grid: Grid, missing_cost: np.float32
) -> Costs:
    """Sum over the modes; the better of two at one order counts, the other is set aside."""
    springs = tensioned_beam_pattern().log_frequency.shape[1]
    shape = (len(grid.levels), len(grid.tensions), springs)
    total = np.zeros(shape, np.float32)
    last, last_cost = np.full(shape, -1, np.int16), np.zeros(shape, np.float32)
    for order, cost in zip(orders, costs, strict=True):
        aside = cost >= ASIDE_COST
        rival = (order == last) & ~aside
        better = np.minimum(cost, last_cost)
        gap = missing_cost * (order - last - 1)
        total += np.where(
            aside, ASIDE_COST, np.where(rival, ASIDE_COST + better - last_cost, cost + gap)
        )
        last_cost = np.where(aside, last_cost, np.where(rival, better, cost))
        last = np.where(aside, last, order)
    return total


def _shape_costs(plane: PlaneModes, grid: Grid, tolerance: Tolerance) -> Costs | None:
    """Misfit of the shapes, (modes, tensions, springs, orders); None where they say nothing."""
    if len(plane.position) < 2:
        return None
    likeness = _likeness(tensioned_beam_pattern(), plane, grid)
    sd = plane.shape_sd if len(plane.shape_sd) else np.zeros(len(plane.shapes))
    norm = np.sum(plane.shapes**2, axis=1) + np.finfo(float).tiny
    variance = tolerance.shape**2 + np.nan_to_num(sd) ** 2 / norm
    cost = (1 - likeness) / variance[:, np.newaxis, np.newaxis, np.newaxis]
    return np.asarray(np.minimum(cost, _MOST_SHAPE_COST), np.float32)


def _likeness(pattern: Pattern, plane: PlaneModes, grid: Grid) -> FloatArray:
    """Modal assurance criterion of every mode and order, (modes, tensions, springs, orders)."""
    expected = pattern.shapes(plane.position, grid.tensions)
    norms = np.einsum("tsop,tsop->tso", expected, expected)
    norm = np.sum(plane.shapes**2, axis=1)[:, np.newaxis, np.newaxis, np.newaxis]
    product = np.tensordot(plane.shapes, expected, axes=(1, 3)) ** 2
    return np.asarray(product / (norms * norm + np.finfo(float).tiny))


@dataclass(frozen=True, eq=False)
class Pattern:
    """Modes of tensioned beams over a grid of xi and of spring fixity.

    `log_xi` has shape (tensions,), the others (tensions, springs, orders): `log_frequency` in units
    of the first frequency of the pinned beam, `beta`, `alpha` and `theta` of the shape.
    """

    log_xi: FloatArray
    log_frequency: FloatArray
    beta: FloatArray
    alpha: FloatArray
    theta: FloatArray

    def shapes(self, position: FloatArray, tensions: IntArray) -> FloatArray:
        """Values at x/L `position` (points,): (tensions, springs, orders, points)."""
        beta, alpha, theta = (
            array[tensions][..., np.newaxis] for array in (self.beta, self.alpha, self.theta)
        )
        edge = np.sin(theta) * np.exp(-alpha * position)
        orders = np.arange(1, self.beta.shape[-1] + 1)[:, np.newaxis]
        far_edge = (-1.0) ** orders * np.sin(theta) * np.exp(-alpha * (1 - position))
        return np.asarray(np.sin(beta * position + theta) - edge + far_edge)


@dataclass(frozen=True, eq=False)
class Nearest:
    """The order nearest to a log frequency, and how far it is, for every pattern of the grid.

    `log_frequency` (entries,) rises by `STEP`; `order` (from 0) and `residual` are (entries,
    tensions, springs).
    """

    log_frequency: FloatArray
    order: IntArray
    residual: FloatArray

    def entry(self, log_frequency: FloatArray) -> IntArray:
        """Entries of log frequencies; those beyond the table get its ends."""
        entry = np.round((log_frequency - self.log_frequency[0]) / STEP).astype(int)
        return np.asarray(np.clip(entry, 0, len(self.log_frequency) - 1))


@lru_cache(maxsize=1)
def tensioned_beam_pattern() -> Pattern:
    """The grid of patterns; made once."""
    order = np.arange(1, HIGHEST_ORDER + 1)
    tension, fixity, order_pi = np.meshgrid(_TENSION, _FIXITY, order * np.pi, indexing="ij")
    beta = _solve_beta(tension, fixity, order_pi)
    alpha = np.hypot(tension, beta)
    log_xi = np.log(np.maximum(_TENSION, _NO_TENSION))
    log_frequency = np.log(alpha * beta) - log_pinned(log_xi)[:, np.newaxis, np.newaxis]
    return Pattern(log_xi, log_frequency, beta, alpha, _theta(beta, tension, fixity))


@lru_cache(maxsize=4)
def nearest_orders(shift: tuple[float, ...] = ()) -> Nearest:
    """The table of nearest orders; made once for each `shift` (orders,) of log frequency."""
    logs = tensioned_beam_pattern().log_frequency
    if shift:
        logs = np.maximum.accumulate(logs + np.array(shift), axis=-1)
    entries = np.arange(logs.min() - 1.0, logs.max() + STEP, STEP)
    limits = (logs[..., 1:] + logs[..., :-1]) / 2
    order = np.array([[np.searchsorted(limit, entries) for limit in row] for row in limits])
    near = np.take_along_axis(logs, order, axis=-1)
    residual = np.moveaxis(entries - near, -1, 0)
    return Nearest(entries, np.moveaxis(order, -1, 0).astype(np.int16), residual.astype(np.float32))


def log_frequency(log_xi: float, fixity: FloatArray, order: FloatArray) -> FloatArray:
    """Logs of alpha beta of one tension's beams, `fixity` and `order` from 1 (modes,)."""
    xi = np.full(order.shape, np.exp(log_xi))
    beta = _solve_beta(xi, fixity, order * np.pi)
    return np.asarray(np.log(np.hypot(xi, beta) * beta))


def log_pinned(log_xi: FloatArray) -> FloatArray:
    """Log of the pinned beam's first frequency in units of sqrt(EI/m)/(2 pi L^2)."""
    return np.asarray(np.log(np.pi * np.hypot(np.exp(log_xi), np.pi)))


def _theta(beta: FloatArray, tension: FloatArray, fixity: FloatArray) -> FloatArray:
    alpha = np.hypot(tension, beta)
    spring = fixity * np.hypot(tension, np.pi)
    return np.asarray(
        -np.arctan2(spring * beta, (1 - fixity) * (alpha**2 + beta**2) + spring * alpha)
    )


def _solve_beta(tension: FloatArray, fixity: FloatArray, order_pi: FloatArray) -> FloatArray:
    """beta + 2 theta(beta) = n pi; theta changes so slowly that 15 steps leave 1e-12 of beta."""
    beta = order_pi
    for _ in range(15):
        beta = order_pi - 2 * _theta(beta, tension, fixity)
    return np.asarray(beta)
