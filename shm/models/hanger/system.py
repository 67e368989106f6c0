"""Stiffness and mass of a hanger's planes over the trial functions, without units.

Lengths are in L, stiffness in EI/L of the plane, masses in m L^3: an eigenvalue omega^2 stands for
omega^2 EI/(m L^4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.models.hanger.bar import Bar
from shm.models.hanger.breaks import along, stiffness_ratio
from shm.models.hanger.functions import DEFLECTIONS, HERMITE, SLOPES
from shm.models.hanger.physical import PhysicalHanger
from shm.models.hanger.supports import Swing, bending_unit, on_swings, rotational_n_m_rad, swings
from shm.values import FloatArray, IntArray

_RIGID_IN_SHEAR = 1e12  # numerical: a share of shear below 1e-12 is lost in rounding


@dataclass(frozen=True, eq=False)
class System:
    """Stiffness and mass (n, planes, unknowns, unknowns).

    The first unknowns are the functions `kept` of the bar, the others `swings`' own.
    """

    stiffness: FloatArray
    mass: FloatArray
    kept: IntArray
    swings: tuple[Swing, ...]

    def unknown(self, function: int) -> int | None:
        """Which unknown a function is; None where nothing lets it move."""
        found = np.flatnonzero(self.kept == function)
        return int(found[0]) if len(found) else None


def system(physical: PhysicalHanger, bar: Bar) -> System:
    """Each plane by itself."""
    stiffness, mass = _stiffness(physical, bar), _mass(physical, bar)
    turning = np.einsum("nepp->nep", rotational_n_m_rad(physical))
    turning = turning / bending_unit(physical, 1)[:, None]
    for end in range(2):
        stiffness[:, :, SLOPES[end], SLOPES[end]] += turning[:, end]
    if bar.hats:
        stiffness, mass = _condensed(stiffness, mass, bar.hats)
    first, kept = _kept(physical, stiffness.shape[-1])
    stiffness, mass = _window(stiffness, first, kept), _window(mass, first, kept)
    found = swings(physical, kept)
    stiffness, mass = on_swings(stiffness, mass, found)
    if np.any(physical.sag_parameter):
        stiffness = stiffness + _sag(physical, bar, stiffness, kept)
    return System(stiffness, mass, kept, found)


def _condensed(
    stiffness: FloatArray, mass: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Without the last `count` functions, which follow the others as in statics (Guyan 1965).

    They are shear strains without deflection. Rotary inertia alone acts on them, and it changes the
    shear strain by (radius of gyration x wave number)^2, some 1e-2: frequencies by 1e-6.
    """
    own = np.linalg.inv(stiffness[..., -count:, -count:])
    follow = -own @ stiffness[..., -count:, :-count]
    cross, transposed = mass[..., :-count, -count:] @ follow, np.swapaxes(follow, -1, -2)
    turned = transposed @ mass[..., -count:, -count:] @ follow
    return (
        stiffness[..., :-count, :-count] + stiffness[..., :-count, -count:] @ follow,
        mass[..., :-count, :-count] + cross + np.swapaxes(cross, -1, -2) + turned,
    )


def _window(matrix: FloatArray, first: int, kept: IntArray) -> FloatArray:
    """Rows and columns of the kept functions; a view where the first ones alone are left out."""
    if len(kept) == matrix.shape[-1] - first:
        return matrix[..., first:, first:]
    return matrix[..., kept[:, None], kept]


def _kept(physical: PhysicalHanger, functions: int) -> tuple[int, IntArray]:
    """All functions but those of ends that nothing lets move, and the least of them."""
    turning = np.any(physical.rotational_compliance_rad_n_m, axis=(0, 2, 3))
    ends = [*np.array(SLOPES)[turning], *np.array(DEFLECTIONS)[physical.gives_way]]
    kept = np.array(sorted([*ends, *range(HERMITE, functions)]), dtype=np.int64)
    return int(kept[0]), kept


def _stiffness(physical: PhysicalHanger, bar: Bar) -> FloatArray:
    """Bar, shear and lateral springs (n, planes, functions, functions)."""
    ratio = stiffness_ratio(physical)
    total = bar.bending + ratio[..., None, None] * bar.tension[:, None]
    if bar.counts.shear:
        flexibility = physical.shear_compliance_1_n[:, None] * bending_unit(physical, 2)
        rigid = 1 / np.maximum(flexibility, 1 / _RIGID_IN_SHEAR)
        total += rigid[..., None, None] * bar.shear[:, None]
    for spring in physical.springs:
        w = bar.deflections(along(physical, spring.x_m[:, None]))
        share = spring.stiffness_n_m[:, : ratio.shape[1]] / bending_unit(physical, 3)
        total = _added(total, share[..., None, None] * (w.transpose(0, 2, 1) @ w)[:, None])
    return np.asarray(total)


def _sag(physical: PhysicalHanger, bar: Bar, stiffness: FloatArray, kept: IntArray) -> FloatArray:
    """What a hanger that hangs in a curve adds to its stiffness (n, planes, unknowns, unknowns).

    A motion w stretches it by the integral of y' w', y the curve at rest: a string's parabola or,
    where it sags as it bends, the bar's own under its weight, as large as makes a motion by that
    very curve stretch both alike (Irvine 1981, 2.4 and 3.3).
    """
    pull = np.zeros(stiffness.shape[:3])
    pull[..., : len(kept)] = bar.area[:, None, kept]
    if physical.sags_as_it_bends:
        rest, slope = np.linalg.solve(stiffness, pull[..., None])[..., 0], np.zeros_like(pull)
        slope[..., : len(kept)] = np.einsum(
            "npj,nij->npi", rest[..., : len(kept)], bar.tension[:, kept[:, None], kept]
        )
        alike = (pull * rest).sum(axis=-1) / (slope * rest).sum(axis=-1)
        pull = alike[..., None] * slope
    dyad = pull[..., :, None] * pull[..., None, :]
    return np.asarray((stiffness_ratio(physical) * physical.sag_parameter)[..., None, None] * dyad)


def _mass(physical: PhysicalHanger, bar: Bar) -> FloatArray:
    """Bar, rotary inertia and point masses (n or 1, 1, functions, functions)."""
    bar_kg = physical.mass_per_length_kg_m * physical.length_m
    total = bar.mass
    if np.any(physical.rotary_inertia_kg_m):
        rotary = physical.rotary_inertia_kg_m / (bar_kg * physical.length_m)
        total = total + rotary[:, None, None] * bar.rotation
    if physical.masses:
        x_m = np.stack([each.x_m for each in physical.masses], axis=1)
        share = np.stack([each.mass_kg for each in physical.masses], axis=1) / bar_kg[:, None]
        w = bar.deflections(along(physical, x_m))
        total = _added(total, (w * share[..., None]).transpose(0, 2, 1) @ w)
    return np.asarray(total[:, None])


def _added(total: FloatArray, term: FloatArray) -> FloatArray:
    """With a term of the functions that deflect, which come first."""
    missing = total.shape[-1] - term.shape[-1]
    around = [(0, 0)] * (term.ndim - 2) + [(0, missing)] * 2
    return np.asarray(total + np.pad(term, around) if missing else total + term)
