"""Numbers the modes of each plane: a missing mode does not shift the others, nor does a false one.

The frequencies of both planes are compared with those of tensioned beams over a grid of tensions,
lengths and end springs: the planes share the tension and nearly the length, not the springs.
Orders may be left out and modes set aside, at a cost. Where length and several sensor positions
are known, the shapes have a say; where the hanger is described, so have its bending stiffness and
nominal tension, which no shifted numbering meets.

How far turnbuckles move the frequencies of a hanger off the pattern of a uniform bar.

What a reader should know of how planes and orders were decided.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import scipy

from shm.identify.mode_ordering.alignment import (
    HIGHEST_ORDER,
    Alignment,
    Grid,
    PlaneModes,
    Tolerance,
    aligned,
    log_pinned,
    tensioned_beam_pattern,
)
from shm.values import FloatArray, Hanger, IntArray, ResponsePoint

TOLERANCES = (Tolerance(0.012, 0.08), Tolerance(0.03, 0.24))
"""Of bars in plain springs, and of those with plates, brackets or turnbuckles."""
PLANE_TOLERANCE = 0.03
"""How far the two planes differ beyond what end springs explain (fraction of a frequency)."""
STRING_TOLERANCE = 0.3
"""How far sqrt(T/m)/(2 L) strays from the description (log): tension 0.55 to 1.8 of nominal."""
UNIT_TOLERANCE = 0.15
"""How far sqrt(EI/m)/(2 pi L^2) strays from the description (log): length, strands' stiffness."""
LEAST_MARGIN = 6.0
"""Of costs, by which another order is 20 times less likely: in 112 tests of
tests/worlds/recordings.py all of the wrong orders were below, and 4 of 107 right ones."""
# judgement: two missing orders cost as much as a mode off by 2.6 (2) tolerances
MISSING_COST = 3.5
MISSING_COST_DESCRIBED = 2.0
"""Of an order without a mode; less where the description says which orders the modes have."""
_LEVEL = 0.008  # the nearest level is off by a third of a tolerance at most, a cost of 0.1
_AROUND = 0.9  # three times STRING_TOLERANCE
_TENSIONS_AROUND = 1.2  # 3.6 times hypot(STRING_TOLERANCE, UNIT_TOLERANCE), the sd of log xi
_BELOW, _ABOVE = 3.0, 0.5  # judgement: lowest mode of order 20 at most, or 1.6 times low
_TAIL = 5.0  # judgement: degrees of freedom; at three deviations 5.1 instead of 9
MOST_ASIDE = 0.4
"""Share of the modes that may be set aside before description and pattern are doubted."""
_FREE = 2  # level and xi: two frequencies fit some beam

Orders: TypeAlias = tuple[tuple[int | None, ...], ...]
Basis: TypeAlias = Literal["description", "pattern", "counting"]


@dataclass(frozen=True)
class Numbering:
    """Orders from 1 of the modes of each plane, None for a mode set aside, and how they are known.

    `irregular` (planes,): whether the first order is off the beam that the others follow. `basis`:
    the hanger's `description`, the `pattern` of a tensioned beam, or mere `counting`. `cost`: twice
    the negative log likelihood, inf where counted; `margins` (planes, modes): how much more it
    costs at least to give a mode another order, 0 where counted.
    """

    orders: Orders
    irregular: tuple[bool, ...]
    basis: Basis
    cost: float = np.inf
    margins: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class Expected:
    """What a hanger's description says of its frequencies, `unit` times alpha beta of the pattern.

    `log_unit` is the log of sqrt(EI/m)/(2 pi L^2) in Hz, `log_xi` that of L sqrt(T/EI); `shift`
    see `Grid`.
    """

    log_unit: float
    log_xi: float
    shift: tuple[float, ...] = ()

    @classmethod
    def of(cls, hanger: Hanger) -> Expected:
        """From length, section, material, nominal tension and turnbuckles."""
        stiffness, mass = hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m
        unit = np.sqrt(stiffness / mass) / (2 * np.pi * hanger.length_m**2)
        xi = hanger.length_m * np.sqrt(hanger.nominal_tension_n / stiffness)
        return cls(float(np.log(unit)), float(np.log(xi)), turnbuckle_shift(hanger))

    @property
    def lowest(self) -> float:
        """Log of the least first frequency in Hz of the beams that are tried."""
        return self.log_unit + float(log_pinned(np.array(self.log_xi))) - _AROUND

    def grid(self) -> Grid:
        """Beams around the description."""
        log_xi = tensioned_beam_pattern().log_xi
        away = np.abs(log_xi - self.log_xi)
        tensions = np.flatnonzero(away < max(_TENSIONS_AROUND, away.min() + _LEVEL))
        levels = self.lowest + np.arange(0, 2 * _AROUND, _LEVEL)
        return Grid(tensions, levels, MISSING_COST_DESCRIBED, self.shift)

    def cost(self, grid: Grid) -> FloatArray:
        """Misfit of the beams of a grid, (levels, tensions)."""
        log_xi = tensioned_beam_pattern().log_xi[grid.tensions]
        unit = grid.levels[:, np.newaxis] - log_pinned(log_xi) - self.log_unit
        string = unit + log_xi - self.log_xi
        return heavy_tailed(string / STRING_TOLERANCE) + heavy_tailed(unit / UNIT_TOLERANCE)


def assign_orders(planes: Sequence[PlaneModes], expected: Expected | None = None) -> Numbering:
    """Numbers the modes of one or two planes.

    Where too many would be set aside, the description is doubted, then the pattern: without either,
    modes are counted.
    """
    counts = [len(plane.frequency_hz) for plane in planes]
    if 0 < max(counts) <= HIGHEST_ORDER:
        bases: Sequence[tuple[Basis, Expected | None]] = [("pattern", None)]
        if expected:
            bases = [("description", expected), *bases]
        for basis, each in bases:
            found = _fitted(planes, each, basis)
            if _few_aside(planes, found, each):
                return found
    counted = tuple(tuple(range(1, count + 1)) for count in counts)
    margins = tuple((0.0,) * count for count in counts)
    return Numbering(counted, (False,) * len(counts), "counting", margins=margins)


def _few_aside(planes: Sequence[PlaneModes], found: Numbering, expected: Expected | None) -> bool:
    """Whether so few modes are set aside that the basis itself is not doubted.

    What lies below the lowest frequency of any beam that the description allows is the deck's and
    says nothing of the hanger. Without a description, the first few modes only find out what beam
    it is.
    """
    lowest_hz = np.exp(expected.lowest) if expected else 0.0
    orders = [
        order
        for plane, own in zip(planes, found.orders, strict=True)
        for hz, order in zip(plane.frequency_hz, own, strict=True)
        if hz >= lowest_hz
    ]
    return orders.count(None) <= MOST_ASIDE * max(len(orders) - (0 if expected else _FREE), 0)


def _fitted(planes: Sequence[PlaneModes], expected: Expected | None, basis: Basis) -> Numbering:
    """The cheapest numbering over all beams, tolerances, and ways to leave out or set aside."""
    grid = expected.grid() if expected else _wide_grid(planes)
    prior = expected.cost(grid) if expected else np.zeros((1, 1))
    fits = []
    for tolerance in TOLERANCES:
        alignments = [aligned(plane, grid, tolerance) for plane in planes]
        cost, shift = _together([fit.total.min(axis=2) for fit in alignments])
        cost = cost + prior
        level, tension = divmod(int(np.argmin(cost)), cost.shape[1])
        levels = [level, level + int(shift[level, tension])]
        fits.append((float(cost[level, tension]), alignments, levels, tension, (cost, shift)))
    least, best, levels, tension, _ = min(fits, key=lambda fit: fit[0])
    own = list(zip(best, levels, strict=False))
    orders = tuple(tuple(fit.numbers(level, tension)) for fit, level in own)
    irregular = tuple(fit.is_first_irregular(level, tension) for fit, level in own)
    others = [_least_otherwise(orders, each, *costs) for _, each, _, _, costs in fits]
    margins = tuple(
        tuple(min(both) - least for both in zip(*plane, strict=True))
        for plane in zip(*others, strict=True)
    )
    return Numbering(orders, irregular, basis, least, margins)


def _least_otherwise(
    orders: Orders, alignments: Sequence[Alignment], cost: FloatArray, shift: IntArray
) -> list[list[float]]:
    """The least of `cost` (levels, tensions) where a mode has another order; inf for nowhere."""
    level = np.arange(cost.shape[0])[:, np.newaxis]
    found = []
    for alignment, known, by in zip(alignments, orders, (0 * shift, shift), strict=False):
        at = np.clip(level + by, 0, cost.shape[0] - 1)
        numbers = np.take_along_axis(alignment.all_numbers(), at[np.newaxis], axis=1)
        found.append([
            float(np.min(cost[(number > 0) & (number != (own or 0))], initial=np.inf))
            for own, number in zip(known, numbers, strict=True)
        ])  # fmt: skip
    return found


def _wide_grid(planes: Sequence[PlaneModes]) -> Grid:
    """Beams whose first frequency lies about the lowest mode or well below it."""
    lowest = np.log(min(plane.frequency_hz.min() for plane in planes if len(plane.frequency_hz)))
    tensions = np.arange(0, len(tensioned_beam_pattern().log_xi), 2)
    return Grid(tensions, np.arange(lowest - _BELOW, lowest + _ABOVE, _LEVEL), MISSING_COST)


def _together(costs: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Costs (levels, tensions) of one or two planes together, and by how many levels they differ.

    The second plane may be some levels above or below the first.
    """
    one, *others = costs
    least, at = np.asarray(one, float), np.zeros(one.shape, int)
    for other in others:
        least = np.full(one.shape, np.inf)
        reach = round(2.5 * PLANE_TOLERANCE / _LEVEL)
        padded = np.pad(other, ((reach, reach), (0, 0)), constant_values=np.inf)
        for shift in range(-reach, reach + 1):
            moved = padded[reach + shift : reach + shift + len(one)]
            cost = one + moved + (shift * _LEVEL / PLANE_TOLERANCE) ** 2
            at = np.where(cost < least, shift, at)
            least = np.minimum(least, cost)
    return least, at


def heavy_tailed(deviation: FloatArray) -> FloatArray:
    """Squares of small deviations; large ones cost less (Student's distribution)."""
    return np.asarray(_TAIL * np.log1p(deviation**2 / _TAIL))


_SECTIONS = 1201  # technical: 20 a half wave of HIGHEST_ORDER
_SPRING = 2  # of the fixities, 0.5


def turnbuckle_shift(hanger: Hanger) -> tuple[float, ...]:
    """Log of the frequency of each order beside that of the uniform bar; empty without turnbuckles.

    By the Rayleigh-Ritz method (R. W. Clough and J. Penzien, Dynamics of Structures, 1993, 8-6)
    on the modes of the bar at nominal tension and half fixity. Across a stiff turnbuckle the
    bending moment goes on, across a soft one the curvature.
    """
    if not hanger.turnbuckles:
        return ()
    pattern = tensioned_beam_pattern()
    xi = hanger.length_m * np.sqrt(hanger.nominal_tension_n / hanger.bending_stiffness_n_m2)
    tension = int(np.argmin(np.abs(pattern.log_xi - np.log(xi))))
    place = np.linspace(0, 1, _SECTIONS)
    shape = pattern.shapes(place, np.array([tension]))[0, _SPRING]
    shape = shape / np.sqrt(np.mean(shape**2, axis=1, keepdims=True))
    curvature = np.gradient(np.gradient(shape, place, axis=1), place, axis=1)
    added_mass, added_stiffness = _along(hanger, place)
    squares = (pattern.alpha[tension, _SPRING] * pattern.beta[tension, _SPRING]) ** 2
    mass = np.eye(len(shape)) + (shape * added_mass) @ shape.T / _SECTIONS
    stiffness = np.diag(squares) + (curvature * added_stiffness) @ curvature.T / _SECTIONS
    moved = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
    return tuple((np.log(np.maximum(moved, squares / 4) / squares) / 2).tolist())


def _along(hanger: Hanger, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Added mass and bending stiffness along the hanger, in those of the bar."""
    mass, stiffness = np.zeros_like(place), np.zeros_like(place)
    for each in hanger.turnbuckles:
        inside = np.abs(place * hanger.length_m - each.x_m) <= each.length_m / 2
        mass[inside] = each.mass_kg / each.length_m / hanger.mass_per_length_kg_m - 1
        ratio = each.bending_stiffness_n_m2 / hanger.bending_stiffness_n_m2
        stiffness[inside] = 1 - 1 / ratio if ratio > 1 else ratio - 1
    return mass, stiffness


_NOTED_DEGREES = 5.0  # judgement: a sensor clamped on by eye; it sees 0.8 % of the other plane


def plane_notes(points: Sequence[ResponsePoint], turned_rad: float) -> list[str]:
    """Where planes are not stated, or not the sensors' axes."""
    if not any(point.plane for point in points):
        return ["no channel states its plane: all modes are taken as transverse"]
    degrees = abs(math.degrees(turned_rad))
    if degrees >= _NOTED_DEGREES:
        return [
            f"the hanger's planes are turned by {degrees:.0f} degrees from the sensors' axes: each "
            "mode has the name of the nearer plane"
        ]
    return []


def support_notes(hanger: Hanger | None) -> list[str]:
    """Where a description does not help."""
    if hanger is None or hanger.as_hanger:
        return []
    return [
        "the hanger is not clamped at both ends and in tension: its description does not help to "
        "number the modes"
    ]


def basis_notes(
    numbering: Numbering, hanger: Hanger | None, points: Sequence[ResponsePoint]
) -> list[str]:
    """Where something else than description and shapes numbers the modes."""
    if numbering.basis == "counting":
        return ["the modes fit no tensioned beam: they are counted, so orders may be off"]
    if hanger and numbering.basis == "pattern":
        return [
            "the modes do not fit the hanger's description: they are numbered by the pattern of "
            "their frequencies alone"
        ]
    if hanger and not any(np.isfinite(point.x_m) for point in points):
        return ["no sensor states its position: shapes do not help to number the modes"]
    return []
