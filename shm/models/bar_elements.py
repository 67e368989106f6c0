"""Matrices of a tensioned bar by finite elements of high degree, one for each term of its energy.

Lengths are in units of the bar's length L, forces in EI/L2, rotational springs in EI/L, masses in
m L. The deflection w is continuous with its slope: Hermite cubics on each element and bubbles whose
second derivative is a Legendre polynomial. With shear the section turns by w' less the strain g, a
continuous field of its own (hats and integrated Legendre polynomials), so that no element locks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shm.values import FloatArray

_SHORTEST = 1e-3  # numerical: a mass nearer to another edge needs no element of its own

_BUBBLES = 6
"""On a short element: resolves a boundary layer of four decay lengths to 1e-7."""


@dataclass(frozen=True, eq=False)
class BarElements:
    """Energies of a bar without lateral deflection at its ends; all matrices (d, d) are symmetric.

    `mass` and `turning` have a matrix for each zone: 0 is the bar itself, then the zones in order.
    `curvature` (points, d) of each is weighted so that its square is the energy of bending. `shear`
    is empty for a bar that does not shear. `end_rotation` (2, d) are the rotations of the deck's
    and the arch's section, `area` (d,) the integral of the deflection. `gradient` is that of a
    tension x - 1/2, which grows along the bar.
    """

    curvature: tuple[FloatArray, ...]
    tension: FloatArray
    gradient: FloatArray
    mass: FloatArray
    turning: FloatArray
    shear: FloatArray
    end_rotation: FloatArray
    area: FloatArray
    edges: FloatArray
    degrees: tuple[int, ...]

    @property
    def bending(self) -> FloatArray:
        """Return the matrices (zones, d, d) of bending."""
        return np.array([each.T @ each for each in self.curvature])

    def deflection(self, x: FloatArray) -> FloatArray:
        """Return the deflection (points, d) of each function at places `x` from 0 to 1."""
        return self._derivative(x, 0)

    def slope(self, x: FloatArray) -> FloatArray:
        """Return the slope of the axis (points, d) of each function at places `x` from 0 to 1."""
        return self._derivative(x, 1)

    def _derivative(self, x: FloatArray, order: int) -> FloatArray:
        element = (np.searchsorted(self.edges, x, side="right") - 1).clip(0, len(self.degrees) - 1)
        found = np.zeros((len(x), len(self.area)))
        columns = _columns(self.degrees)
        for index, functions in enumerate(columns):
            rows = np.flatnonzero(element == index)
            if not len(rows):
                continue
            start, length = self.edges[index], self.edges[index + 1] - self.edges[index]
            table = _functions((x[rows] - start) / length, length, self.degrees[index])
            for function, column in enumerate(functions):
                if column >= 0:
                    found[rows, column] += table[order][function]
        return found


def bar_elements(
    zones: list[tuple[float, float]],
    decay: float,
    modes: int,
    shears: bool,
    masses_at: Sequence[float] = (),
) -> BarElements:
    """Return the matrices of a bar with `zones` (start, end), for `modes` modes.

    `decay` is L sqrt(T/EI) at a usual tension: elements are short where boundary layers are. They
    meet where point masses are (`masses_at`), since shear force and moment jump there.
    """
    edges = _edges(zones, decay, masses_at)
    lengths = np.diff(edges)
    degrees = tuple(
        max(_BUBBLES, int(np.ceil(np.pi / 2 * (modes + 2) * length)) + 5) for length in lengths
    )
    columns = _columns(degrees)
    w_count = 1 + max(max(indices) for indices in columns)
    strains = _strain_columns(degrees, w_count) if shears else [[] for _ in degrees]
    count = w_count + (1 + max(max(indices) for indices in strains) - w_count if shears else 0)
    mass, turning = (np.zeros((len(zones) + 1, count, count)) for _ in range(2))
    curvatures: list[list[FloatArray]] = [[] for _ in range(len(zones) + 1)]
    tension, gradient, shear = (np.zeros((count, count)) for _ in range(3))
    area, rotation = np.zeros(count), np.zeros((2, count))
    for index, (start, length, degree) in enumerate(zip(edges[:-1], lengths, degrees, strict=True)):
        points, weights = np.polynomial.legendre.leggauss(degree + 5)
        x, weight = (points + 1) / 2, weights / 2 * length
        w, slope, curvature = _functions(x, length, degree)
        indices = np.array([*columns[index], *strains[index]])
        if shears:
            g, change = _strains(x, length, degree)
            none = np.zeros((len(g), len(x)))
            w, slope, strain = np.vstack([w, none]), np.vstack([slope, none]), np.vstack([0 * w, g])
            curvature = np.vstack([curvature, -change])
            turn = slope - strain
        else:
            strain, turn = 0 * w, slope
        free = indices >= 0
        place = np.ix_(indices[free], indices[free])
        middle = start + length / 2
        zone = next((k for k, (a, b) in enumerate(zones, 1) if a < middle < b), 0)

        bent = np.zeros((len(x), count))
        bent[:, indices[free]] = (curvature[free] * np.sqrt(weight)).T
        curvatures[zone].append(bent)
        mass[zone][place] += _energy(w[free], weight)
        turning[zone][place] += _energy(turn[free], weight)
        tension[place] += _energy(slope[free], weight)
        gradient[place] += _energy(slope[free], weight * (start + x * length - 0.5))
        shear[place] += _energy(strain[free], weight)
        area[indices[free]] += w[free] @ weight
    first, last = np.array(columns[0]), np.array(columns[-1])
    rotation[0, first[1]], rotation[1, last[3]] = 1.0, 1.0
    if shears:
        rotation[0, strains[0][0]], rotation[1, strains[-1][1]] = -1.0, -1.0
    weighted = tuple(np.vstack([np.zeros((0, count)), *each]) for each in curvatures)
    return BarElements(
        weighted, tension, gradient, mass, turning, shear if shears else np.empty((0, 0)),
        rotation, area, edges, degrees,
    )  # fmt: skip


def _energy(field: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the integrals (functions, functions) of products of a field (functions, points)."""
    return np.asarray((field * weight) @ field.T)


def _edges(
    zones: list[tuple[float, float]], decay: float, masses_at: Sequence[float]
) -> FloatArray:
    """Return the elements' edges: zones' own, those at masses, and boundary layers beside each."""
    breaks = sorted({0.0, 1.0, *(edge for zone in zones for edge in zone)})
    breaks += [x for x in masses_at if min(abs(x - edge) for edge in breaks) > _SHORTEST]
    breaks.sort()
    layers = [3 / decay, 15 / decay] if decay > 0 else []
    found = set(breaks)
    for low, high in pairwise(breaks):
        for away in layers:
            if away < (high - low) / 3:
                found |= {low + away, high - away}
    return np.array(sorted(found))


def _columns(degrees: tuple[int, ...]) -> list[list[int]]:
    """Return the unknown of each function of each element, -1 for the deflections of the ends."""
    found, last = [], len(degrees) - 1
    slopes = len(degrees) + 1
    inner = slopes + len(degrees) - 1  # slopes at all nodes, then deflections at inner nodes
    for index, degree in enumerate(degrees):
        left = -1 if index == 0 else slopes + index - 1
        right = -1 if index == last else slopes + index
        bubbles = list(range(inner, inner + degree))
        inner += degree
        found.append([left, index, right, index + 1, *bubbles])
    return found


def _strain_columns(degrees: tuple[int, ...], first: int) -> list[list[int]]:
    """Return the same of the strain: values at all nodes, then inner functions."""
    found, inner = [], first + len(degrees) + 1
    for index, degree in enumerate(degrees):
        inside = list(range(inner, inner + degree + 1))
        inner += degree + 1
        found.append([first + index, first + index + 1, *inside])
    return found


def _functions(
    x: FloatArray, length: float, bubbles: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return deflection, slope and curvature (functions, points) at `x` from 0 to 1."""
    w = [1 - 3 * x**2 + 2 * x**3, length * (x - 2 * x**2 + x**3)]
    w += [3 * x**2 - 2 * x**3, length * (x**3 - x**2)]
    slope = [(6 * x**2 - 6 * x) / length, 1 - 4 * x + 3 * x**2]
    slope += [(6 * x - 6 * x**2) / length, 3 * x**2 - 2 * x]
    curvature = [(12 * x - 6) / length**2, (6 * x - 4) / length]
    curvature += [(6 - 12 * x) / length**2, (6 * x - 2) / length]
    second, first, itself = _legendre(x, 2, bubbles + 2)
    w += list(itself * length**2)
    slope += list(first * length)
    curvature += list(second)
    return np.array(w), np.array(slope), np.array(curvature)


def _strains(x: FloatArray, length: float, bubbles: int) -> tuple[FloatArray, FloatArray]:
    """Return the strains and their derivatives (functions, points)."""
    strain, change = [1 - x, x], [-np.ones_like(x) / length, np.ones_like(x) / length]
    change_of, of, _ = _legendre(x, 1, bubbles + 2)
    strain += list(of * length)
    change += list(change_of)
    return np.array(strain), np.array(change)


def _legendre(x: FloatArray, lowest: int, end: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Legendre polynomials, normalised on 0 to 1, their integral from 0 and its integral.

    Of the degrees from `lowest` on and below `end`, each (degrees, points). The integral of P_n is
    (P_n+1 - P_n-1) / (2n + 1); the second integral vanishes at both ends from degree 2 on.
    """
    n = np.arange(lowest, end)
    table = np.polynomial.legendre.legvander(2 * x - 1, end + 1).T
    lower, below, here, above, upper = (table[np.maximum(n + k, 0)] for k in (-2, -1, 0, 1, 2))
    n = n[:, None]
    size = np.sqrt(2 * n + 1)
    once = (above - below) / (2 * size)
    twice = ((upper - here) / (2 * n + 3) - (here - lower) / (2 * n - 1)) / (4 * size)
    return size * here, once, twice
