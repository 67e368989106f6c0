"""Stiffness and mass of a hanger's planes over the trial functions, without units.

Lengths are in L, stiffness in EI/L of the plane, masses in m L^3: an eigenvalue omega^2 stands for
omega^2 EI/(m L^4).

What holds a bar's ends (stiffness from compliance), gives way and swings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.models.hanger.bar import Bar, along, gradient_ratio, stiffness_ratio
from shm.models.hanger.functions import DEFLECTIONS, HERMITE, SLOPES
from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray, IntArray

_HELD = 1e-13
"""The flexibility left to a held end, as a share of the bar's own."""
_HELD_TURNED = 1e-9
"""The same where springs are turned: their stiffness is the inverse of a matrix."""


@dataclass(frozen=True, eq=False)
class Oscillator:
    """The support at an end: a mass on a spring, without units, both (n, planes).

    It deflects by the unknown `at`.
    """

    stiffness: FloatArray
    mass: FloatArray
    at: int


def find_oscillators(physical: PhysicalHanger, free: IntArray) -> tuple[Oscillator, ...]:
    """Return those of ends whose deflections are among the functions `free`."""
    return tuple(
        _build_oscillator(physical, int(end), int(np.flatnonzero(free == DEFLECTIONS[end])[0]))
        for end in np.flatnonzero(physical.gives_way)
    )


def _build_oscillator(physical: PhysicalHanger, end: int, at: int) -> Oscillator:
    compliance_m_n = physical.translational_compliance_m_n
    spring_n_m = translational_n_m(physical, compliance_m_n)[:, end]
    mass_kg = np.where(compliance_m_n > 0, physical.support_mass_kg, 0.0)[:, end]
    bar_kg = (physical.mass_per_length_kg_m * physical.length_m)[:, None]
    return Oscillator(spring_n_m / bending_unit(physical, 3), mass_kg / bar_kg, at)


def add_oscillators(
    stiffness: FloatArray, mass: FloatArray, found: tuple[Oscillator, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return a bar's stiffness and mass with those of what swings at its ends.

    The bar's stiffness may be overwritten.
    """
    if any(np.any(oscillator.mass) for oscillator in found):
        mass = np.broadcast_to(mass, stiffness.shape).copy()
    for oscillator in found:
        stiffness[..., oscillator.at, oscillator.at] += oscillator.stiffness
        if np.any(oscillator.mass):
            mass[..., oscillator.at, oscillator.at] += oscillator.mass
    return stiffness, mass


def bending_unit(physical: PhysicalHanger, power: int) -> FloatArray:
    """EI/L^power (n, planes)."""
    return np.asarray(physical.bending_stiffness_n_m2 / physical.length_m[:, None] ** power)


def rotary_ratio(physical: PhysicalHanger) -> FloatArray:
    """I/(A L^2) (n,)."""
    return np.asarray(
        physical.rotary_inertia_kg_m / (physical.mass_per_length_kg_m * physical.length_m**2)
    )


def are_coupled(physical: PhysicalHanger) -> bool:
    """Return True where a deflection in one plane bends any of the hangers in the other."""
    compliance = physical.rotational_compliance_rad_n_m
    return compliance.shape[-1] > 1 and bool(np.any(compliance[..., 0, 1]))


def rotational_n_m_rad(physical: PhysicalHanger) -> FloatArray:
    """Of the end springs (n, ends, planes, planes)."""
    compliance = physical.rotational_compliance_rad_n_m
    diagonal = np.einsum("nepp->nep", compliance)
    unit = 1 / bending_unit(physical, 1)[:, None]
    if not are_coupled(physical):
        stiffness = 1 / np.maximum(diagonal, _HELD * unit)
        return np.asarray(stiffness[..., None] * np.eye(diagonal.shape[-1]))
    diagonal = diagonal + _HELD_TURNED * unit
    both = compliance[..., 0, 1]
    determinant = diagonal[..., 0] * diagonal[..., 1] - both**2
    matrix = (
        np.stack([diagonal[..., 1], -both, -both, diagonal[..., 0]], axis=-1)
        / determinant[..., None]
    )
    return np.asarray(matrix.reshape(compliance.shape))


def translational_n_m(physical: PhysicalHanger, compliance_m_n: FloatArray) -> FloatArray:
    """Of supports of a compliance (n, ends, planes); 0 for a free end."""
    least = _HELD / bending_unit(physical, 3)[:, None]
    return np.asarray(1 / np.maximum(compliance_m_n, least))


_RIGID_IN_SHEAR = 1e12  # numerical: a share of shear below 1e-12 is lost in rounding


@dataclass(frozen=True, eq=False)
class System:
    """Stiffness and mass (n, planes, unknowns, unknowns).

    The first unknowns are the functions `free` of the bar, the others `oscillators`' own.
    """

    stiffness: FloatArray
    mass: FloatArray
    free: IntArray
    oscillators: tuple[Oscillator, ...]

    def unknown(self, function: int) -> int | None:
        """Return the unknown that a function is; None where nothing lets it move."""
        found = np.flatnonzero(self.free == function)
        return int(found[0]) if len(found) else None


def system(physical: PhysicalHanger, bar: Bar) -> System:
    """Each plane by itself."""
    stiffness, mass = _stiffness(physical, bar), _mass(physical, bar)
    turning = np.einsum("nepp->nep", rotational_n_m_rad(physical))
    turning = turning / bending_unit(physical, 1)[:, None]
    for end in range(2):
        stiffness[:, :, SLOPES[end], SLOPES[end]] += turning[:, end]
    if bar.functions.still:
        stiffness, mass = _condensed(stiffness, mass, bar.functions.still)
    first, free = _find_free(physical, stiffness.shape[-1])
    stiffness, mass = _window(stiffness, first, free), _window(mass, first, free)
    found = find_oscillators(physical, free)
    stiffness, mass = add_oscillators(stiffness, mass, found)
    if np.any(physical.sag_parameter):
        stiffness = stiffness + _sag(physical, bar, free)
    return System(stiffness, mass, free, found)


def _condensed(
    stiffness: FloatArray, mass: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Without the last `count` functions, which follow the others as in statics (Guyan 1965).

    They are shear strains without deflection. Rotary inertia alone acts on them, and it changes the
    shear strain by (radius of gyration x wave number)^2, some 1e-2: frequencies by 1e-6.
    """
    # By Cholesky's factor, which loses no more to rounding where places of kinks nearly coincide.
    root = invert_root(stiffness[..., -count:, -count:])
    scaled = root @ stiffness[..., -count:, :-count]
    follow = -np.swapaxes(root, -1, -2) @ scaled
    cross, transposed = mass[..., :-count, -count:] @ follow, np.swapaxes(follow, -1, -2)
    turned = transposed @ mass[..., -count:, -count:] @ follow
    return (
        stiffness[..., :-count, :-count] - np.swapaxes(scaled, -1, -2) @ scaled,
        mass[..., :-count, :-count] + cross + np.swapaxes(cross, -1, -2) + turned,
    )


def _window(matrix: FloatArray, first: int, free: IntArray) -> FloatArray:
    """Return rows and columns of the free functions; a view where only first ones are left out."""
    if len(free) == matrix.shape[-1] - first:
        return matrix[..., first:, first:]
    return matrix[..., free[:, None], free]


def _find_free(physical: PhysicalHanger, functions: int) -> tuple[int, IntArray]:
    """Return the least of the functions that may move, and all: not those of ends held fast."""
    turning = np.any(physical.rotational_compliance_rad_n_m, axis=(0, 2, 3))
    ends = [*np.array(SLOPES)[turning], *np.array(DEFLECTIONS)[physical.gives_way]]
    free = np.array(sorted([*ends, *range(HERMITE, functions)]), dtype=np.int64)
    return int(free[0]), free


def _stiffness(physical: PhysicalHanger, bar: Bar) -> FloatArray:
    """Bar, shear and lateral springs (n, planes, functions, functions)."""
    ratio = stiffness_ratio(physical)
    total = bar.bending + ratio[..., None, None] * bar.tension[:, None]
    if np.any(physical.tension_gradient_n):
        total += gradient_ratio(physical)[..., None, None] * bar.gradient[:, None]
    if bar.functions.strains:
        flexibility = physical.shear_compliance_1_n[:, None] * bending_unit(physical, 2)
        rigid = 1 / np.maximum(flexibility, 1 / _RIGID_IN_SHEAR)
        total += rigid[..., None, None] * bar.shear[:, None]
    for spring in physical.springs:
        w = bar.deflections(along(physical, spring.x_m[:, None]))
        share = spring.stiffness_n_m[:, : ratio.shape[1]] / bending_unit(physical, 3)
        total = _added(total, share[..., None, None] * (w.transpose(0, 2, 1) @ w)[:, None])
    return np.asarray(total)


def _sag(physical: PhysicalHanger, bar: Bar, free: IntArray) -> FloatArray:
    """Return the stiffness that sag adds (n, planes, unknowns, unknowns).

    A motion w stretches it by the integral of y' w', y a string's parabola (Irvine 1981, 2.4).
    Stretching stiffens under compression as under tension.
    """
    pull = bar.area[:, None, free]
    dyad = pull[..., :, None] * pull[..., None, :]
    stretch = np.abs(stiffness_ratio(physical)) * physical.sag_parameter
    return np.asarray(stretch[..., None, None] * dyad)


def _mass(physical: PhysicalHanger, bar: Bar) -> FloatArray:
    """Bar, rotary inertia and point masses (n or 1, 1, functions, functions)."""
    bar_kg = physical.mass_per_length_kg_m * physical.length_m
    total = bar.mass
    if np.any(physical.rotary_inertia_kg_m):
        total = total + rotary_ratio(physical)[:, None, None] * bar.rotation
    if physical.masses:
        x_m = np.stack([each.x_m for each in physical.masses], axis=1)
        share = np.stack([each.mass_kg for each in physical.masses], axis=1) / bar_kg[:, None]
        w = bar.deflections(along(physical, x_m))
        total = _added(total, (w * share[..., None]).transpose(0, 2, 1) @ w)
    for mass in physical.masses:
        if mass.radius_of_gyration_m is not None:
            slope = bar.slopes(along(physical, mass.x_m[:, None]))
            turning = mass.mass_kg / bar_kg
            turning = turning * (mass.radius_of_gyration_m / physical.length_m) ** 2
            total = _added(total, turning[:, None, None] * (slope.transpose(0, 2, 1) @ slope))
    return np.asarray(total[:, None])


def _added(total: FloatArray, term: FloatArray) -> FloatArray:
    """With a term of the functions that deflect, which come first."""
    missing = total.shape[-1] - term.shape[-1]
    around = [(0, 0)] * (term.ndim - 2) + [(0, missing)] * 2
    return np.asarray(total + np.pad(term, around) if missing else total + term)


def invert_root(matrices: FloatArray) -> FloatArray:
    """Return the inverses (..., d, d) of Cholesky's factors of definite matrices (..., d, d).

    By substitution, which takes half of the time of a general inverse.
    """
    lower = np.asarray(np.linalg.cholesky(matrices), dtype=float)
    found = np.zeros_like(lower)
    pivot = 1 / np.einsum("...ii->...i", lower)
    for row in range(lower.shape[-1]):
        found[..., row, row] = pivot[..., row]
        above = np.einsum("...k,...kj->...j", lower[..., row, :row], found[..., :row, :row])
        found[..., row, :row] = -pivot[..., row, None] * above
    return found
