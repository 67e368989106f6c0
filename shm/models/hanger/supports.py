"""What holds a bar's ends (stiffness from compliance), gives way and swings.

An end deflects by the sum of its support's modes. The further ones are unknowns of their own, so
that the first one's deflection is the end's without theirs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from shm.models.hanger.functions import DEFLECTIONS
from shm.models.hanger.physical import PhysicalHanger, SupportMode
from shm.values import FloatArray, IntArray

_HELD = 1e-13
"""The flexibility left to a held end, as a share of the bar's own."""
_HELD_TURNED = 1e-9
"""The same where springs are turned: their stiffness is the inverse of a matrix."""


@dataclass(frozen=True, eq=False)
class Swing:
    """One mode of the support at an end: a mass on a spring, without units, both (n, planes).

    It deflects by the sum of the unknowns `at`, each with its `sign`.
    """

    stiffness: FloatArray
    mass: FloatArray
    at: IntArray
    sign: FloatArray

    def deflection(self, vectors: FloatArray) -> FloatArray:
        """Of vectors (rows, axes, unknowns, modes): (rows, axes, modes)."""
        return np.asarray((vectors[:, :, self.at] * self.sign[:, None]).sum(axis=2))


def swings(physical: PhysicalHanger, kept: IntArray) -> tuple[Swing, ...]:
    """Those of the ends whose deflections are among the functions `kept`; first modes first.

    The unknowns of further modes follow the kept functions'.
    """
    firsts: list[Swing] = []
    others: list[Swing] = []
    for end in np.flatnonzero(physical.gives_way):
        deflection = int(np.flatnonzero(kept == DEFLECTIONS[end])[0])
        first, *further = _at_end(physical, int(end), deflection, len(kept) + len(others))
        firsts.append(first)
        others += further
    return (*firsts, *others)


def _at_end(physical: PhysicalHanger, end: int, deflection: int, unknown: int) -> Iterator[Swing]:
    """The first mode, then the further ones, whose own unknowns begin with `unknown`."""
    first = SupportMode(physical.translational_compliance_m_n, physical.support_mass_kg)
    further = [each for each in physical.support_modes if np.any(each.compliance_m_n[:, end])]
    own = np.arange(unknown, unknown + len(further))
    alone = np.where(np.arange(1 + len(own)) == 0, 1.0, -1.0)
    yield _swing(physical, first, end, np.array([deflection, *own]), alone)
    for each, at in zip(further, own, strict=True):
        yield _swing(physical, each, end, np.array([at]), np.ones(1))


def _swing(
    physical: PhysicalHanger, mode: SupportMode, end: int, at: IntArray, sign: FloatArray
) -> Swing:
    spring_n_m = translational_n_m(physical, mode.compliance_m_n)[:, end]
    mass_kg = np.where(mode.compliance_m_n > 0, mode.mass_kg, 0.0)[:, end]
    bar_kg = (physical.mass_per_length_kg_m * physical.length_m)[:, None]
    return Swing(spring_n_m / bending_unit(physical, 3), mass_kg / bar_kg, at, sign)


def on_swings(
    stiffness: FloatArray, mass: FloatArray, found: tuple[Swing, ...]
) -> tuple[FloatArray, FloatArray]:
    """A bar's stiffness and mass with those of what swings at its ends.

    The bar's stiffness may be overwritten.
    """
    more = max((int(swing.at[-1]) + 1 for swing in found), default=0) - stiffness.shape[-1]
    if more > 0:
        around = [(0, 0), (0, 0), (0, more), (0, more)]
        stiffness, mass = np.pad(stiffness, around), np.pad(mass, around)
    if any(np.any(swing.mass) for swing in found):
        mass = np.broadcast_to(mass, stiffness.shape).copy()
    for swing in found:
        square = (..., swing.at[:, None], swing.at)
        signs = np.outer(swing.sign, swing.sign)
        stiffness[square] += swing.stiffness[..., None, None] * signs
        if np.any(swing.mass):
            mass[square] += swing.mass[..., None, None] * signs
    return stiffness, mass


def bending_unit(physical: PhysicalHanger, power: int) -> FloatArray:
    """EI/L^power (n, planes)."""
    return np.asarray(physical.bending_stiffness_n_m2 / physical.length_m[:, None] ** power)


def are_coupled(physical: PhysicalHanger) -> bool:
    """Whether a deflection in one plane bends any of the hangers in the other."""
    compliance = physical.rotational_compliance_rad_n_m
    return compliance.shape[-1] > 1 and bool(np.any(compliance[..., 0, 1]))


def rotational_n_m_rad(physical: PhysicalHanger) -> FloatArray:
    """Of the end springs (n, ends, planes, planes)."""
    compliance = physical.rotational_compliance_rad_n_m
    own = np.einsum("nepp->nep", compliance)
    unit = 1 / bending_unit(physical, 1)[:, None]
    if not are_coupled(physical):
        stiffness = 1 / np.maximum(own, _HELD * unit)
        return np.asarray(stiffness[..., None] * np.eye(own.shape[-1]))
    own = own + _HELD_TURNED * unit
    both = compliance[..., 0, 1]
    determinant = own[..., 0] * own[..., 1] - both**2
    matrix = np.stack([own[..., 1], -both, -both, own[..., 0]], axis=-1) / determinant[..., None]
    return np.asarray(matrix.reshape(compliance.shape))


def translational_n_m(physical: PhysicalHanger, compliance_m_n: FloatArray) -> FloatArray:
    """Of supports of a compliance (n, ends, planes); 0 for a free end."""
    least = _HELD / bending_unit(physical, 3)[:, None]
    return np.asarray(1 / np.maximum(compliance_m_n, least))
