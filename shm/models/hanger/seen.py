"""What sensors see of modes, and how joints and springs damp them."""

from __future__ import annotations

import numpy as np

from shm.models.hanger.bar import Bar
from shm.models.hanger.breaks import along
from shm.models.hanger.functions import SLOPES
from shm.models.hanger.motion import Motion
from shm.models.hanger.physical import PhysicalHanger
from shm.models.hanger.springs import rotational_n_m_rad
from shm.models.hanger.system import System
from shm.values import FloatArray


def shapes(
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
