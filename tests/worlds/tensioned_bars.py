"""Natural frequencies of a hanger in one plane, by two-node Timoshenko elements under tension.

The physics of `road_bridge_seasons.py`. Nothing is shared with the program under test.

x counts from the deck end. An element has the deflection and the rotation of its two ends; its
shape functions solve the static Timoshenko beam exactly (Friedman and Kosmatka, Computers and
Structures 47, 1993), so that nothing locks. The tension works on the slope of the axis (Engesser).

* The tension given is that at half the length; upwards it grows by the weight of what hangs below
  (stretches and masses), times the sine of the inclination.
* The weight's component across a leaning bar makes it sag in the longitudinal plane: the static
  curve on the same mesh. A mode then stretches the bar, which its axial stiffness resists
  (the linear theory of Irvine, Cable Structures, 1981); the bridge's own give is left out.
* Stretches of another stiffness and mass (fittings, plates, turnbuckles, corrosion), point masses,
  rotational springs at both ends, which do not move sideways.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, solve

Array = NDArray[np.float64]
GRAVITY = 9.81
PLANES = ("transverse", "longitudinal")


@dataclass(frozen=True)
class Stretch:
    """A part of the bar, by factors on the bar's values; `bending` in either plane.

    Only stretches that `joins_mesh` have nodes at their ends; of any other, an element takes the
    fraction that it covers, so that frequencies without it are the same to the last digit.
    """

    from_m: float
    to_m: float
    bending: tuple[float, float] = (1.0, 1.0)
    mass: float = 1.0
    joins_mesh: bool = True


@dataclass(frozen=True)
class Bar:
    """A bar under tension; `shear_area_m2` includes the shear coefficient."""

    length_m: float
    modulus_pa: float
    area_m2: float
    second_moment_m4: float
    mass_kg_m: float
    shear_area_m2: float
    inclination_deg: float = 90.0
    stretches: tuple[Stretch, ...] = ()
    poissons_ratio: float = 0.3
    elements: int = 36

    @property
    def bending_nm2(self) -> float:
        """Return E I of the free bar."""
        return self.modulus_pa * self.second_moment_m4

    def with_stretch(self, stretch: Stretch) -> Bar:
        """Return the bar with one more stretch."""
        return replace(self, stretches=(*self.stretches, stretch))


@dataclass(frozen=True)
class Masses:
    """Point masses at places, in kg and m."""

    mass_kg: tuple[float, ...] = ()
    x_m: tuple[float, ...] = ()


class Plane:
    """Matrices of a bar in one plane, from which any visit's frequencies are solved."""

    def __init__(self, bar: Bar, plane: str) -> None:
        self.bar = bar
        self.nodes = mesh(bar)
        lengths = np.diff(self.nodes)
        bending, mass = element_factors(bar, self.nodes, PLANES.index(plane))
        rigidity = bar.bending_nm2 * bending
        shear_pa = bar.modulus_pa / (2 * (1 + bar.poissons_ratio))
        # A fitting that is stiffer in bending is thicker: its shear area grows by the root.
        ratio = 12 * rigidity / (shear_pa * bar.shear_area_m2 * np.sqrt(bending) * lengths**2)
        points, weights = np.polynomial.legendre.leggauss(4)
        points, weights = (points + 1) / 2, weights / 2
        deflection, slope, rotation = shape_functions(points, lengths, ratio)
        scaled = weights[None, :] * lengths[:, None]

        def assemble(rows: Array, density: Array) -> Array:
            """Assemble the integral of density x row x row, rows of shape (element, point, 4)."""
            return self._assembled(np.einsum("ep,epi,epj->eij", scaled * density, rows, rows))

        even = np.ones_like(scaled)
        linear_mass = bar.mass_kg_m * mass
        turning = linear_mass * bar.second_moment_m4 / bar.area_m2 * bending / mass
        self.stiffness = self._assembled(bending_matrices(lengths, rigidity, ratio))
        self.pull = assemble(slope, even)
        self.inertia = assemble(deflection, even * linear_mass[:, None])
        self.inertia += assemble(rotation, even * turning[:, None])
        self.coating = assemble(deflection, even)
        incline = np.deg2rad(bar.inclination_deg)
        below = np.concatenate([[0.0], np.cumsum(linear_mass * lengths)])
        at = below[:-1, None] + (linear_mass * lengths)[:, None] * points
        middle = np.interp(bar.length_m / 2, self.nodes, below)
        self.weight = assemble(slope, GRAVITY * np.sin(incline) * (at - middle))
        across = GRAVITY * np.cos(incline) * linear_mass if plane == "longitudinal" else 0 * lengths
        load = np.einsum("ep,epi->ei", scaled * across[:, None], deflection)
        self.load = np.zeros(2 * len(self.nodes))
        for number, each in enumerate(load):
            self.load[2 * number : 2 * number + 4] += each

    def _assembled(self, blocks: Array) -> Array:
        size = 2 * len(self.nodes)
        found = np.zeros((size, size))
        for number, block in enumerate(blocks):
            found[2 * number : 2 * number + 4, 2 * number : 2 * number + 4] += block
        return found

    def row(self, x_m: float) -> Array:
        """Return the row that gives the deflection at a place, by Hermite's cubics."""
        at = min(max(int(np.searchsorted(self.nodes, x_m)) - 1, 0), len(self.nodes) - 2)
        length = self.nodes[at + 1] - self.nodes[at]
        s = np.array([(x_m - self.nodes[at]) / length])
        found = np.zeros(2 * len(self.nodes))
        found[2 * at : 2 * at + 4] = shape_functions(s, np.array([length]), np.zeros(1))[0][0, 0]
        return found

    def solve(
        self,
        tension_n: float,
        springs: tuple[float, float],
        *,
        stiffer: float = 1.0,
        masses: Masses = Masses(),
        coating_kg_m: float = 0.0,
        count: int = 6,
    ) -> Array:
        """Return the lowest frequencies in Hz.

        `springs` are in N m/rad at the deck and arch end, `stiffer` a factor on Young's modulus.
        """
        free = np.ones(2 * len(self.nodes), bool)
        free[[0, -2]] = False
        stiffness = stiffer * self.stiffness + tension_n * self.pull + self.weight
        stiffness[1, 1] += springs[0]
        stiffness[-1, -1] += springs[1]
        inertia = self.inertia + coating_kg_m * self.coating
        for mass, x_m in zip(masses.mass_kg, masses.x_m, strict=True):
            row = self.row(x_m)
            inertia = inertia + mass * np.outer(row, row)
        stiffness, inertia = stiffness[np.ix_(free, free)], inertia[np.ix_(free, free)]
        if self.load.any():
            curve = solve(stiffness, self.load[free], assume_a="pos")
            stretched = self.pull[np.ix_(free, free)] @ curve
            bar = self.bar
            axial = stiffer * bar.modulus_pa * bar.area_m2 / bar.length_m
            stiffness = stiffness + axial * np.outer(stretched, stretched)
        # The lowest frequencies are exact as the largest of the inverse problem, where the highest
        # ones of the mesh do not round them.
        size = len(stiffness)
        inverse = eigh(
            inertia, stiffness, eigvals_only=True, subset_by_index=[size - count, size - 1]
        )
        return 1 / (np.sqrt(inverse[::-1]) * 2 * np.pi)


def mesh(bar: Bar) -> Array:
    """Return the nodes: one at each end of a stretch that joins the mesh, others evenly between."""
    ends = {0.0, bar.length_m}
    for each in bar.stretches:
        if each.joins_mesh:
            ends |= {each.from_m, each.to_m}
    nodes = [0.0]
    for start, stop in pairwise(sorted(ends)):
        pieces = max(2, round(bar.elements * (stop - start) / bar.length_m))
        nodes += np.linspace(start, stop, pieces + 1)[1:].tolist()
    return np.array(nodes)


def element_factors(bar: Bar, nodes: Array, plane: int) -> tuple[Array, Array]:
    """Return the factors on bending stiffness and mass of each element."""
    bending, mass = np.ones(len(nodes) - 1), np.ones(len(nodes) - 1)
    for each in bar.stretches:
        covered = np.minimum(nodes[1:], each.to_m) - np.maximum(nodes[:-1], each.from_m)
        fraction = np.clip(covered, 0.0, None) / np.diff(nodes)
        bending *= 1 + fraction * (each.bending[plane] - 1)
        mass *= 1 + fraction * (each.mass - 1)
    return bending, mass


def bending_matrices(lengths: Array, rigidity: Array, ratio: Array) -> Array:
    """Return the stiffness of each element in bending and shear; (elements, 4, 4)."""
    size, one = lengths, np.ones_like(lengths)
    rows = [
        [12 * one, 6 * size, -12 * one, 6 * size],
        [6 * size, (4 + ratio) * size**2, -6 * size, (2 - ratio) * size**2],
        [-12 * one, -6 * size, 12 * one, -6 * size],
        [6 * size, (2 - ratio) * size**2, -6 * size, (4 + ratio) * size**2],
    ]
    scale = rigidity / (size**3 * (1 + ratio))
    return np.moveaxis(np.array(rows) * scale, -1, 0)


def shape_functions(s: Array, lengths: Array, ratio: Array) -> tuple[Array, Array, Array]:
    """Return deflection, its slope and rotation at `s` in 0..1; each (elements, points, 4)."""
    s, size, phi = s[None, :], lengths[:, None], ratio[:, None]
    grown, one = 1 + phi, np.ones((len(lengths), s.shape[1]))
    deflection = [
        (2 * s**3 - 3 * s**2 - phi * s + 1 + phi) / grown,
        size * (s**3 - (2 + phi / 2) * s**2 + (1 + phi / 2) * s) / grown,
        -(2 * s**3 - 3 * s**2 - phi * s) / grown,
        size * (s**3 - (1 - phi / 2) * s**2 - phi / 2 * s) / grown,
    ]
    slope = [
        (6 * s**2 - 6 * s - phi) / (grown * size),
        (3 * s**2 - (4 + phi) * s + 1 + phi / 2) / grown,
        -(6 * s**2 - 6 * s - phi) / (grown * size),
        (3 * s**2 - (2 - phi) * s - phi / 2) / grown,
    ]
    rotation = [
        6 * (s**2 - s) / (grown * size),
        (3 * s**2 - (4 + phi) * s + 1 + phi) / grown,
        -6 * (s**2 - s) / (grown * size),
        (3 * s**2 - (2 - phi) * s) / grown,
    ]
    return (
        np.stack([each * one for each in deflection], -1),
        np.stack([each * one for each in slope], -1),
        np.stack([each * one for each in rotation], -1),
    )
