"""A bending plane of the full solid model, affine in tension and springs, and its modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from shm.values import FloatArray


@dataclass(frozen=True, eq=False)
class AffineSystem:
    """K(theta) = K_e + T K_sigma + sum of k_j S_j over the springs j, and the mass.

    Matrices are (unknowns, unknowns). `springs` belong to 1 N/m a node, by the name of their
    parameter. `axis_deflection` (points, unknowns) gives the deflection of the hanger's axis at
    `axis_m` (points,) from the deck end.
    """

    stiffness: scipy.sparse.csr_array
    initial_stress: scipy.sparse.csr_array
    springs: Mapping[str, scipy.sparse.csr_array]
    mass: scipy.sparse.csr_array
    axis_deflection: scipy.sparse.csr_array
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


def stiffness(
    system: AffineSystem, tension_n: float, springs_n_m: FloatArray
) -> scipy.sparse.csc_array:
    """K(theta) for the springs (springs,) per node, in the order of the system's."""
    total = system.stiffness + tension_n * system.initial_stress
    for spring, value in zip(system.springs.values(), springs_n_m, strict=True):
        total = total + value * spring
    return scipy.sparse.csc_array(total)


def natural_modes(
    system: AffineSystem, tension_n: float, springs_n_m: FloatArray, modes: int
) -> Modes:
    """The lowest modes, by Lanczos iterations with the factorised stiffness."""
    matrix = stiffness(system, tension_n, springs_n_m)
    inverse = scipy.sparse.linalg.LinearOperator(matrix.shape, matvec=factorised(matrix).solve)
    # A fixed start makes the result the same each time.
    start = np.ones(system.unknowns)
    eigenvalues, vectors = scipy.sparse.linalg.eigsh(
        matrix, k=modes, M=scipy.sparse.csc_array(system.mass), sigma=0.0, OPinv=inverse, v0=start
    )
    order = np.argsort(eigenvalues)
    return Modes(eigenvalues[order], vectors[:, order])


def factorised(matrix: scipy.sparse.csc_array) -> scipy.sparse.linalg.SuperLU:
    """The factors of a symmetric positive definite matrix."""
    return scipy.sparse.linalg.splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
