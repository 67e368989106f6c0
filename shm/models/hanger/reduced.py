"""Solve many hangers of one description quickly: the general model in a reduced basis.

Hangers whose zones and masses lie at the same places have matrices that are sums of the same terms
(bending, tension and its gradient, end springs, zones, shear, sag, masses), each times a number.
Modes of some sixty of them span a basis in which all others are solved (proper orthogonal
decomposition: Quarteroni, Manzoni and Negri 2016, Reduced Basis Methods, chapter 6).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from shm.models.hanger.bar import (
    Bar,
    Pieces,
    along,
    bar_pieces_of,
    by_plane,
    gradient_ratio,
    stiffness_ratio,
)
from shm.models.hanger.functions import DEFLECTIONS, SLOPES
from shm.models.hanger.physical import PhysicalHanger
from shm.models.hanger.system import bending_unit, invert_root, rotary_ratio, rotational_n_m_rad
from shm.values import FloatArray, IntArray

STIFFEST = 1e6
"""Of an end spring, in EI/L: one that is stiffer clamps as well, and rounding would be seen."""

_LEFT_OUT = (1e-10, 1e-12)
"""Of the snapshots' energy, without and with shear: leaves 1e-6 of a frequency (numerical)."""
_ROUGHLY = 1e3
"""Times that: leaves 1e-4."""
_BLOCK = 512
_OFF_DIAGONAL = 1e-4
"""Numerical: of the diagonal, off it; a frequency changes by its square."""


@dataclass(frozen=True, eq=False)
class Modes:
    """Hold modes of n hangers in both planes.

    `frequency` (n, 2, modes) in Hz, and `deflection` (n, 2, modes, points), each of any size.
    """

    frequency: FloatArray
    deflection: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[Modes], axis: int = 0) -> Modes:
        """Return the modes of several blocks of hangers as one."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate(each, axis) for each in zip(*map(_fields, parts), strict=True)))


def _fields(modes: Modes) -> tuple[FloatArray, FloatArray]:
    return modes.frequency, modes.deflection


@dataclass(frozen=True, eq=False)
class Factors:
    """Numbers (planes, n, terms) by which the terms of stiffness and mass are multiplied.

    `unit_hz` (n, planes) is sqrt(EI/m)/(2 pi L^2).
    """

    stiffness: FloatArray
    mass: FloatArray
    unit_hz: FloatArray

    def take(self, rows: slice) -> Factors:
        """Return those of some of the hangers."""
        return Factors(self.stiffness[:, rows], self.mass[:, rows], self.unit_hz[rows])


class ReducedBar:
    """A reduced basis for `modes` modes of hangers like those of `usual`, which are spread widely.

    All have zones and masses at the same fractions of their length, and held ends. An end spring is
    clipped to `STIFFEST`; sag is that of a string's parabola.
    """

    def __init__(self, usual: PhysicalHanger, modes: int):
        self.modes = modes
        self._bar, pieces = bar_pieces_of(usual, modes)
        self._zones = _covered(usual, pieces)
        self._full = _Matrices.of(self._bar, pieces, self._zones, usual)
        self._usual = self._factors(usual)
        self._functions = self._full.span(self._usual, modes)
        self._reduce(_LEFT_OUT[self._bar.functions.strains > 0])

    def _reduce(self, left_out: float) -> None:
        """Take the functions that hold all but the part `left_out` of the snapshots' energy."""
        functions, energy = self._functions
        basis = functions[:, energy > left_out]
        basis = basis @ self._full.projected(basis).diagonalised(self._usual)
        self.basis, self._matrices = basis, self._full.projected(basis).mark_diagonal(self._usual)

    @cached_property
    def rough(self) -> ReducedBar:
        """Return the same with fewer functions: a fraction of the time, 1e-4 of a frequency off."""
        found = copy(self)
        found._reduce(_ROUGHLY * _LEFT_OUT[self._bar.functions.strains > 0])
        return found

    def frequencies_hz(self, physical: PhysicalHanger) -> FloatArray:
        """Return frequencies (n, 2, modes)."""
        factors = self._factors(physical)
        found = [self._matrices.frequencies(each, self.modes) for each in _blocks(factors)]
        return np.concatenate(found)

    def modes_at(self, physical: PhysicalHanger, x: FloatArray) -> Modes:
        """Return the modes, with deflections at fractions `x` of the length."""
        return self.modes_about(physical, (), x)[0]

    def modes_about(
        self, physical: PhysicalHanger, shifted: Sequence[PhysicalHanger], x: FloatArray
    ) -> tuple[Modes, list[Modes]]:
        """Return the same, and to first order the modes of near hangers."""
        table = self._deflections(x) @ self.basis
        others = [list(_blocks(self._factors(each))) for each in shifted]
        found = [
            self._matrices.modes_about(each, [near[k] for near in others], self.modes, table)
            for k, each in enumerate(_blocks(self._factors(physical)))
        ]
        near = [Modes.joined([each[1][index] for each in found]) for index in range(len(shifted))]
        return Modes.joined([each[0] for each in found]), near

    def _deflections(self, x: FloatArray) -> FloatArray:
        return _padded(self._bar.deflections(x[None])[0], self._full.free)

    def _factors(self, physical: PhysicalHanger) -> Factors:
        """Return the numbers by which the terms of each hanger are multiplied."""
        n = len(physical.tension_n)
        planes = np.broadcast_to(stiffness_ratio(physical), (n, 2)).T
        gradient = np.broadcast_to(gradient_ratio(physical), (n, 2)).T
        springs = np.einsum("nepp->pne", rotational_n_m_rad(physical))
        springs = springs / bending_unit(physical, 1).T[..., None]
        stiff, heavy = np.ones((2, n, len(self._zones))), np.ones((n, len(self._zones)))
        for group, zones in enumerate(self._zones):
            for zone in (physical.zones[index] for index in zones):
                stiff[:, :, group] *= by_plane(zone).T
                heavy[:, group] *= zone.mass_factor
        sag = np.abs(planes) * physical.sag_parameter.T
        columns = [stiff, planes[..., None], gradient[..., None]]
        columns += [springs.clip(max=STIFFEST), sag[..., None]]
        weights = [heavy]
        if self._bar.functions.strains:
            shear = physical.shear_compliance_1_n[:, None] * bending_unit(physical, 2)
            columns.append(1 / shear.T[..., None])
            # A zone's rotary inertia goes with its mass.
            weights.append(rotary_ratio(physical)[:, None] * heavy)
        bar_kg = physical.mass_per_length_kg_m * physical.length_m
        weights += [(each.mass_kg / bar_kg)[:, None] for each in physical.masses]
        mass = np.broadcast_to(np.hstack(weights), (2, n, sum(w.shape[1] for w in weights)))
        unit = np.sqrt(bending_unit(physical, 3) / bar_kg[:, None]) / (2 * np.pi)
        return Factors(np.concatenate(columns, axis=2), mass, unit)


def _blocks(factors: Factors) -> list[Factors]:
    count = len(factors.unit_hz)
    return [factors.take(slice(k, k + _BLOCK)) for k in range(0, max(count, 1), _BLOCK)]


def _covered(usual: PhysicalHanger, pieces: Pieces) -> dict[tuple[int, ...], list[int]]:
    """Return the stretches that the same zones cover, by the indices of these zones."""
    found: dict[tuple[int, ...], list[int]] = {}
    ends = [along(usual, np.stack([z.start_m, z.end_m], axis=1))[0] for z in usual.zones]
    for stretch, middle in enumerate(pieces.middle):
        zones = tuple(k for k, (low, high) in enumerate(ends) if low < middle < high)
        found.setdefault(zones, []).append(stretch)
    return found


def _padded(values: FloatArray, free: IntArray) -> FloatArray:
    """Return values (points, functions that deflect) of the free functions."""
    whole = np.zeros((len(values), int(free[-1]) + 1))
    whole[:, : values.shape[1]] = values
    return whole[:, free]


@dataclass(frozen=True, eq=False)
class _Matrices:
    """Matrices (terms, d, d) of stiffness and mass, in the order of `Factors`.

    `curvature` (points, d) of each group of stretches gives its bending; `free` are the functions
    that the ends let move.
    """

    stiffness: FloatArray
    mass: FloatArray
    curvature: tuple[FloatArray, ...]
    free: IntArray
    diagonal_mass: bool = False

    @classmethod
    def of(
        cls,
        bar: Bar,
        pieces: Pieces,
        zones: dict[tuple[int, ...], list[int]],
        usual: PhysicalHanger,
    ) -> _Matrices:
        count = pieces.tension.shape[-1]
        free = np.setdiff1d(np.arange(count), DEFLECTIONS)
        springs = np.zeros((2, count, count))
        springs[[0, 1], SLOPES, SLOPES] = 1.0
        area = pieces.area[0]
        groups = list(zones.values())
        bending = [pieces.bending[group].sum(axis=0) for group in groups]
        stiffness = [*bending, pieces.tension[0], pieces.gradient[0], *springs]
        stiffness.append(np.outer(area, area))
        mass = [pieces.mass[group].sum(axis=0) for group in groups]
        if bar.functions.strains:
            stiffness.append(pieces.shear[0])
            mass += [pieces.rotation[group].sum(axis=0) for group in groups]
        for each in usual.masses:
            at = along(usual, each.x_m[:, None])[:1]
            moved = _padded(bar.deflections(at)[0], np.arange(count))[0]
            energy = np.outer(moved, moved)
            if each.radius_of_gyration_m is not None:
                turned = _padded(bar.slopes(at)[0], np.arange(count))[0]
                turned = turned * (each.radius_of_gyration_m / usual.length_m)[0]
                energy = energy + np.outer(turned, turned)
            mass.append(energy)
        curvature = tuple(
            np.vstack([pieces.curvature[each] for each in group])[:, free] for group in groups
        )
        square = np.ix_(free, free)
        return cls(
            np.array([each[square] for each in stiffness]),
            np.array([each[square] for each in mass]),
            curvature,
            free,
        )

    def span(self, usual: Factors, modes: int) -> tuple[FloatArray, FloatArray]:
        """Return functions (d, m) that span the modes of `usual`, orthonormal in the mean mass.

        And the part (m,) of the modes' energy that each holds, falling.
        """
        mean = np.tensordot(usual.mass[0].mean(axis=0), self.mass, 1)
        last, found = len(mean) - 1, []
        for stiff, heavy in zip(usual.stiffness, usual.mass, strict=True):
            stiffness, mass = _sum(stiff, self.stiffness), _sum(heavy, self.mass)
            np.einsum("nii->ni", stiffness)[...] *= 1 + _RIDGE
            for k, m in zip(stiffness, mass, strict=True):
                # Of the inverse the lowest modes have the largest values, which no short zone
                # rounds.
                _, vectors = scipy.linalg.eigh(m, k, subset_by_index=[last - modes, last])
                found.append(vectors / np.sqrt(((mean @ vectors) * vectors).sum(axis=0)))
        # What spans them, as few columns as there are functions.
        shapes = scipy.linalg.qr(np.hstack(found).T, mode="r")[0][: last + 1].T
        values, mixed = np.linalg.eigh(shapes.T @ mean @ shapes)
        values, mixed = values[::-1], mixed[:, ::-1]
        held = values > _ROUNDING * values[0]
        functions = shapes @ (mixed[:, held] / np.sqrt(values[held]))
        return functions, values[held] / values.sum()

    def projected(self, basis: FloatArray) -> _Matrices:
        """Return the same in a reduced basis (d, r).

        Bending by its curvature: a short zone moves nearly as a rigid body, and the difference of
        its large stiffnesses would be rounding.
        """
        stiffness, mass = (basis.T @ each @ basis for each in (self.stiffness, self.mass))
        curvature = tuple(each @ basis for each in self.curvature)
        for group, each in enumerate(curvature):
            stiffness[group] = each.T @ each
        return replace(self, stiffness=stiffness, mass=mass, curvature=curvature)

    def diagonalised(self, usual: Factors) -> FloatArray:
        """Return a change of basis (d, d) in which masses like `usual` are as diagonal as can be.

        The mean mass is the identity. Functions that feel no change of mass keep their order, from
        smooth to rough: a stiff spring then rounds no low frequency.
        """
        spread = np.tensordot(usual.mass[0].std(axis=0), self.mass, 1)
        size, vectors = np.linalg.eigh(spread)
        felt = vectors[:, size > _OFF_DIAGONAL**2 * max(float(size[-1]), np.finfo(float).tiny)]
        return np.asarray(np.linalg.qr(np.hstack([felt, np.eye(len(spread))]))[0])

    def mark_diagonal(self, usual: Factors) -> _Matrices:
        """Return the same, marked as diagonal where masses like `usual` are."""
        mass = _sum(usual.mass[0], self.mass)
        size = np.sqrt(np.einsum("nii->ni", mass))
        off_diagonal = np.abs(mass / size[:, :, None] / size[:, None, :] - np.eye(mass.shape[1]))
        return replace(self, diagonal_mass=bool(off_diagonal.max() < _OFF_DIAGONAL))

    def frequencies(self, factors: Factors, modes: int) -> FloatArray:
        """Return frequencies (n, 2, modes) in Hz."""
        found = np.empty((*factors.unit_hz.shape, modes))
        for plane, (stiff, heavy) in enumerate(zip(factors.stiffness, factors.mass, strict=True)):
            square = np.linalg.eigvalsh(self._whitened(stiff, heavy)[0])[:, :modes]
            found[:, plane] = np.sqrt(square.clip(min=0.0))
        return found * factors.unit_hz[..., None]

    def modes_about(
        self, factors: Factors, shifted: Sequence[Factors], modes: int, table: FloatArray
    ) -> tuple[Modes, list[Modes]]:
        """Return modes, and to first order those of near hangers.

        Deflections are where the basis has those of `table` (points, d). Frequencies change by
        Rayleigh's quotient, deflections by the other modes' shares in the change of each (Fox and
        Kapoor 1968, AIAA J. 6, 2426).
        """
        planes = [
            self._plane_about(plane, factors, shifted, modes, table)
            for plane in range(factors.unit_hz.shape[1])
        ]
        found = [Modes.joined([each[k] for each in planes], 1) for k in range(len(planes[0]))]
        return found[0], found[1:]

    def _plane_about(
        self,
        plane: int,
        factors: Factors,
        shifted: Sequence[Factors],
        modes: int,
        table: FloatArray,
    ) -> list[Modes]:
        """Return the same of one plane, the modes first."""
        stiff, heavy = factors.stiffness[plane], factors.mass[plane]
        whitened, back = self._whitened(stiff, heavy)
        if not shifted and not len(table):
            alone = np.asarray(np.linalg.eigvalsh(whitened)[:, :modes], dtype=float)
            none = np.empty((len(alone), 0, modes))
            return [_modes(alone, none, factors.unit_hz[:, plane])]
        square, vectors = np.linalg.eigh(whitened)
        # Where no deflection is asked for, the other modes have no say.
        shape = back(vectors if len(table) else vectors[:, :, :modes])
        lowest, seen = square[:, :modes], table @ shape
        found = [_modes(lowest, seen[:, :, :modes], factors.unit_hz[:, plane])]
        if not shifted:
            return found
        of_terms = _products if len(table) else _energies
        by_stiffness, by_mass = (
            of_terms(each, shape, modes) for each in (self.stiffness, self.mass)
        )
        identity = np.eye(shape.shape[2], modes, dtype=bool)
        apart = square[:, None, :modes] - square[:, : shape.shape[2], None]
        share = np.where(identity, 0.0, 1 / np.where(identity | (apart == 0), np.inf, apart))
        for each in shifted:
            heavier = _weighed(each.mass[plane] - heavy, by_mass)
            change = _weighed(each.stiffness[plane] - stiff, by_stiffness)
            change -= (lowest if change.ndim == 2 else lowest[:, None]) * heavier
            moved = seen[:, :, :modes]
            if len(table):
                moved = moved + seen @ (share * change - 0.5 * identity * heavier)
                change = np.einsum("nmm->nm", change[:, :modes])
            found.append(_modes(lowest + change, moved, each.unit_hz[:, plane]))
        return found

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
            diagonal = heavy @ np.einsum("tii->ti", self.mass)
            scale = 1 / np.sqrt(diagonal.clip(min=_ROUNDING))
            whitened = stiffness * scale[:, :, None] * scale[:, None, :]
            return whitened, lambda vectors: vectors * scale[:, :, None]
        inverse = invert_root(_sum(heavy, self.mass))
        across = inverse.swapaxes(1, 2)
        return inverse @ stiffness @ across, lambda vectors: across @ vectors


_RIDGE = 1e-12  # numerical: of two nearly equal kinks
_ROUNDING = 1e-14  # numerical: smaller energies of a Gram matrix are noise


def _modes(square: FloatArray, seen: FloatArray, unit_hz: FloatArray) -> Modes:
    """Return modes of one plane, (n, 1, ...)."""
    frequency = np.sqrt(square.clip(min=0.0)) * unit_hz[:, None]
    return Modes(frequency[:, None], np.swapaxes(seen, 1, 2)[:, None])


def _weighed(factors: FloatArray, terms: FloatArray) -> FloatArray:
    """Return the sums (n, ...) of terms (n, terms, ...) by factors (n, terms)."""
    return np.asarray(np.einsum("nt,nt...->n...", factors, terms))


def _energies(matrices: FloatArray, shapes: FloatArray, modes: int) -> FloatArray:
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
