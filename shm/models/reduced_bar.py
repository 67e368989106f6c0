"""Frequencies of many hangers of one description, each term of their energy by its own factor.

A hanger's stiffness and mass are sums of matrices (`bar_elements`) times numbers: bending, tension,
end springs, zones, shear, sag, clamped-on masses. Modes of sixty hangers of the prior span a
reduced basis in which all others are solved (proper orthogonal decomposition: Quarteroni, Manzoni
and Negri 2016, Reduced Basis Methods, chapter 6).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy

from shm.models.bar_elements import BarElements, bar_elements
from shm.values import FloatArray

STIFFEST = 1e6
"""Of an end spring, in EI/L: one that is stiffer clamps as well, and rounding would be seen."""

_LEFT_OUT = (1e-10, 1e-12)
"""Of the snapshots' energy, without and with shear: leaves 1e-6 of a frequency (numerical)."""
_ROUGHLY = 1e3
"""Times that: leaves 1e-4."""
_BLOCK = 512


@dataclass(frozen=True, eq=False)
class BarTerms:
    """Factors of `n` hangers in units of their own length, bending stiffness and mass.

    `tension` (n,) is T L2/EI, `gradient` (n,) by how much it grows from the deck to the arch;
    `springs` (n, 2 ends, 2 planes) k L/EI; `stiffness` (n, zones, 2 planes) and `mass` (n, zones)
    those of zones over the bar's; `sag` (n,) the stiffness that sag under its own weight adds in
    the longitudinal plane; `shear` (n,) kappa G A L2/EI, `turning` (n,) I/(A L2);
    `point_masses` (n, places) over the bar's.
    """

    tension: FloatArray
    gradient: FloatArray
    springs: FloatArray
    stiffness: FloatArray
    mass: FloatArray
    sag: FloatArray
    shear: FloatArray
    turning: FloatArray
    point_masses: FloatArray

    def take(self, rows: slice) -> BarTerms:
        """Return some of the hangers."""
        return BarTerms(**{each.name: getattr(self, each.name)[rows] for each in fields(self)})


class ReducedBar:
    """A reduced basis for hangers like those of `usual`, with `zones` (start, end) of 0 to 1.

    `point_masses` are the places of clamped-on masses, `radii` their radii of gyration, else 0.
    """

    def __init__(
        self,
        zones: Sequence[tuple[float, float]],
        usual: BarTerms,
        modes: int,
        point_masses: Sequence[float] = (),
        radii: Sequence[float] = (),
    ):
        self.modes = modes
        self.shears = usual.shear.size > 0 and bool(np.isfinite(usual.shear).any())
        decay = float(np.sqrt(np.median(usual.tension)))
        elements = bar_elements(list(zones), decay, modes, self.shears, point_masses)
        self._elements = elements
        at = np.asarray(point_masses, dtype=float)
        whole = _Matrices.of(elements, at, np.asarray(radii) if radii else np.zeros_like(at))
        self._usual = usual
        self._whole, self._functions = whole, _functions_of(whole, self._usual, modes)
        self._reduce(_LEFT_OUT[self.shears])

    def _reduce(self, left_out: float) -> None:
        """Take the functions that hold all but the part `left_out` of the snapshots' energy."""
        functions, energy = self._functions
        basis, whole = functions[:, energy > left_out], self._whole
        self.basis = basis @ whole.projected(basis).diagonalised(self._usual)
        self._reduced = whole.projected(self.basis).with_masses_of(self._usual)

    @cached_property
    def rough(self) -> ReducedBar:
        """Return the same with fewer functions: a fraction of the time, 1e-4 of a frequency off."""
        found = copy(self)
        found._reduce(_ROUGHLY * _LEFT_OUT[self.shears])
        return found

    def frequencies(self, terms: BarTerms) -> FloatArray:
        """Return circular frequencies (n, 2, modes) in units of sqrt(EI/m)/L2."""
        found = np.empty((len(terms.tension), 2, self.modes))
        for first in range(0, len(found), _BLOCK):
            block = slice(first, first + _BLOCK)
            found[block] = self._reduced.frequencies(terms.take(block), self.modes)
        return found

    def full_frequencies(self, terms: BarTerms) -> FloatArray:
        """Return the same by all elements."""
        return self._whole.frequencies(terms, self.modes)

    def modes_at(self, terms: BarTerms, x: FloatArray) -> Modes:
        """Return the modes of the hangers, with deflections at places `x` from 0 to 1."""
        table = self._elements.deflection(x) @ self.basis
        return _joined(
            [
                self._reduced.modes_at(terms.take(block), self.modes, table)
                for block in _blocks(len(terms.tension))
            ]
        )

    def modes_about(
        self, terms: BarTerms, shifted: Sequence[BarTerms], x: FloatArray
    ) -> tuple[Modes, list[Modes]]:
        """Return the same, and to first order the modes of near hangers."""
        table = self._elements.deflection(x) @ self.basis
        found = [
            self._reduced.modes_about(
                terms.take(block), [each.take(block) for each in shifted], self.modes, table
            )
            for block in _blocks(len(terms.tension))
        ]
        near = [_joined([each[1][index] for each in found]) for index in range(len(shifted))]
        return _joined([each[0] for each in found]), near


@dataclass(frozen=True, eq=False)
class Modes:
    """Hold modes of n hangers in both planes.

    Circular `frequency` (n, 2, modes), and `deflection` (n, 2, modes, points), each of any size.
    """

    frequency: FloatArray
    deflection: FloatArray


def _blocks(count: int) -> list[slice]:
    return [slice(first, first + _BLOCK) for first in range(0, max(count, 1), _BLOCK)]


def _joined(parts: Sequence[Modes]) -> Modes:
    """Return the modes of several blocks of hangers as one."""
    if len(parts) == 1:
        return parts[0]
    return Modes(
        np.concatenate([each.frequency for each in parts]),
        np.concatenate([each.deflection for each in parts]),
    )


@dataclass(frozen=True, eq=False)
class _Matrices:
    """Matrices (terms, d, d) of stiffness and mass, in the order in which factors are given."""

    stiffness: FloatArray
    mass: FloatArray
    curvature: tuple[FloatArray, ...]
    shears: bool
    diagonal_mass: bool = False

    @classmethod
    def of(cls, elements: BarElements, masses_at: FloatArray, radii: FloatArray) -> _Matrices:
        springs = np.einsum("ei,ej->eij", elements.end_rotation, elements.end_rotation)
        sag = np.outer(elements.area, elements.area)
        stiffness = [*elements.bending, elements.tension, elements.gradient, *springs, sag]
        mass = [*elements.mass]
        shears = elements.shear.size > 0
        if shears:
            stiffness.append(elements.shear)
            mass += [*elements.turning]
        moved, turned = elements.deflection(masses_at), elements.slope(masses_at)
        for w, turn in zip(moved, radii[:, None] * turned, strict=True):
            mass.append(np.outer(w, w) + np.outer(turn, turn))
        return cls(np.array(stiffness), np.array(mass), elements.curvature, shears)

    def projected(self, basis: FloatArray) -> _Matrices:
        """Return the same in a reduced basis (d, r).

        Bending by its curvature: a short zone moves nearly as a rigid body, and the difference of
        its large stiffnesses would be rounding.
        """
        stiffness, mass = (basis.T @ each @ basis for each in (self.stiffness, self.mass))
        curvature = tuple(each @ basis for each in self.curvature)
        for zone, each in enumerate(curvature):
            stiffness[zone] = each.T @ each
        return _Matrices(stiffness, mass, curvature, self.shears)

    def diagonalised(self, usual: BarTerms) -> FloatArray:
        """Return a change of basis (d, d) in which masses like `usual` are as diagonal as can be.

        The mean mass is the identity. Functions that feel no change of mass keep their order, from
        smooth to rough: a stiff spring then rounds no low frequency.
        """
        spread = np.tensordot(self.factors(usual, 0)[1].std(axis=0), self.mass, 1)
        size, vectors = np.linalg.eigh(spread)
        felt = vectors[:, size > _OFF_DIAGONAL**2 * max(float(size[-1]), np.finfo(float).tiny)]
        return np.asarray(np.linalg.qr(np.hstack([felt, np.eye(len(spread))]))[0])

    def with_masses_of(self, usual: BarTerms) -> _Matrices:
        """Return the same, with the note whether masses like `usual` are diagonal."""
        mass = _sum(self.factors(usual, 0)[1], self.mass)
        size = np.sqrt(np.einsum("nii->ni", mass))
        off_diagonal = np.abs(mass / size[:, :, None] / size[:, None, :] - np.eye(mass.shape[1]))
        return replace(self, diagonal_mass=bool(off_diagonal.max() < _OFF_DIAGONAL))

    def factors(self, terms: BarTerms, plane: int) -> tuple[FloatArray, FloatArray]:
        """Return the factors (n, terms) of stiffness and mass in one plane."""
        one = np.ones((len(terms.tension), 1))
        springs = terms.springs[:, :, plane].clip(max=STIFFEST)
        columns = [
            one,
            terms.stiffness[..., plane],
            terms.tension[:, None],
            terms.gradient[:, None],
            springs,
            plane * terms.sag[:, None],
        ]
        weights = [one, terms.mass]
        if self.shears:
            columns.append(terms.shear[:, None])
            # A zone's rotary inertia goes with its mass.
            weights += [terms.turning[:, None] * np.hstack([one, terms.mass])]
        weights.append(terms.point_masses)
        return np.hstack(columns), np.hstack(weights)

    def assembled(self, terms: BarTerms, plane: int) -> tuple[FloatArray, FloatArray]:
        """Return stiffness and mass (n, d, d) in one plane."""
        stiffness, mass = self.factors(terms, plane)
        return _sum(stiffness, self.stiffness), _sum(mass, self.mass)

    def frequencies(self, terms: BarTerms, modes: int) -> FloatArray:
        """Return circular frequencies (n, 2, modes)."""
        found = np.empty((len(terms.tension), 2, modes))
        for plane in (0, 1):
            whitened, _ = self._whitened(*self.factors(terms, plane))
            square = np.linalg.eigvalsh(whitened)[:, :modes]
            found[:, plane] = np.sqrt(square.clip(min=0.0))
        return found

    def modes_at(self, terms: BarTerms, modes: int, table: FloatArray) -> Modes:
        """Return the modes, with deflections where the basis has those of `table` (points, d)."""
        found = []
        for plane in (0, 1):
            whitened, back = self._whitened(*self.factors(terms, plane))
            if len(table):
                square, vectors = np.linalg.eigh(whitened)
            else:
                square, vectors = np.linalg.eigvalsh(whitened), whitened
            found.append(_modes(square[:, :modes], table @ back(vectors[:, :, :modes])))
        return _of_planes(found)

    def modes_about(
        self, terms: BarTerms, shifted: Sequence[BarTerms], modes: int, table: FloatArray
    ) -> tuple[Modes, list[Modes]]:
        """Return the same, and to first order the modes of near hangers.

        Frequencies by Rayleigh's quotient, deflections by the other modes' shares in the change of
        each (Fox and Kapoor 1968, AIAA J. 6, 2426).
        """
        found: list[Modes] = []
        near: list[list[Modes]] = [[] for _ in shifted]
        for plane in (0, 1):
            stiff, heavy = self.factors(terms, plane)
            whitened, back = self._whitened(stiff, heavy)
            square, vectors = np.linalg.eigh(whitened)
            lowest = square[:, :modes]
            if not len(table):
                shape = back(vectors[:, :, :modes])
                by_stiffness, by_mass = (
                    _energies(each, shape) for each in (self.stiffness, self.mass)
                )
                found.append(_modes(lowest, table @ shape))
                for index, each in enumerate(shifted):
                    stiffer, heavier = self.factors(each, plane)
                    change = np.einsum("nt,ntk->nk", stiffer - stiff, by_stiffness)
                    change -= lowest * np.einsum("nt,ntk->nk", heavier - heavy, by_mass)
                    near[index].append(_modes(lowest + change, table @ shape))
                continue
            shape = back(vectors)
            stiffness, mass = (
                _products(each, shape, modes) for each in (self.stiffness, self.mass)
            )
            apart = square[:, None, :modes] - square[:, :, None]
            identity = np.eye(square.shape[1], modes, dtype=bool)
            share = np.where(identity, 0.0, 1 / np.where(identity | (apart == 0), np.inf, apart))
            seen = table @ shape
            found.append(_modes(lowest, seen[:, :, :modes]))
            for index, each in enumerate(shifted):
                stiffer, heavier = self.factors(each, plane)
                heavier_by = np.einsum("nt,ntjm->njm", heavier - heavy, mass)
                change = np.einsum("nt,ntjm->njm", stiffer - stiff, stiffness)
                change -= square[:, None, :modes] * heavier_by
                moved = seen @ (share * change - 0.5 * identity * heavier_by)
                by = np.einsum("nmm->nm", change[:, :modes])
                near[index].append(_modes(lowest + by, seen[:, :, :modes] + moved))
        return _of_planes(found), [_of_planes(each) for each in near]

    def _whitened(
        self, stiff: FloatArray, heavy: FloatArray
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """Return L^-1 K L^-T (n, d, d) with the mass L L^T, and what takes its vectors back."""
        wrong = ~(np.isfinite(stiff).all(axis=1) & np.isfinite(heavy).all(axis=1))
        if wrong.any():  # no eigenvalue of it would converge; its frequencies are 0
            stiff, heavy = stiff.copy(), heavy.copy()
            stiff[wrong], heavy[wrong] = 0.0, 1.0
        stiffness = _sum(stiff, self.stiffness)
        if self.diagonal_mass:
            diagonal = np.einsum("tii->ti", self.mass)
            scale = 1 / np.sqrt(heavy @ diagonal)
            whitened = stiffness * scale[:, :, None] * scale[:, None, :]
            return whitened, lambda vectors: vectors * scale[:, :, None]
        inverse = np.linalg.inv(np.linalg.cholesky(_sum(heavy, self.mass)))
        across = inverse.swapaxes(1, 2)
        return inverse @ stiffness @ across, lambda vectors: across @ vectors


def _modes(square: FloatArray, seen: FloatArray) -> Modes:
    """Return modes of one plane of squared frequencies and deflections (n, points, modes)."""
    return Modes(np.sqrt(square.clip(min=0.0)), np.swapaxes(seen, 1, 2))


def _of_planes(planes: Sequence[Modes]) -> Modes:
    """Return the modes of both planes together."""
    return Modes(
        np.stack([each.frequency for each in planes], axis=1),
        np.stack([each.deflection for each in planes], axis=1),
    )


_OFF_DIAGONAL = 1e-4
"""Numerical: of the diagonal, off it; a frequency changes by its square."""


def _energies(matrices: FloatArray, shapes: FloatArray) -> FloatArray:
    """Return x' A x (n, terms, modes) of matrices (terms, d, d) and shapes (n, d, modes)."""
    moved = np.einsum("tij,njk->ntik", matrices, shapes, optimize=True)
    return np.asarray((moved * shapes[:, None]).sum(axis=2))


def _products(matrices: FloatArray, shapes: FloatArray, modes: int) -> FloatArray:
    """Return x_j' A x_m (n, terms, d, modes) of all shapes x (n, d, d) with the lowest."""
    moved = np.einsum("tij,njm->ntim", matrices, shapes[:, :, :modes], optimize=True)
    return np.asarray(np.swapaxes(shapes, 1, 2)[:, None] @ moved)


def _sum(factors: FloatArray, matrices: FloatArray) -> FloatArray:
    """Return the sums (n, d, d) of matrices (terms, d, d), each by its factors (n, terms)."""
    size = matrices.shape[1]
    return np.asarray(factors @ matrices.reshape(len(matrices), -1)).reshape(-1, size, size)


def _functions_of(whole: _Matrices, usual: BarTerms, modes: int) -> tuple[FloatArray, FloatArray]:
    """Return functions (d, m) that span the modes of `usual`, orthonormal in the mean mass.

    And the part (m,) of the modes' energy that each holds, falling.
    """
    _, mean = whole.assembled(usual, 0)
    root = np.linalg.cholesky(mean.mean(axis=0))
    found = []
    for row in range(len(usual.tension)):
        for plane in (0, 1):
            stiffness, mass = whole.assembled(usual.take(slice(row, row + 1)), plane)
            # Of the inverse the lowest modes have the largest values, which no short zone rounds.
            last = len(root) - 1
            _, vectors = scipy.linalg.eigh(
                mass[0], stiffness[0], subset_by_index=[last - modes, last]
            )
            size = root.T @ vectors
            found.append(size / np.linalg.norm(size, axis=0))
    left, values, _ = np.linalg.svd(np.hstack(found), full_matrices=False)
    functions = np.asarray(scipy.linalg.solve_triangular(root.T, left))
    return functions, values**2 / np.sum(values**2)
