"""What holds the ends of a bar: stiffness from compliance."""

from __future__ import annotations

import numpy as np

from shm.models.hanger.physical import PhysicalHanger
from shm.values import FloatArray

_HELD = 1e-13
"""The flexibility left to a held end, as a share of the bar's own."""

_HELD_TURNED = 1e-9
"""The same where springs are turned: their stiffness is the inverse of a matrix."""


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
