"""Tensioned bars in rotational end springs: their frequencies, shapes, and the bars that are tried.

Far from its ends a tensioned Euler-Bernoulli beam vibrates as sin(beta s + theta), s = x/L, plus an
edge term exp(-alpha s) at either end, alpha^2 = xi^2 + beta^2, xi = L sqrt(T/EI). A rotational
spring kappa = k L/EI sets tan(theta) = -kappa beta/(alpha^2 + beta^2 + kappa alpha), and
beta + 2 theta = n pi numbers the modes; the frequency goes as alpha beta. (Standard beam theory,
the overlap of the two edge terms left out: below 1 % in frequency, and only for n = 1, xi = 0.)
Springs are spread by their fixity, kappa/(kappa + sqrt(xi^2 + pi^2)): theta is nearly proportional
to it, and two springs that differ act on the frequencies as two of their mean fixity do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from shm.values import FloatArray, Hanger, IntArray

HIGHEST_ORDER = 40  # technical: of tables; the longest hangers have 30 orders in the band
FIXITY = np.linspace(0.0, 1.0, 5)
TENSION_SD = 0.3
"""Of the log of sqrt(T/m)/(2 L) beside the description: tension 0.55 to 1.8 of nominal."""
UNIT_SD = 0.15
"""Of the log of sqrt(EI/m)/(2 pi L^2) beside the description: length, strands' stiffness."""
_TAIL = 5.0  # judgement: degrees of freedom; at three deviations 5.1 instead of 9
_LEAST_XI = 0.5  # a bar without tension, whose pinned frequency is 1.3 % lower
_BELOW, _ABOVE = 3.0, 0.5  # judgement: lowest mode of order 20 at most, or 1.6 times low
_MISSING, _MISSING_DESCRIBED = 3.0, 2.0
"""Cost of an order without a mode, less where a description says which orders the modes have:
judgement, two of them cost as much as a mode off by 2.4 (2) tolerances."""
_SECTIONS = 1201  # technical: 30 a half wave of the highest order


@dataclass(frozen=True, eq=False)
class Bars:
    """A grid of bars and their cost before any mode is known.

    `xi` (tensions,); `offset` and `prior` (tensions, units): log of the frequency in Hz of
    alpha beta = 1, and twice the negative log likelihood; `unit_step` is that between units.
    `shift` (orders,) is the log of the frequencies beside those of a uniform bar.
    """

    xi: FloatArray
    offset: FloatArray
    prior: FloatArray
    unit_step: float
    missing_cost: float
    shift: FloatArray

    @cached_property
    def solution(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return beta, alpha and theta, each (tensions, fixities, orders)."""
        orders = np.arange(1, HIGHEST_ORDER + 1)
        return solved(self.xi[:, None, None], FIXITY[:, None], orders)

    @cached_property
    def log_factor(self) -> FloatArray:
        """Return logs of frequency over that of `offset`, (tensions, fixities, orders)."""
        beta, alpha, _ = self.solution
        return np.asarray(np.maximum.accumulate(np.log(alpha * beta) + self.shift, axis=-1))

    def shapes(self, position: FloatArray) -> FloatArray:
        """Return values at x/L `position` (points,): (tensions, fixities, orders, points)."""
        return shapes_of(self.solution, position)


@dataclass(frozen=True)
class Description:
    """State what a hanger describes: `log_unit` of sqrt(EI/m)/(2 pi L^2) in Hz, `log_xi`."""

    log_unit: float
    log_xi: float

    @classmethod
    def of(cls, hanger: Hanger) -> Description:
        """Return it from length, section, material and nominal tension."""
        stiffness, mass = hanger.bending_stiffness_n_m2, hanger.mass_per_length_kg_m
        unit = np.sqrt(stiffness / mass) / (2 * np.pi * hanger.length_m**2)
        xi = hanger.length_m * np.sqrt(hanger.nominal_tension_n / stiffness)
        return cls(float(np.log(unit)), float(np.log(max(xi, _LEAST_XI))))

    def cost(self, log_unit: FloatArray, log_xi: FloatArray) -> FloatArray:
        """Return twice the negative log likelihood of bars."""
        unit = log_unit - self.log_unit
        string = unit + log_xi - self.log_xi
        return heavy_tailed(string / TENSION_SD) + heavy_tailed(unit / UNIT_SD)


def described_bars(hanger: Hanger) -> Bars:
    """Return the bars around a description, in steps of 2 % of tension and 1 % of length."""
    described = Description.of(hanger)
    log_xi = described.log_xi + np.arange(-0.6, 0.6, 0.012)
    unit = described.log_unit + np.linspace(-0.8, 0.8, 65)
    offset = np.broadcast_to(unit, (len(log_xi), len(unit)))
    prior = described.cost(offset, log_xi[:, np.newaxis])
    shift = turnbuckle_shift(hanger)
    return Bars(np.exp(log_xi), offset, prior, 0.025, _MISSING_DESCRIBED, shift)


def any_bars(lowest_hz: float) -> Bars:
    """Return bars of any tension whose first frequency lies about the lowest mode or below it."""
    xi = np.concatenate(([_LEAST_XI], np.geomspace(1.0, 300.0, 44), [1000.0]))
    step = 0.008
    level = np.arange(np.log(lowest_hz) - _BELOW, np.log(lowest_hz) + _ABOVE, step)
    offset = level - np.log(np.pi * np.hypot(xi, np.pi))[:, np.newaxis]
    none = np.zeros(HIGHEST_ORDER)
    return Bars(xi, offset, np.zeros(offset.shape), step, _MISSING, none)


def described_shapes(places_m: FloatArray, orders: IntArray, hanger: Hanger) -> FloatArray:
    """Return shapes of the described hanger over end springs: (springs, modes, places)."""
    xi = np.exp(Description.of(hanger).log_xi)
    solution = solved(np.full((1, 1), xi), FIXITY[:, np.newaxis], np.asarray(orders))
    return shapes_of(solution, places_m / hanger.length_m, np.asarray(orders))


def log_factor(log_xi: float, fixity: FloatArray, order: FloatArray) -> FloatArray:
    """Return logs of alpha beta of one tension's bars, `fixity` and `order` from 1 (modes,)."""
    beta, alpha, _ = solved(np.full(order.shape, np.exp(log_xi)), fixity, order)
    return np.asarray(np.log(alpha * beta))


def solved(
    xi: FloatArray, fixity: FloatArray, order: FloatArray | IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return beta, alpha and theta; theta changes so slowly that 15 steps leave 1e-12 of beta."""
    beta, spring = np.asarray(order * np.pi), fixity * np.hypot(xi, np.pi)
    for _ in range(15):
        alpha = np.hypot(xi, beta)
        free = (1 - fixity) * (alpha**2 + beta**2)
        theta = -np.arctan2(spring * beta, free + spring * alpha)
        beta = order * np.pi - 2 * theta
    return beta, np.hypot(xi, beta), theta


def shapes_of(
    solution: tuple[FloatArray, FloatArray, FloatArray],
    position: FloatArray,
    orders: IntArray | None = None,
) -> FloatArray:
    """Return values (..., orders, points) at x/L `position` (points,); orders from 1 by default."""
    beta, alpha, theta = (each[..., np.newaxis] for each in solution)
    orders = np.arange(1, beta.shape[-2] + 1) if orders is None else orders
    sign = (-1.0) ** orders[:, np.newaxis]
    near, far = np.exp(-alpha * position), np.exp(-alpha * (1 - position))
    return np.asarray(np.sin(beta * position + theta) - np.sin(theta) * (near - sign * far))


def heavy_tailed(deviation: FloatArray) -> FloatArray:
    """Return squares of small deviations; large ones cost less (Student's distribution)."""
    return np.asarray(_TAIL * np.log1p(deviation**2 / _TAIL))


def turnbuckle_shift(hanger: Hanger) -> FloatArray:
    """Return the log of the frequency of each order beside that of the uniform bar, (orders,).

    By the Rayleigh-Ritz method (R. W. Clough and J. Penzien, Dynamics of Structures, 1993, 8-6)
    on the modes of the bar at nominal tension and half fixity. Across a stiff turnbuckle the
    bending moment goes on, across a soft one the curvature.
    """
    if not hanger.turnbuckles:
        return np.zeros(HIGHEST_ORDER)
    orders = np.arange(1, HIGHEST_ORDER + 1)
    xi = np.full(orders.shape, np.exp(Description.of(hanger).log_xi))
    beta, alpha, theta = solved(xi, np.full(orders.shape, 0.5), orders)
    place = np.linspace(0, 1, _SECTIONS)
    shape = shapes_of((beta, alpha, theta), place)
    shape = shape / np.sqrt(np.mean(shape**2, axis=1, keepdims=True))
    curvature = np.gradient(np.gradient(shape, place, axis=1), place, axis=1)
    added_mass, added_stiffness = np.zeros_like(place), np.zeros_like(place)
    for each in hanger.turnbuckles:
        inside = np.abs(place * hanger.length_m - each.x_m) <= each.length_m / 2
        added_mass[inside] = each.mass_kg / each.length_m / hanger.mass_per_length_kg_m - 1
        ratio = each.bending_stiffness_n_m2 / hanger.bending_stiffness_n_m2
        added_stiffness[inside] = 1 - 1 / ratio if ratio > 1 else ratio - 1
    squares = (alpha * beta) ** 2
    mass = np.eye(len(shape)) + (shape * added_mass) @ shape.T / _SECTIONS
    stiffness = np.diag(squares) + (curvature * added_stiffness) @ curvature.T / _SECTIONS
    moved = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
    return np.asarray(np.log(np.maximum(moved, squares / 4) / squares) / 2)
