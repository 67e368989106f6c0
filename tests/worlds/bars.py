"""Bars under tension: the one solver of all worlds. Nothing is shared with the program under test.

One plane, x from the deck end. `test_bars.py` holds it against closed forms and another route.

* Timoshenko bending and rotary inertia (Phil. Mag. 41, 1921); strands have no shear. The deflection
  is w = b + s: b' is the rotation of the section and s' the shear strain, so that nothing locks.
  b is C1 (Hermite cubic plus bubbles from Legendre polynomials integrated twice), s is C0 (Szabo
  and Babuska, Finite Element Analysis, 1991), both of degree 8, 1e-7 with one element a half wave.
* The tension works on the slope of the axis, T w'^2/2 (Engesser). It is that at mid-length, and
  grows upwards by the weight of what hangs below.
* Across a leaning bar the weight makes it sag: the static curve y under bending and tension. A mode
  stretches the bar by the integral of y' w', which the bar's and its supports' axial stiffness in
  series resists (Irvine, Cable Structures, 1981).
* Zones of another bending stiffness, mass and area (forks, sockets, plates, turnbuckles, rust);
  point masses; springs to the ground; cracks (a rotational spring between two halves); absorbers
  (a mass on a spring); a neighbour (a second bar, joined by a spring).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh

Array = NDArray[np.float64]
GRAVITY_M_S2 = 9.81
POISSON = 0.3  # EN 1993-1-1, 3.2.6
DEGREE = 8
INNER_BENDING, INNER_SHEAR = DEGREE - 3, DEGREE - 1
EVEN = 0.05
"""Changes of the bending stiffness up to this bend the bar too little for a finer mesh."""
CLOSEST = 3e-4
"""Points have nodes no closer than this fraction of the length, for the sake of rounding."""
SAME = 1e-5
"""Edges of zones so close, as a fraction of the length, are one."""


def cowper(inner_over_outer: float = 0.0) -> float:
    """Return the shear coefficient of a round tube; 0 is the solid bar (Cowper, 1966)."""
    square = inner_over_outer**2
    upper = 6 * (1 + POISSON) * (1 + square) ** 2
    return upper / ((7 + 6 * POISSON) * (1 + square) ** 2 + (20 + 12 * POISSON) * square)


@dataclass(frozen=True)
class Zone:
    """A part of the bar, by factors on the bar's values; without `area_factor` it is the mass's.

    Shear and axial stiffness follow the area, rotary inertia the bending stiffness.
    """

    start_m: float
    end_m: float
    bending_factor: float = 1.0
    mass_factor: float = 1.0
    area_factor: float | None = None


@dataclass(frozen=True)
class Bar:
    """One plane of a hanger as it really is. Infinite stiffness is a constraint."""

    length_m: float
    tension_n: float  # at mid-length
    bending_stiffness_n_m2: float
    mass_per_length_kg_m: float
    shear_stiffness_n: float = math.inf  # coefficient x G x A
    rotary_inertia_kg_m: float = 0.0  # density x second moment
    axial_stiffness_n: float = math.inf  # E A, for the stretching by sag
    zones: tuple[Zone, ...] = ()
    masses: tuple[tuple[float, float], ...] = ()  # (place_m, mass_kg)
    rotation_n_m_rad: tuple[float, float] = (0.0, 0.0)  # (deck, arch)
    lateral_n_m: tuple[float, float] = (math.inf, math.inf)
    axial_n_m: tuple[float, float] = (math.inf, math.inf)
    gravity_along_m_s2: float = 0.0  # towards the deck end
    gravity_across_m_s2: float = 0.0  # in this plane
    springs: tuple[tuple[float, float], ...] = ()  # (place_m, N/m)
    cracks: tuple[tuple[float, float], ...] = ()  # (place_m, N m/rad)
    absorbers: tuple[tuple[float, float, float], ...] = ()  # (place_m, kg, Hz by itself)
    neighbour: Bar | None = None
    clamp: tuple[float, float] = (0.0, 0.0)  # to the neighbour: (place_m, N/m)


@dataclass(frozen=True)
class Modes:
    """Modes of one plane: `shapes` holds the deflections, a row a place that was asked for.

    They are normalised to a modal mass of 1 kg and negative next to the deck. `tension_share` is
    d ln f / d ln T.
    """

    frequencies_hz: Array
    shapes: Array
    tension_share: Array


@cache
def _polynomials() -> tuple[Array, Array]:
    """Return the Legendre coefficients of the shape functions of b and of s, on -1..1.

    The first four of b are those of a unit deflection and slope at either end, in that coordinate.
    """
    hermite = ([2, -3, 0, 1], [1, -1, -1, 1], [2, 3, 0, -1], [-1, -1, 1, 1])
    bending = [legendre.poly2leg(c) / 4 for c in hermite]
    bending += [legendre.legint(np.eye(j + 1)[j], m=2, lbnd=-1) for j in range(2, DEGREE - 1)]
    shear = [np.array([0.5, -0.5]), np.array([0.5, 0.5])]
    shear += [legendre.legint(np.eye(j + 1)[j], lbnd=-1) for j in range(1, DEGREE)]

    def padded(rows: list[Array]) -> Array:
        return np.array([np.pad(row, (0, DEGREE + 1 - len(row))) for row in rows])

    return padded(bending), padded(shear)


@cache
def _integrals(with_shear: bool) -> dict[str, Array]:
    """Return the integrals of products of the shape functions, b's first, over -1..1."""
    bending, shear = _polynomials()
    point, weight = legendre.leggauss(DEGREE + 2)  # exact to degree 19; 17 is needed

    def values(order: int, b: float = 1.0, s: float = 1.0) -> Array:
        rows = [(b, bending), (s, shear)] if with_shear else [(b, bending)]
        return np.vstack(
            [on * legendre.legval(point, legendre.legder(c, order, axis=1).T) for on, c in rows]
        )

    def gram(rows: Array, factor: Array | float = 1.0) -> Array:
        return np.asarray((rows * (weight * factor)) @ rows.T)

    return {
        "curvature": gram(values(2, s=0.0)),
        "rotation": gram(values(1, s=0.0)),
        "strain": gram(values(1, b=0.0)),
        "slope": gram(values(1)),
        "slope_x": gram(values(1), point),
        "deflection": gram(values(0)),
        "area": (values(0) @ weight)[:, None],
    }


def mesh(bar: Bar, marks: Sequence[float] = (), elements: int = 8) -> Array:
    """Return the nodes: even, and closer where bending decays away from an end or an edge."""
    size, length = bar.length_m / elements, bar.length_m
    edges = [x for zone in bar.zones for x in (zone.start_m, zone.end_m)]
    sharp = [zone for zone in bar.zones if abs(zone.bending_factor - 1) > EVEN]
    around = [0.0, length, *(x for zone in sharp for x in (zone.start_m, zone.end_m))]
    around += [x for x, _ in bar.cracks]
    points = [each[0] for each in (*bar.cracks, *bar.masses, *bar.springs, *bar.absorbers)]
    points += [*marks, *((bar.clamp[0],) if bar.neighbour else ())]
    layers: list[float] = []
    if bar.tension_n > 0:
        layer = 5 * math.sqrt(bar.bending_stiffness_n_m2 / bar.tension_n)
        layers = [x + sign * layer for x in around for sign in (-1, 1)] if layer < size else []
    stations = [0.0, length]
    for wanted, apart in ((edges, SAME), (points, CLOSEST), (layers, CLOSEST)):
        for x in wanted:  # the first of two that all but meet stays
            if 0 < x < length and min(abs(x - other) for other in stations) > apart * length:
                stations.append(x)
    nodes = [0.0]
    for start, end in pairwise(sorted(stations)):
        parts = max(1, math.ceil((end - start) / size - 1e-9))
        nodes.extend(start + (end - start) * i / parts for i in range(1, parts + 1))
    return np.array(nodes)


class Matrices:
    """Stiffness in its parts, mass and rows of a bar, over its free unknowns.

    `bending` is that of the bar, `zone_bending` that of zones stiffer than it; `pull` is a tension
    of 1 N, `weight` what the tension grows by, `held` the springs to the ground and in cracks,
    `coating` a mass of 1 kg/m, `area` the integral of the deflection, `load` the weight across. The
    rows `turns` give the rotations of both ends, 0 where they are clamped.
    """

    def __init__(self, bar: Bar, marks: Sequence[float] = (), elements: int = 8) -> None:
        """Assemble the bar on about so many elements, with nodes at the marks."""
        self.bar, self.x = bar, mesh(bar, marks, elements)
        self._sheared = math.isfinite(bar.shear_stiffness_n)
        table = _integrals(self._sheared)
        h, middle = np.diff(self.x), (self.x[:-1] + self.x[1:]) / 2
        bending, mass, area = np.ones_like(h), np.ones_like(h), np.ones_like(h)
        fitted = np.zeros(len(h), bool)
        for zone in bar.zones:
            inside = (middle > zone.start_m) & (middle < zone.end_m)
            bending[inside] *= zone.bending_factor
            mass[inside] *= zone.mass_factor
            area[inside] *= zone.mass_factor if zone.area_factor is None else zone.area_factor
            fitted |= inside & (zone.bending_factor > 1)
        self._index(len(h))
        half = h / 2
        per_m = mass * bar.mass_per_length_kg_m
        below = np.concatenate(([0.0], np.cumsum(per_m * h)))
        hanging = np.interp(middle, self.x, below) - np.interp(bar.length_m / 2, self.x, below)
        bend = bending * bar.bending_stiffness_n_m2 / half**3
        self._half = half
        self.bending = self._add((bend * ~fitted, table["curvature"]))
        self.zone_bending = self._add((bend * fitted, table["curvature"]))
        shear = area * bar.shear_stiffness_n / half if self._sheared else 0 * half
        self.shear = self._add((shear, table["strain"]))
        self.pull = self._add((1 / half, table["slope"]))
        g = bar.gravity_along_m_s2
        self.weight = self._add((g * hanging / half, table["slope"]), (g * per_m, table["slope_x"]))
        self.mass = self._add(
            (per_m * half, table["deflection"]),
            (bending * bar.rotary_inertia_kg_m / half, table["rotation"]),
        )
        self.coating = self._add((half, table["deflection"]))
        self.area = self._vector(half * table["area"])
        self.load = bar.gravity_across_m_s2 * self._vector(per_m * half * table["area"])
        self.give_m_n = float(np.sum(h / (area * bar.axial_stiffness_n)))
        self.give_m_n += sum(1 / k for k in bar.axial_n_m)
        picks = np.eye(self._size)[[1, 3 * len(h) + 1]]
        self.turns = np.array([self._reduced(row) for row in picks])
        self.held = np.zeros_like(self.pull)
        for place, k in (*bar.springs, *zip((0.0, bar.length_m), bar.lateral_n_m, strict=True)):
            if math.isfinite(k):
                self.held += k * np.outer(*2 * (self.row(place),))
        for jump, k in zip(self._jumps, (k for _, k in bar.cracks), strict=True):
            self.held += k * np.outer(*2 * (self._reduced(jump),))
        for place, kg in bar.masses:
            self.mass += kg * np.outer(*2 * (self.row(place),))

    def _index(self, count: int) -> None:
        """Number the unknowns: b, b' and s of each node, then the inner ones, then at cracks."""
        node = 3 * np.arange(count)[:, None]
        inner = INNER_BENDING + INNER_SHEAR
        own = 3 * (count + 1) + inner * np.arange(count)[:, None] + np.arange(inner)
        parts = [node + np.array([0, 1, 3, 4]), own[:, :INNER_BENDING]]
        if self._sheared:
            parts += [node + np.array([2, 5]), own[:, INNER_BENDING:]]
        self._where = np.hstack(parts)
        regular = 3 * (count + 1) + inner * count
        self._size = regular + len(self.bar.cracks)
        self._jumps = np.zeros((len(self.bar.cracks), self._size))
        for extra, (place, _) in enumerate(self.bar.cracks):
            at = int(np.argmin(np.abs(self.x - place)))
            self._where[at, 1] = regular + extra  # the element above has a rotation of its own
            self._jumps[extra, [3 * at + 1, regular + extra]] = 1.0, -1.0
        # No s at the deck: it settles how a constant is shared between b and s.
        self._free = np.zeros(self._size, bool)
        self._free[self._where.ravel()] = True
        self._free[2] = False
        (deck, arch), turned = self.bar.lateral_n_m, self.bar.rotation_n_m_rad
        self._free[0] = self._free[0] and math.isfinite(deck)
        self._tied = math.isinf(arch)  # b + s = 0 at the arch
        self._free[3 * count] = not self._tied
        for unknown, k in zip((1, 3 * count + 1), turned, strict=True):
            self._free[unknown] = math.isfinite(k)

    def _scaled(self, blocks: Array) -> Array:
        blocks[:, [1, 3]] *= self._half.reshape(-1, *[1] * (blocks.ndim - 1))
        return blocks

    def _add(self, *parts: tuple[Array, Array]) -> Array:
        blocks = sum(factor[:, None, None] * table for factor, table in parts)
        blocks = self._scaled(self._scaled(np.array(blocks)).transpose(0, 2, 1))
        found = np.zeros((self._size, self._size))
        np.add.at(found, (self._where[:, :, None], self._where[:, None, :]), blocks)
        return self._reduced(self._reduced(found).T)

    def _vector(self, values: Array) -> Array:
        found = np.zeros(self._size)
        np.add.at(found, self._where, self._scaled(values.T.copy()))
        return self._reduced(found)

    def _reduced(self, rows: Array) -> Array:
        """Return rows (..., unknowns) over the free unknowns."""
        if self._tied and self._sheared:
            last = 3 * (len(self.x) - 1)
            rows = rows.copy()
            rows[..., last + 2] -= rows[..., last]
        return np.asarray(rows[..., self._free])

    def rows(self, places_m: Sequence[float] | Array) -> Array:
        """Return the rows (places, unknowns) that give the deflection at places."""
        places = np.asarray(places_m, float)
        at = np.clip(np.searchsorted(self.x, places) - 1, 0, len(self.x) - 2)
        here = (places - self.x[at]) / self._half[at] - 1
        values = [legendre.legval(here, c.T) for c in _polynomials()[: 1 + self._sheared]]
        values = np.vstack(values).T
        values[:, [1, 3]] *= self._half[at][:, None]
        found = np.zeros((len(places), self._size))
        np.add.at(found, (np.arange(len(places))[:, None], self._where[at]), values)
        return self._reduced(found)

    def row(self, place_m: float) -> Array:
        """Return the row that gives the deflection at a place."""
        return np.asarray(self.rows([place_m])[0])

    def stiffness(
        self,
        tension_n: float | None = None,
        springs: Sequence[float] | Array | None = None,
        stiffer: float = 1.0,
    ) -> Array:
        """Return the stiffness at a tension, with rotational springs at the ends, and with sag.

        `stiffer` is a factor on Young's modulus.
        """
        tension = self.bar.tension_n if tension_n is None else tension_n
        turned = np.array(self.bar.rotation_n_m_rad if springs is None else springs)
        found = stiffer * (self.bending + self.zone_bending + self.shear) + self.held
        found += tension * self.pull + self.weight
        found += (self.turns.T * np.where(np.isfinite(turned), turned, 0.0)) @ self.turns
        if self.load.any() and self.give_m_n > 0:
            stretched = self.pull @ np.linalg.solve(found, self.load)
            found += np.outer(stretched, stretched) * stiffer / self.give_m_n
        return np.asarray(found)

    def with_masses(self, masses: Sequence[tuple[float, float]]) -> Array:
        """Return the mass matrix with more point masses (place_m, mass_kg)."""
        found = self.mass.copy()
        for place, kg in masses:
            found += kg * np.outer(*2 * (self.row(place),))
        return found


def solve(stiffness: Array, mass: Array, count: int) -> tuple[Array, Array]:
    """Return the lowest frequencies in Hz and their shapes (unknowns, count) of unit modal mass."""
    # M v = (1/omega^2) K v: the low modes are the large values, the ones that rounding spares.
    size = len(mass)
    inverse, vectors = eigh(
        mass, stiffness, subset_by_index=[size - count, size - 1], check_finite=False
    )
    omega = 1 / np.sqrt(inverse[::-1])
    return omega / (2 * math.pi), np.asarray(vectors[:, ::-1] * omega)


def natural_frequencies_hz(bar: Bar, count: int, elements: int | None = None) -> Array:
    """Return the first `count` natural frequencies of one plane.

    Of its own number of elements they are right to 1e-9; 600 would fill 18 GB.
    """
    matrices = Matrices(bar, elements=elements or max(8, count))
    return solve(matrices.stiffness(), matrices.mass, count)[0]


def solve_modes(
    bar: Bar, count: int, places: Sequence[float] = (), elements: int | None = None
) -> Modes:
    """Return the first `count` modes of one plane of a hanger, with the deflection at places.

    With absorbers or a neighbour there are more modes than the bar has: returned are those whose
    motion of the bar is most like each of its modes without them, in that order.
    """
    matrices = Matrices(bar, elements=elements or max(8, count))
    stiffness, mass = matrices.stiffness(), matrices.mass
    hz, shapes = solve(stiffness, mass, count)
    if bar.absorbers or bar.neighbour is not None:
        hz, shapes = _joined(bar, matrices, stiffness, shapes)
    pulled = np.einsum("in,ij,jn->n", shapes, matrices.pull, shapes)
    share = bar.tension_n * pulled / (2 * (2 * math.pi * hz) ** 2)
    shapes = -shapes * np.sign(matrices.row(0.01 * bar.length_m) @ shapes)
    return Modes(hz, matrices.rows(places) @ shapes, share)


def _joined(bar: Bar, matrices: Matrices, stiffness: Array, alone: Array) -> tuple[Array, Array]:
    """Return frequencies and the bar's share of the shapes, with what is joined to the bar."""
    mass, own = matrices.mass, len(matrices.mass)
    ties: list[tuple[Array, int, Array, float]] = []  # row, first unknown of the other, its row
    for place, kg, hz in bar.absorbers:
        ties.append((matrices.row(place), len(mass), np.ones(1), kg * (2 * math.pi * hz) ** 2))
        stiffness, mass = block_diag(stiffness, 0.0), block_diag(mass, kg)
    if bar.neighbour is not None:
        place, k = bar.clamp
        other = Matrices(bar.neighbour, (place,), len(matrices.x))
        ties.append((matrices.row(place), len(mass), other.row(place), k))
        stiffness = block_diag(stiffness, other.stiffness())
        mass = block_diag(mass, other.mass)
    for row, first, other_row, k in ties:
        apart = np.zeros(len(mass))
        apart[:own], apart[first : first + len(other_row)] = row, -other_row
        stiffness = stiffness + k * np.outer(apart, apart)
    found_hz, shapes = solve(stiffness, mass, 2 * alone.shape[1] + 4)
    likeness = (alone.T @ matrices.mass @ shapes[:own]) ** 2
    chosen: list[int] = []
    for row in likeness:
        row[chosen] = -1.0
        chosen.append(int(np.argmax(row)))
    return found_hz[chosen], shapes[:own, chosen]


# ---------------------------------------------------------------- many states of one bar


def reduced_basis(stiffness: Array, metric: Array, vectors: Sequence[Array]) -> Array:
    """Return a basis, orthonormal in `metric`, of shapes and of the answers to static loads.

    `vectors` are shapes (unknowns, n); the last is loads, answered by `stiffness`.
    """
    raw = np.hstack([*vectors[:-1], np.linalg.solve(stiffness, vectors[-1])])
    raw = raw[:, np.any(raw != 0, axis=0)]
    raw /= np.sqrt(np.einsum("ij,ij->j", raw, metric @ raw))
    values, turn = np.linalg.eigh(raw.T @ metric @ raw)
    keep = values > 1e-11 * values[-1]
    return np.asarray(raw @ (turn[:, keep] / np.sqrt(values[keep])))


def solve_many(stiffness: Array, mass: Array, count: int) -> tuple[Array, Array]:
    """Return frequencies (..., count) in Hz and shapes (..., unknowns, count) of many states."""
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    turned = np.swapaxes(inverse, -1, -2)
    squares, vectors = np.linalg.eigh(inverse @ stiffness @ turned)
    return np.sqrt(squares[..., :count]) / (2 * math.pi), (turned @ vectors)[..., :count]
