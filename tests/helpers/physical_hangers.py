"""Hangers for the general model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.models.hanger import PhysicalHanger, solve
from shm.values import FloatArray
from tests.helpers.hangers import HANGER_3

LENGTH, TENSION = HANGER_3.length_m, HANGER_3.nominal_tension_n
EI, MASS = HANGER_3.bending_stiffness_n_m2, HANGER_3.mass_per_length_kg_m
NOWHERE = np.empty(0)
_SLIGHT = 1e-4


def clamped(rows: int = 1, sensors: int = 0) -> PhysicalHanger:
    """`rows` copies of hanger 3."""
    return PhysicalHanger.clamped(HANGER_3, np.full(rows, TENSION), sensors)


def of_slenderness(xi: FloatArray) -> PhysicalHanger:
    """Clamped hangers with L sqrt(T/EI) = xi (n,), by their bending stiffness; 0: no tension."""
    stretched = xi > _SLIGHT
    stiffness = np.where(stretched, TENSION * (LENGTH / np.where(stretched, xi, 1)) ** 2, EI)
    hanger = PhysicalHanger.clamped(HANGER_3, np.where(stretched, TENSION, 0.0))
    return replace(hanger, bending_stiffness_n_m2=np.repeat(stiffness[:, None], 2, axis=1))


def on_springs(
    hanger: PhysicalHanger, deck_n_m_rad: FloatArray, arch_n_m_rad: FloatArray
) -> PhysicalHanger:
    """With rotational springs (n, planes) at the ends, from 0 to inf."""
    with np.errstate(divide="ignore"):
        compliance = 1 / np.stack([deck_n_m_rad, arch_n_m_rad], axis=1)
    diagonal = np.zeros((*compliance.shape, 2))
    diagonal[..., 0, 0], diagonal[..., 1, 1] = compliance[..., 0], compliance[..., 1]
    return replace(hanger, rotational_compliance_rad_n_m=diagonal)


def frequencies_hz(hanger: PhysicalHanger, modes: int) -> FloatArray:
    """(n, 2, modes)."""
    return solve(hanger, modes, NOWHERE, shapes=False).frequency_hz
