"""Modes of the general hanger model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.hanger.breaks import bar_of, by_plane
from shm.models.hanger.motion import Motion, motion
from shm.models.hanger.physical import HangerModes, LateralSpring, PhysicalHanger, SupportMode
from shm.models.hanger.seen import damping_ratios, has_losses
from shm.models.hanger.seen import shapes as shapes_seen
from shm.models.hanger.springs import are_coupled
from shm.models.hanger.system import system
from shm.values import FloatArray

_PLANES = 2


def solve(
    physical: PhysicalHanger, modes: int, places_m: FloatArray, shapes: bool = True
) -> HangerModes:
    """The first `modes` modes of each plane of n hangers, seen by sensors at `places_m` (places,).

    With `shapes` false the shapes are empty, (n, 2, modes, 0, 2), and the damping that loss factors
    add is not found (NaN): the frequencies alone cost half as much. Motions of a free bar as a
    whole are no modes, nor are a support's own: for each of its masses the one with the largest
    share of the kinetic energy there. Joints lose energy by their rotation. A bar that buckles gets
    a first frequency next to nothing. Frequencies are right to 1e-6 for L sqrt(T/EI) up to 150;
    with the heaviest masses and deepest changes of section of the catalogue to 3e-5 up to 15, to
    1e-4 beyond.
    """
    asked = one_plane(physical) if planes_alike(physical) else physical
    extra = _PLANES if asked.gives_way.any() else 0
    bar = bar_of(asked, modes + extra)
    parts = system(asked, bar)
    found = motion(asked, parts, modes, shapes)
    frequency = found.omega_rad_s / (2 * np.pi) * physical.clock_factor[:, None, None]
    frequency = _both(frequency)
    if not shapes:
        unknown = np.nan if has_losses(physical) else 0.0
        none = np.empty((*frequency.shape, 0, 2))
        return HangerModes(frequency, none, np.full(frequency.shape, unknown))
    assert found.vectors is not None
    vectors = _both_axes(found.vectors)
    both = Motion(_both(found.omega_rad_s), vectors)
    damping = (
        damping_ratios(physical, bar, parts, both, vectors)
        if has_losses(physical)
        else np.zeros(frequency.shape)
    )
    return HangerModes(frequency, shapes_seen(physical, bar, parts, vectors, places_m), damping)


def _both(values: FloatArray) -> FloatArray:
    """(n, 1 or 2, modes) to (n, 2, modes)."""
    return np.repeat(values, _PLANES // values.shape[1], axis=1)


def _both_axes(vectors: FloatArray) -> FloatArray:
    """Vectors of one plane stand for the other as well."""
    if vectors.shape[1] == _PLANES:
        return vectors
    both = np.zeros((len(vectors), _PLANES, _PLANES, *vectors.shape[3:]))
    both[:, 0, 0] = both[:, 1, 1] = vectors[:, 0, 0]
    return both


def planes_alike(physical: PhysicalHanger) -> bool:
    """Whether all the hangers are the same in both planes."""
    compliance = physical.rotational_compliance_rad_n_m
    pairs = [
        physical.bending_stiffness_n_m2,
        np.einsum("nepp->nep", compliance),
        physical.translational_compliance_m_n,
        physical.support_mass_kg,
        physical.sag_parameter,
        *(spring.stiffness_n_m for spring in physical.springs),
        *(
            field
            for mode in physical.support_modes
            for field in (mode.compliance_m_n, mode.mass_kg)
        ),
        *(by_plane(zone) for zone in physical.zones),
    ]
    alike = all(np.array_equal(pair[..., 0], pair[..., -1]) for pair in pairs)
    return alike and not are_coupled(physical)


def one_plane(physical: PhysicalHanger) -> PhysicalHanger:
    """The transverse plane alone."""
    return replace(
        physical,
        bending_stiffness_n_m2=physical.bending_stiffness_n_m2[:, :1],
        rotational_compliance_rad_n_m=physical.rotational_compliance_rad_n_m[:, :, :1, :1],
        translational_compliance_m_n=physical.translational_compliance_m_n[:, :, :1],
        support_mass_kg=physical.support_mass_kg[:, :, :1],
        sag_parameter=physical.sag_parameter[:, :1],
        zones=tuple(
            replace(zone, stiffness_factor=by_plane(zone)[:, :1]) for zone in physical.zones
        ),
        springs=tuple(
            LateralSpring(each.x_m, each.stiffness_n_m[:, :1], each.loss_factor)
            for each in physical.springs
        ),
        support_modes=tuple(
            SupportMode(each.compliance_m_n[..., :1], each.mass_kg[..., :1])
            for each in physical.support_modes
        ),
    )
