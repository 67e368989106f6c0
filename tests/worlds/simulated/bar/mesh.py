"""Nodes of a bar (where its section changes, at special places, crowded towards thin layers), and
its element: two-node Timoshenko with exact static shape functions, in tension.

J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), 5.6, 11.3 and 15.2; A. W. Friedman
and J. B. Kosmatka, An improved two-node Timoshenko beam finite element, Computers & Structures 47
(1993). Without shear it is the Hermite element.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from shm.values import FloatArray, IntArray
from tests.worlds.simulated.bar.description import Bar

_SAME = 1e-7  # of the length: edges so close are one
# Elements much shorter than the rest would drown the tension in the rounding of their stiffness.
_APART = 1 / 4000  # of the length: a place closer to a node has none of its own
_ELEMENTS_A_LAYER = 8
_GROWTH = 1.7
_TABLE = 2001


@dataclass(frozen=True, eq=False)
class Mesh:
    """Nodes on the bar's axis (nodes,) and, of each element, factors of bending stiffness (planes,
    elements) and mass (elements,).
    """

    nodes_m: FloatArray
    stiffness_factor: FloatArray
    mass_factor: FloatArray

    @property
    def size_m(self) -> FloatArray:
        return np.diff(self.nodes_m)


def mesh_of(bar: Bar, places_m: Sequence[float], elements: int) -> Mesh:
    """About `elements` elements, with nodes at all edges and, as far as may be, at the places.

    More of them where a string-like bar bends in thin layers.
    """
    nodes = _filled(_special(bar, places_m, elements), bar, elements)
    middle = (nodes[1:] + nodes[:-1]) / 2
    stiffness, mass = np.ones((2, len(middle))), np.ones_like(middle)
    for each in bar.stretches:
        inside = (each.start_m < middle) & (middle < each.end_m)
        stiffness[:, inside] *= np.array(each.stiffness_factor)[:, None]
        mass[inside] *= each.mass_factor
    for profile in bar.profiles:
        stiffness *= [
            _between(profile.x_m, own, middle)
            for own in zip(*profile.stiffness_factor, strict=True)
        ]
        mass *= _between(profile.x_m, profile.mass_factor, middle)
    return Mesh(nodes, stiffness, mass)


def _between(x_m: Sequence[float], factor: Sequence[float], places_m: FloatArray) -> FloatArray:
    return np.asarray(np.interp(places_m, x_m, factor, left=1.0, right=1.0))


def interpolation(nodes_m: FloatArray, x_m: FloatArray) -> tuple[IntArray, FloatArray]:
    """The element (points,) of places on the bar, and what they move (4, points) with its ends'
    deflection and rotation: exact at nodes, cubic between.
    """
    element = np.clip(np.searchsorted(nodes_m, x_m) - 1, 0, len(nodes_m) - 2)
    size = np.diff(nodes_m)[element]
    s = (x_m - nodes_m[element]) / size
    weights = [
        1 - 3 * s**2 + 2 * s**3,
        size * (s - 2 * s**2 + s**3),
        3 * s**2 - 2 * s**3,
        size * (s**3 - s**2),
    ]
    return element, np.array(weights)


def slopes(nodes_m: FloatArray, x_m: float) -> tuple[int, FloatArray]:
    """The element of a place on the bar, and the bar's slope there (4,) with its ends' deflection
    and rotation.
    """
    element = int(np.clip(np.searchsorted(nodes_m, x_m) - 1, 0, len(nodes_m) - 2))
    size = nodes_m[element + 1] - nodes_m[element]
    s = (x_m - nodes_m[element]) / size
    bent = (6 * s**2 - 6 * s) / size
    return element, np.array([bent, 1 - 4 * s + 3 * s**2, -bent, 3 * s**2 - 2 * s])


def _special(bar: Bar, places_m: Sequence[float], elements: int) -> list[float]:
    """Ends, edges and, where they keep their distance, all places within, sorted."""
    length, layer = bar.length_m, _layer_m(bar)
    found = [bar.deck_end_m, bar.arch_end_m]
    edges = [edge for each in bar.stretches for edge in (each.start_m, each.end_m)]
    edges += [place for profile in bar.profiles for place in profile.x_m]
    points = [mass.x_m for mass in bar.masses] + [spring.x_m for spring in bar.springs]
    points += [each.x_m for each in bar.attached]
    bends = [x_m + step for x_m in points for step in _steps(layer, length / elements)]
    for wanted, apart in (
        (edges, _SAME * length),
        (points, _APART * length),
        (bends, layer / 4),
        (places_m, _APART * length),
    ):
        for place in wanted:
            inside = bar.deck_end_m < place < bar.arch_end_m
            if inside and min(abs(place - other) for other in found) > apart:
                found.append(place)
    return sorted(found)


def _steps(layer_m: float, spacing_m: float) -> list[float]:
    """Distances from a point, to both sides, at which a thin layer about it wants nodes."""
    steps, step = [], layer_m / 2
    while step < spacing_m:
        steps += [step, -step]
        step *= _GROWTH
    return steps


def _filled(special: Sequence[float], bar: Bar, elements: int) -> FloatArray:
    """Nodes between the special ones, evenly spaced but for the thin layers at the ends.

    The spacing goes over from even to that of `x = L sin(angle)^2` as far as it must.
    """
    share = np.linspace(0, 1, _TABLE)
    crowded = max(0.0, 1 - _layer_m(bar) * elements / (_ELEMENTS_A_LAYER * bar.length_m))
    place = (1 - crowded) * share + crowded * np.sin(np.pi / 2 * share) ** 2
    place = bar.deck_end_m + bar.length_m * place
    nodes = []
    for begin, end in pairwise(special):
        first, last = np.interp([begin, end], place, share)
        count = max(1, math.ceil(elements * (last - first)))
        inner = np.interp(np.linspace(first, last, count + 1)[1:-1], share, place)
        nodes += [[begin], inner]
    return np.concatenate([*nodes, [special[-1]]])


def _layer_m(bar: Bar) -> float:
    """How far from ends, masses and springs a string-like bar bends: sqrt(EI/T)."""
    if bar.tension_n <= 0:
        return math.inf
    return math.sqrt(min(bar.bending_stiffness_n_m2) / bar.tension_n)


# The matrices of both books over deflection, rotation, deflection, rotation, for an element of size
# 1: without shear, then what phi = 12 EI/(kappa G A h^2) and its square add.
_DIFFERENCE = np.array([[1, 0, -1, 0], [0, 0, 0, 0], [-1, 0, 1, 0], [0, 0, 0, 0]], float)
_TWIST = np.array([[0, 0, 0, 0], [0, 1, 0, -1], [0, 0, 0, 0], [0, -1, 0, 1]], float)
_BENDING = (
    np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], float),
    _TWIST,
)
_SLOPES = (
    np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]) / 30,
    2 * _DIFFERENCE + _TWIST / 6,
    _DIFFERENCE + _TWIST / 12,
)
_DEFLECTIONS = tuple(
    np.array(rows) / 420
    for rows in (
        [[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]],
        [[294, 38.5, 126, -31.5], [38.5, 7, 31.5, -7],
         [126, 31.5, 294, -38.5], [-31.5, -7, -38.5, 7]],
        [[140, 17.5, 70, -17.5], [17.5, 3.5, 17.5, -3.5],
         [70, 17.5, 140, -17.5], [-17.5, -3.5, -17.5, 3.5]],
    )
)  # fmt: skip
_ROTATIONS = (
    _SLOPES[0],
    np.array([[0, -15, 0, -15], [-15, 5, 15, -5], [0, 15, 0, 15], [-15, -5, 15, 5]]) / 30,
    np.array([[0, 0, 0, 0], [0, 10, 0, 5], [0, 0, 0, 0], [0, 5, 0, 10]]) / 30,
)
_AREA = np.array([1 / 2, 1 / 12, 1 / 2, -1 / 12])


def stiffness_of(
    size_m: FloatArray, bending_n_m2: FloatArray, shear_compliance_1_n: float, tension_n: float
) -> FloatArray:
    """Stiffness (elements, 4, 4) over deflection, rotation, deflection, rotation."""
    phi = 12 * bending_n_m2 * shear_compliance_1_n / size_m**2
    bent = _elements(bending_n_m2 / size_m**3 / (1 + phi), _BENDING, phi, size_m)
    return bent + _elements(tension_n / size_m / (1 + phi) ** 2, _SLOPES, phi, size_m)


def mass_of(
    size_m: FloatArray,
    bending_n_m2: FloatArray,
    shear_compliance_1_n: float,
    mass_per_length_kg_m: FloatArray,
    rotary_inertia_kg_m: float,
) -> FloatArray:
    """Consistent mass with rotary inertia, (elements, 4, 4)."""
    phi = 12 * bending_n_m2 * shear_compliance_1_n / size_m**2
    scale = 1 / (1 + phi) ** 2
    moved = _elements(mass_per_length_kg_m * size_m * scale, _DEFLECTIONS, phi, size_m)
    if rotary_inertia_kg_m == 0:
        return moved
    return moved + _elements(rotary_inertia_kg_m / size_m * scale, _ROTATIONS, phi, size_m)


def load_of(size_m: FloatArray) -> FloatArray:
    """The integral of the deflection, (elements, 4); shear does not change it."""
    one = np.ones_like(size_m)
    return np.asarray(_AREA * size_m[:, None] * np.stack([one, size_m, one, size_m], axis=1))


def _elements(
    scale: FloatArray, patterns: Sequence[FloatArray], phi: FloatArray, size_m: FloatArray
) -> FloatArray:
    """Element matrices (elements, 4, 4) of patterns by powers of phi, rotations times the size."""
    one = np.ones_like(size_m)
    lengths = np.stack([one, size_m, one, size_m], axis=1)
    pattern = sum(phi[:, None, None] ** power * each for power, each in enumerate(patterns))
    return np.asarray(scale[:, None, None] * pattern * lengths[:, :, None] * lengths[:, None, :])


def assembled(elements: FloatArray) -> Any:
    """The sparse matrix (2 nodes, 2 nodes) of element matrices (elements, 4, 4) along a bar."""
    count = len(elements)
    unknowns = 2 * np.arange(count)[:, None] + np.arange(4)
    rows = np.broadcast_to(unknowns[:, :, None], elements.shape).ravel()
    columns = np.broadcast_to(unknowns[:, None, :], elements.shape).ravel()
    return scipy.sparse.csc_array(
        (elements.ravel(), (rows, columns)), shape=(2 * count + 2, 2 * count + 2)
    )
