"""A bending plane of the full solid model, its modes, and a small basis that stands for it.

Modes of the full model at some points of the prior box are compressed by proper orthogonal
decomposition in the energy of a reference stiffness (Kunisch and Volkwein 2001), and K(theta), a
polynomial of the tension and affine in springs, is projected once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy

from shm.values import FloatArray


@dataclass(frozen=True, eq=False)
class AffineSystem:
    """K(theta) = K_e + T K_1 + T^2 K_2 + sum of k_j S_j over the springs j, and the mass.

    Matrices are (unknowns, unknowns). K_1 (`by_tension`) is the stiffness due to the stress of 1 N;
    where tension stretches the bar beyond what is described, K_1 and K_2 (`by_square`) have the
    change of K_e and of the stress's stiffness, too. Else K_2 is zero. `springs` belong to 1 N/m a
    node, by the name of their parameter. `axis_deflection` (points, unknowns) gives the deflection
    of the hanger's axis at `axis_m` (points,) from the deck end.
    """

    stiffness: scipy.sparse.csr_array
    by_tension: scipy.sparse.csr_array
    by_square: scipy.sparse.csr_array
    springs: Mapping[str, scipy.sparse.csr_array]
    mass: scipy.sparse.csr_array
    axis_deflection: scipy.sparse.csr_array
    axis_m: FloatArray

    @property
    def unknowns(self) -> int:
        return int(self.mass.shape[0])

    @property
    def matrices(self) -> tuple[scipy.sparse.csr_array, ...]:
        """Return all matrices, the mass first, in the order of `Projected`."""
        parts = (self.mass, self.stiffness, self.by_tension, self.by_square)
        return (*parts, *self.springs.values())


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
    total = system.stiffness + tension_n * system.by_tension
    total = total + tension_n**2 * system.by_square
    for spring, value in zip(system.springs.values(), springs_n_m, strict=True):
        total = total + value * spring
    return scipy.sparse.csc_array(total)


def natural_modes(
    system: AffineSystem, tension_n: float, springs_n_m: FloatArray, modes: int
) -> Modes:
    """Return the lowest modes, by Lanczos iterations with the factorised stiffness."""
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
    """Return the factors of a symmetric positive definite matrix."""
    return scipy.sparse.linalg.splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


TARGET_ERROR = 1e-4
"""In frequency, over the whole prior box."""
# Numerical: amid its range; a direction below 1e-12 of the energy changes no frequency by 1e-12; a
# mass below 1e-14 of the largest is rounding.
_REFERENCE_SPRING_N_M = 1e8
_NEGLIGIBLE = 1e-12
_LOST_IN_ROUNDING = 1e-14
# Technical: see tests/benchmarks/solid_models.py for the error on held-out points and corners.
_CORNERS, _INSIDE_A_PARAMETER = 24, 4
_CANDIDATES = 300


def reduce(
    system: AffineSystem,
    lower: FloatArray,
    upper: FloatArray,
    modes: int,
    progress: Callable[[float], None],
) -> Reduction:
    """Return the smallest basis that is within `TARGET_ERROR` of the span of all solved modes.

    `lower` and `upper` bound tension in N and log10 k of the springs; the modes are those at
    corners of this box and at points spread in it. `progress` hears the fraction done.
    """
    rng = np.random.default_rng(1)
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    corners = corners[rng.permutation(len(corners))]
    spread = scipy.stats.qmc.Sobol(len(lower), rng=rng).random(64)[
        : _INSIDE_A_PARAMETER * len(lower)
    ]
    points = np.vstack([corners[:_CORNERS], lower + spread * (upper - lower)])
    solved = []
    for done, point in enumerate(points):
        progress(done / len(points))
        solved.append(natural_modes(system, float(point[0]), 10 ** point[1:], modes).vectors)
    basis = _strongest(system, np.hstack(solved), float(points[:, 0].mean()))
    matrices = np.array([basis.T @ (matrix @ basis) for matrix in system.matrices])
    candidates = rng.uniform(lower, upper, (_CANDIDATES, len(lower)))
    candidates = np.vstack([candidates, corners[:128]])
    known = Projected.on(matrices)[0].frequencies_hz(candidates, modes)
    for unknowns in range(modes, len(basis.T) + 1):
        projected, mixed = Projected.on(matrices[:, :unknowns, :unknowns])
        found = projected.frequencies_hz(candidates, modes)
        error = float(np.abs(found / known - 1).max())
        if error < TARGET_ERROR / 2:
            break
    progress(1.0)
    deflections = system.axis_deflection @ basis[:, :unknowns] @ mixed
    return Reduction(projected, system.axis_m, deflections, len(points), error)


def _strongest(system: AffineSystem, shapes: FloatArray, tension_n: float) -> FloatArray:
    """Return directions (unknowns, n) that span shapes, orthonormal in energy, strongest first."""
    springs = np.full(len(system.springs), _REFERENCE_SPRING_N_M)
    reference = stiffness(system, tension_n, springs)
    shapes = shapes / np.sqrt(np.einsum("ij,ij->j", shapes, reference @ shapes))
    strength, mixed = np.linalg.eigh(shapes.T @ (reference @ shapes))
    held = np.flatnonzero(strength > _NEGLIGIBLE * strength[-1])[::-1]
    return np.asarray(shapes @ (mixed[:, held] / np.sqrt(strength[held])))


@dataclass(frozen=True, eq=False)
class Projected:
    """K(theta) on a basis whose mass matrix is the unit matrix.

    `matrices` (3 + springs, n, n): stiffness, what 1 N and what 1 N^2 of tension adds, springs of
    1 N/m per node.
    """

    matrices: FloatArray

    @classmethod
    def on(cls, matrices: FloatArray) -> tuple[Projected, FloatArray]:
        """Return the system of matrices, the mass first, and its basis in theirs.

        Directions whose mass is lost in rounding, local motions of very high frequency, are left
        out of it.
        """
        share, direction = np.linalg.eigh(matrices[0])
        significant = share > _LOST_IN_ROUNDING * share[-1]
        basis = direction[:, significant] / np.sqrt(share[significant])
        projected = basis.T @ matrices[1:] @ basis
        return cls((projected + projected.swapaxes(1, 2)) / 2), basis

    @property
    def unknowns(self) -> int:
        return int(self.matrices.shape[1])

    def stiffness(self, points: FloatArray) -> FloatArray:
        """K (m, n, n) at points (m, 1 + springs) of tension in N and log10 k."""
        tension_n, springs = points[:, :1], 10 ** points[:, 1:]
        factors = np.column_stack([np.ones(len(points)), tension_n, tension_n**2, springs])
        flat = self.matrices.reshape(len(self.matrices), -1)
        square = (len(points), self.unknowns, self.unknowns)
        return np.asarray((factors @ flat).reshape(square))

    def frequencies_hz(self, points: FloatArray, modes: int) -> FloatArray:
        """Return the lowest frequencies (m, modes) at points (m, 1 + springs)."""
        eigenvalues = np.linalg.eigvalsh(self.stiffness(points))[:, :modes]
        return np.asarray(np.sqrt(eigenvalues) / (2 * np.pi))

    def modes(self, points: FloatArray, modes: int) -> FloatArray:
        """Return the coordinates (m, n, modes) of the lowest modes at points (m, 1 + springs)."""
        return np.asarray(np.linalg.eigh(self.stiffness(points))[1][:, :, :modes])


@dataclass(frozen=True, eq=False)
class Reduction:
    """A projected system and how it was found.

    `deflections` (points, n) are its vectors along the hanger's axis at `axis_m`; `solutions` of
    the full model were needed; `estimated_error` is the worst against
    the span of all their modes.
    """

    projected: Projected
    axis_m: FloatArray
    deflections: FloatArray
    solutions: int
    estimated_error: float
