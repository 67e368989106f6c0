"""Modes of the general hanger model, what sensors see of them, and how joints and springs damp
them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.hanger.bar import Bar, along, bar_of, by_plane
from shm.models.hanger.functions import SLOPES
from shm.models.hanger.motion import Motion, motion
from shm.models.hanger.physical import HangerModes, LateralSpring, PhysicalHanger, SupportMode
from shm.models.hanger.system import System, are_coupled, rotational_n_m_rad, system
from shm.values import PLANES, FloatArray

_PLANES = len(PLANES)


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
    for law in physical.mode_laws:
        frequency = frequency * law.factor(modes)
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


def shapes_seen(
    physical: PhysicalHanger, bar: Bar, parts: System, vectors: FloatArray, places_m: FloatArray
) -> FloatArray:
    """(n, planes, modes, places, 2), largest of all places 1."""
    rows = len(physical.tension_n)
    x = along(physical, np.broadcast_to(places_m, (rows, len(places_m))))
    moved = _deflected(bar, parts, vectors, x).transpose(0, 1, 4, 3, 2)
    turned = _turned(moved, physical.sensor_turn_rad[:, None, None])
    flat = turned.reshape(*turned.shape[:3], -1)
    highest, lowest = flat.max(axis=-1, initial=0.0), flat.min(axis=-1, initial=0.0)
    largest = np.where(highest >= -lowest, highest, lowest)[..., None, None]
    return np.asarray(turned / np.where(largest == 0, 1.0, largest))


def _deflected(bar: Bar, parts: System, vectors: FloatArray, x: FloatArray) -> FloatArray:
    """Deflections at `x` (n, points): (n, planes, axes, points, modes)."""
    w = bar.deflections(x)[:, :, parts.kept]
    return np.asarray(w[:, None, None] @ vectors)


def _turned(moved: FloatArray, angle: FloatArray) -> FloatArray:
    """Components (..., places, axes) as sensors turned by `angle` (..., places) see them."""
    if not np.any(angle):
        return moved
    cosine, sine = np.cos(angle), np.sin(angle)
    across, along_bridge = moved[..., 0], moved[..., 1]
    return np.stack(
        [cosine * across + sine * along_bridge, cosine * along_bridge - sine * across], axis=-1
    )


def has_losses(physical: PhysicalHanger) -> bool:
    """Whether anything adds damping."""
    springs = any(np.any(spring.loss_factor) for spring in physical.springs)
    return springs or bool(np.any(physical.joint_loss_factor))


def damping_ratios(
    physical: PhysicalHanger, bar: Bar, parts: System, found: Motion, vectors: FloatArray
) -> FloatArray:
    """Half the loss factors, weighted by the share of the strain energy, (n, planes, modes)."""
    energy = (physical.mass_per_length_kg_m * physical.length_m**3)[:, None, None]
    energy = energy * found.omega_rad_s**2
    lost = np.zeros_like(energy)
    stiffness = rotational_n_m_rad(physical) * physical.joint_loss_factor[..., None, None]
    for end, slope in enumerate(SLOPES):
        at = parts.unknown(slope)
        if at is not None:
            turn = vectors[:, :, :, at]
            axes = stiffness.shape[-1]
            lost += np.einsum(
                "npam,nab,npbm->npm", turn[:, :, :axes], stiffness[:, end], turn[:, :, :axes]
            )
    for spring in physical.springs:
        x = along(physical, spring.x_m[:, None])
        moved = (
            _deflected(bar, parts, vectors, x)[:, :, :, 0] * physical.length_m[:, None, None, None]
        )
        stiff = (spring.stiffness_n_m * spring.loss_factor[:, None])[:, None, :, None]
        lost += (stiff * moved**2).sum(axis=2)
    return np.asarray(lost / (2 * energy))
