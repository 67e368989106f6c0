"""A bending plane of the full solid model, affine in tension and springs, and its modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from shm.values import FloatArray


@dataclass(frozen=True, eq=False)
class AffineSystem:
    """K(theta) = K_e + T K_sigma + sum of k_j S_j over the springs j, and the mass.

    Matrices are (unknowns, unknowns). `springs` belong to 1 N/m a node, by the name of their
    parameter. `axis_deflection` (points, unknowns) gives the deflection of the hanger's axis at
    `axis_m` (points,) from the deck end.
    """

    stiffness: csr_array
    initial_stress: csr_array
    springs: Mapping[str, csr_array]
    mass: csr_array
    axis_deflection: csr_array
    axis_m: FloatArray

    @property
    def unknowns(self) -> int:
        return int(self.mass.shape[0])


@dataclass(frozen=True, eq=False)
class Modes:
    """Eigenvalues (modes,) in rad^2/s^2, ascending, and eigenvectors (unknowns, modes)."""

    eigenvalues: FloatArray
    vectors: FloatArray

    @property
    def frequencies_hz(self) -> FloatArray:
        return np.asarray(np.sqrt(self.eigenvalues) / (2 * np.pi))


def stiffness(system: AffineSystem, tension_n: float, springs_n_m: FloatArray) -> csc_array:
    """K(theta) for the springs (springs,) per node, in the order of the system's."""
    total = system.stiffness + tension_n * system.initial_stress
    for spring, value in zip(system.springs.values(), springs_n_m, strict=True):
        total = total + value * spring
    return csc_array(total)


def natural_modes(
    system: AffineSystem, tension_n: float, springs_n_m: FloatArray, modes: int
) -> Modes:
    """The lowest modes, by Lanczos iterations with the factorised stiffness."""
    matrix = stiffness(system, tension_n, springs_n_m)
    inverse = LinearOperator(matrix.shape, matvec=factorised(matrix).solve)
    # A fixed start makes the result the same each time.
    start = np.ones(system.unknowns)
    eigenvalues, vectors = eigsh(
        matrix, k=modes, M=csc_array(system.mass), sigma=0.0, OPinv=inverse, v0=start
    )
    order = np.argsort(eigenvalues)
    return Modes(eigenvalues[order], vectors[:, order])


def factorised(matrix: csc_array) -> SuperLU:
    """The factors of a symmetric positive definite matrix."""
    return splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
