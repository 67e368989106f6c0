"""Hangers for the general model, and a discretisation of another make to hold it against."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigsh

from shm.models.hanger import PhysicalHanger, solve
from shm.values import FloatArray
from tests.helpers.hangers import HANGER_3

LENGTH, TENSION = HANGER_3.length_m, HANGER_3.nominal_tension_n
EI, MASS = HANGER_3.bending_stiffness_n_m2, HANGER_3.mass_per_length_kg_m
NOWHERE = np.empty(0)
_SLIGHT = 1e-4

_BENDING = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], float)
_TENSION = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]) / 30
_MASS = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420


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


def elements_hz(
    stiffness: Callable[[float], float],
    mass: Callable[[float], float],
    breaks: Sequence[float],
    modes: int,
    *,
    tension: float = TENSION,
    masses: Sequence[tuple[float, float]] = (),
    springs: Sequence[tuple[float, float]] = (),
) -> FloatArray:
    """Frequencies (modes,) of a clamped bar of hanger 3's length by 300 Hermite elements.

    `stiffness` and `mass` per length are functions of x with steps at `breaks`; `masses` and
    `springs` are (x, size). Elements crowd at the breaks: right to 1e-7.
    """
    cuts = np.unique([0.0, *breaks, *(x for x, _ in (*masses, *springs)), LENGTH])
    pieces = [
        a + (b - a) * (1 - np.cos(np.linspace(0, np.pi, max(24, int(300 * (b - a) / LENGTH))))) / 2
        for a, b in pairwise(cuts)
    ]
    nodes = np.unique(np.concatenate(pieces))
    k, m = np.zeros((2, 2 * len(nodes), 2 * len(nodes)))
    for index, (a, b) in enumerate(pairwise(nodes)):
        h, middle, window = b - a, (a + b) / 2, slice(2 * index, 2 * index + 4)
        scale = np.outer([1, h, 1, h], [1, h, 1, h])
        k[window, window] += scale * (_BENDING * stiffness(middle) / h**3 + _TENSION * tension / h)
        m[window, window] += scale * _MASS * mass(middle) * h
    for matrix, points in ((k, springs), (m, masses)):
        for x, size in points:
            at = 2 * int(np.argmin(np.abs(nodes - x)))
            matrix[at, at] += size
    inside = slice(2, -2)
    found = eigsh(
        csc_array(k[inside, inside]),
        modes,
        csc_array(m[inside, inside]),
        sigma=0,
        return_eigenvectors=False,
    )
    return np.sqrt(np.sort(found)) / (2 * np.pi)
