"""Natural frequencies and shapes of one plane of a hanger with something wrong, by Hermite beams.

The physics of `gapped_hangers.py`. Nothing is shared with the program under test.

x counts from the deck end. The unknowns of a node are its deflection w and the rotation r of its
section; those of an element the shear strain g at both its ends, linear in between. So the slope
w' = r + g may jump where the section does, and nothing locks as the shear stiffness grows. w is the
cubic of Hermite on w and w'. Bending energy EI (r')^2, shear energy k G A g^2, the tension works
on the slope of the axis (T w'^2), inertia m w'^2 and rho I r'^2 in time. Strands have no shear.

* The tension is that at mid-length; it grows upwards by the weight of what hangs below.
* Across a leaning bar the weight makes it sag: the static curve y under bending and tension on the
  same mesh. A mode w then stretches the bar by the integral of y' w', which the bar's and its
  supports' axial stiffness in series resists (the linear theory of Irvine, 1981).
* Stretches of another bending stiffness, mass and area; point masses; springs to the ground;
  cracks (a rotational spring between two halves); an absorber (a mass on a spring); a neighbour
  (a second bar, joined by a spring).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_factor, cho_solve
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import LinearOperator, eigsh

Array = NDArray[np.float64]

EVEN = 0.05
"""Changes of the bending stiffness up to this bend the bar too little for a finer mesh."""
CLOSEST = 3e-4
"""Nodes are no closer than this fraction of the length: rounding grows with its inverse cube."""


@dataclass(frozen=True)
class Stretch:
    """A part of the bar whose stiffness, mass and area are so many times the bar's."""

    start_m: float
    end_m: float
    bending: float = 1.0
    mass: float = 1.0
    area: float = 1.0


@dataclass(frozen=True)
class Bar:
    """One plane of a hanger as it is. Infinite stiffness is a constraint."""

    length_m: float
    tension_n: float
    bending_n_m2: float
    mass_kg_m: float
    shear_n: float = math.inf  # shear coefficient x G x A
    rotary_kg_m: float = 0.0  # density x second moment
    axial_n: float = math.inf  # E A
    stretches: tuple[Stretch, ...] = ()
    rotation_n_m: tuple[float, float] = (math.inf, math.inf)  # per rad; deck, arch
    lateral_n_m: tuple[float, float] = (math.inf, math.inf)
    supports_axial_n_m: float = math.inf  # both in series
    masses: tuple[tuple[float, float], ...] = ()  # (x_m, kg)
    springs: tuple[tuple[float, float], ...] = ()  # (x_m, N/m)
    cracks: tuple[tuple[float, float], ...] = ()  # (x_m, N m/rad)
    absorbers: tuple[tuple[float, float, float], ...] = ()  # (x_m, kg, Hz by itself)
    neighbour: Bar | None = None
    clamp: tuple[float, float] = (0.0, 0.0)  # to the neighbour: (x_m, N/m)
    gravity_along_m_s2: float = 0.0
    gravity_across_m_s2: float = 0.0


@dataclass(frozen=True)
class Modes:
    """Modes of one plane: `shapes` holds the deflections, a row a place that was asked for.

    They are normalised to a modal mass of 1 kg. `tension_share` is d ln f / d ln T.
    """

    frequencies_hz: Array
    shapes: Array
    tension_share: Array


def place_nodes(bar: Bar, places: tuple[float, ...], elements: int) -> Array:
    """Return the nodes: even, and closer where bending decays away from an end or an edge."""
    size, closest = bar.length_m / elements, CLOSEST * bar.length_m
    sharp = [each for each in bar.stretches if abs(each.bending - 1) > EVEN]
    edges = [x for each in sharp for x in (each.start_m, each.end_m)]
    points = [each[0] for each in (*bar.cracks, *bar.masses, *bar.springs, *bar.absorbers)]
    points += [*places, *((bar.clamp[0],) if bar.neighbour else ())]
    points += [x for each in bar.stretches for x in (each.start_m, each.end_m)]
    if bar.tension_n > 0:
        layer = math.sqrt(bar.bending_n_m2 / bar.tension_n)
        near = [step * layer for step in (0.5, 1.0, 1.7, 2.7, 4.0, 6.0) if step * layer < size]
        around = [0.0, bar.length_m, *edges, *(x for x, _ in bar.cracks)]
        points += [x + sign * d for x in around for d in near for sign in (-1, 1)]
    stations = [0.0, bar.length_m]
    for x in (*edges, *points):  # the first of two that all but meet stays
        if 0 < x < bar.length_m and min(abs(x - other) for other in stations) > closest:
            stations.append(x)
    nodes = [0.0]
    for start, end in pairwise(sorted(stations)):
        parts = math.ceil((end - start) / size)
        nodes.extend(start + (end - start) * i / parts for i in range(1, parts + 1))
    return np.array(nodes)


@dataclass(frozen=True)
class _Matrices:
    x: Array
    stiffness: Array
    mass: Array
    slope: Array  # integral of N' N'^T
    free: NDArray[np.intp]

    def node(self, x: float) -> int:
        """Return the row of the deflection at a place, among all unknowns."""
        return 2 * int(np.argmin(np.abs(self.x - x)))


def _assemble(bar: Bar, x: Array) -> _Matrices:
    """Assemble one bar with its ends, masses, springs, cracks and sag."""
    h, middle, count = np.diff(x), (x[:-1] + x[1:]) / 2, len(x) - 1
    bending, mass, area = np.ones(count), np.ones(count), np.ones(count)
    for each in bar.stretches:
        inside = (middle > each.start_m) & (middle < each.end_m)
        bending[inside] *= each.bending
        mass[inside] *= each.mass
        area[inside] *= each.area
    sheared = math.isfinite(bar.shear_n)

    points, weights = np.polynomial.legendre.leggauss(5)
    s, hh = (points[None, :] + 1) / 2, h[:, None]
    one, none = np.ones((count, 5)), np.zeros((count, 5))

    def stack(*rows: Array) -> Array:
        return np.stack([row * one for row in rows], axis=-1)

    start, end = hh * (s - 2 * s**2 + s**3), hh * (s**3 - s**2)
    w = stack(1 - 3 * s**2 + 2 * s**3, start, 3 * s**2 - 2 * s**3, end, start, end)
    start, end = 1 - 4 * s + 3 * s**2, 3 * s**2 - 2 * s
    slope = stack(6 * (s**2 - s) / hh, start, 6 * (s - s**2) / hh, end, start, end)
    start, end = (6 * s - 4) / hh, (6 * s - 2) / hh
    curve = stack(6 * (2 * s - 1) / hh**2, start, 6 * (1 - 2 * s) / hh**2, end, start, end)
    strain = stack(none, none, none, none, 1 - s, s)
    strain_slope = stack(none, none, none, none, -1 / hh, 1 / hh)
    kept = 6 if sheared else 4
    measure = hh * weights[None, :] / 2

    def gram(shape: Array, factor: Array) -> Array:
        cut = shape[..., :kept]
        found: Array = np.einsum("eq,eqi,eqj->eij", measure * factor, cut, cut)
        return found

    per_length = mass * bar.mass_kg_m
    hanging = np.concatenate(([0.0], np.cumsum(per_length * h)))
    at = x[:-1, None] + hh * s
    below = np.interp(at, x, hanging) - np.interp(bar.length_m / 2, x, hanging)
    tension = bar.tension_n + bar.gravity_along_m_s2 * below
    rotation = slope - strain
    stiff = gram(curve - strain_slope, bending[:, None] * bar.bending_n_m2) + gram(slope, tension)
    if sheared:
        stiff += gram(strain, area[:, None] * bar.shear_n)
    inert = gram(w, per_length[:, None]) + gram(rotation, bending[:, None] * bar.rotary_kg_m)
    unit = gram(slope, np.ones((1, 1)))

    # Unknowns: w and r of each node, g at both ends of each element, one r more at a crack.
    size = 2 * (count + 1) + (2 * count if sheared else 0)
    index = 2 * np.arange(count)[:, None] + np.arange(4)
    if sheared:
        inner = 2 * (count + 1) + 2 * np.arange(count)[:, None] + np.arange(2)
        index = np.hstack((index, inner))
    total = size + len(bar.cracks)
    jumps = []
    for extra, (place, k) in enumerate(bar.cracks):
        node = int(np.argmin(np.abs(x - place)))
        index[node, 1] = size + extra  # the element above has a rotation of its own
        jumps.append((2 * node + 1, size + extra, k))
    stiffness, inertia, gradient = (np.zeros((total, total)) for _ in range(3))
    for matrix, parts in ((stiffness, stiff), (inertia, inert), (gradient, unit)):
        np.add.at(matrix, (index[:, :, None], index[:, None, :]), parts)
    for below_crack, above, k in jumps:
        stiffness[below_crack, below_crack] += k
        stiffness[above, above] += k
        stiffness[below_crack, above] -= k
        stiffness[above, below_crack] -= k

    fixed = []
    for node, lateral, turning in zip((0, count), bar.lateral_n_m, bar.rotation_n_m, strict=True):
        for unknown, k in ((2 * node, lateral), (2 * node + 1, turning)):
            if math.isinf(k):
                fixed.append(unknown)
            else:
                stiffness[unknown, unknown] += k
    free = np.setdiff1d(np.arange(total), fixed)
    found = _Matrices(x, stiffness, inertia, gradient, free)
    for place, kilograms in bar.masses:
        inertia[found.node(place), found.node(place)] += kilograms
    for place, k in bar.springs:
        stiffness[found.node(place), found.node(place)] += k
    if bar.gravity_across_m_s2:
        load = np.zeros(total)
        pull = np.einsum("eq,eqi->ei", measure * per_length[:, None], w[..., :kept])
        np.add.at(load, index, pull * bar.gravity_across_m_s2)
        sag, cut = np.zeros(total), np.ix_(free, free)
        sag[free] = np.linalg.solve(stiffness[cut], load[free])
        stretching = gradient @ sag
        give = float(np.sum(h / (area * bar.axial_n))) + 1 / bar.supports_axial_n_m
        if give > 0:
            stiffness += np.outer(stretching, stretching) / give
    return found


def _find_lowest(stiffness: Array, mass: Array, count: int) -> tuple[Array, Array]:
    """Return the lowest squares of angular frequencies, and their shapes of unit modal mass."""
    factor, size = cho_factor(stiffness, check_finite=False), len(mass)

    def solve(force: Array) -> Array:
        return np.asarray(cho_solve(factor, force, check_finite=False))

    values, vectors = eigsh(
        *(csr_matrix(stiffness), count, csr_matrix(mass)),
        sigma=0.0,
        OPinv=LinearOperator((size, size), matvec=solve, dtype=np.float64),
        v0=np.ones(size) + np.arange(size) / size,  # the same result every time
    )
    order = np.argsort(values)
    return values[order], vectors[:, order]


def solve_modes(bar: Bar, count: int, places: tuple[float, ...] = (), elements: int = 90) -> Modes:
    """Return the first `count` modes of one plane of a hanger, with the deflection at places.

    With absorbers or a neighbour there are more modes than the bar has: returned are those whose
    motion of the bar is most like each of its modes without them, in that order.
    """
    x = place_nodes(bar, places, elements)
    parts = _assemble(bar, x)
    if bar.absorbers or bar.neighbour is not None:
        return _solve_joined(bar, parts, count, places)
    cut = np.ix_(parts.free, parts.free)
    values, vectors = _find_lowest(parts.stiffness[cut], parts.mass[cut], count)
    shapes = np.zeros((len(parts.mass), count))
    shapes[parts.free] = vectors
    return _as_modes(bar, parts, values, shapes, places)


def _as_modes(
    bar: Bar, parts: _Matrices, values: Array, shapes: Array, places: tuple[float, ...]
) -> Modes:
    share = bar.tension_n * np.einsum("in,ij,jn->n", shapes, parts.slope, shapes) / (2 * values)
    rows = [parts.node(place) for place in places]
    return Modes(np.sqrt(values) / (2 * math.pi), shapes[rows], share)


def _solve_joined(bar: Bar, parts: _Matrices, count: int, places: tuple[float, ...]) -> Modes:
    stiffness, mass, free = parts.stiffness, parts.mass, list(parts.free)
    joints: list[tuple[int, int, float]] = []
    for place, kilograms, frequency_hz in bar.absorbers:
        joints.append((parts.node(place), len(mass), kilograms * (2 * math.pi * frequency_hz) ** 2))
        free.append(len(mass))
        stiffness, mass = (
            block_diag(stiffness, np.zeros((1, 1))),
            block_diag(mass, np.full((1, 1), kilograms)),
        )
    if bar.neighbour is not None:
        place, k = bar.clamp
        other = _assemble(bar.neighbour, place_nodes(bar.neighbour, (place,), len(parts.x)))
        joints.append((parts.node(place), len(mass) + other.node(place), k))
        free.extend(int(i) + len(mass) for i in other.free)
        stiffness, mass = block_diag(stiffness, other.stiffness), block_diag(mass, other.mass)
    for one, two, k in joints:
        for i, j, sign in ((one, one, 1), (two, two, 1), (one, two, -1), (two, one, -1)):
            stiffness[i, j] += sign * k
    cut, own = np.ix_(free, free), len(parts.mass)
    most = 2 * count + 4
    values, vectors = _find_lowest(stiffness[cut], mass[cut], most)
    shapes = np.zeros((len(mass), most))
    shapes[free] = vectors
    alone = replace(bar, absorbers=(), neighbour=None)
    bare = _assemble(alone, parts.x)
    inside = np.ix_(bare.free, bare.free)
    _, vectors = _find_lowest(bare.stiffness[inside], bare.mass[inside], count)
    plain = np.zeros((own, count))
    plain[bare.free] = vectors
    likeness = (plain.T @ parts.mass @ shapes[:own]) ** 2
    chosen: list[int] = []
    for row in likeness:
        row[chosen] = -1.0
        chosen.append(int(np.argmax(row)))
    return _as_modes(bar, parts, values[chosen], shapes[:own, chosen], places)
