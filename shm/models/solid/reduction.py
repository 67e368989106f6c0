"""A small basis that stands for the solid model over its whole prior box, and the model on it.

Modes of the full model at a few points of the box span a reservoir. It is compressed by proper
orthogonal decomposition in the energy of a reference stiffness (Kunisch and Volkwein 2001), and
K(theta), a polynomial of the tension and affine in springs, is projected once. Points are chosen
greedily: the next one is where two compressions of the reservoir differ most, which estimates the
error; the full model there tells the true one. It ends when that error was small several times
running.

A bending plane of the full solid model and its modes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np
import scipy

from shm.values import BoolArray, FloatArray


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


# Numerical: amid its range; a mode's part below 1e-6 of its energy's root changes no frequency by
# 1e-12; a mass below 1e-14 of the largest is rounding.
_REFERENCE_SPRING_N_M = 1e8
_NEGLIGIBLE = 1e-6
_LOST_IN_ROUNDING = 1e-14

# Technical: together they keep 100 held-out points and 100 corners within 0.007 % of the full model
# (tests/benchmarks/solid_models.py). More of any cost full solutions, once a description.
_CANDIDATES = 300
_MOST_CORNERS = 128
_MOST_POINTS = 200
_GOOD_IN_A_ROW = 10
_SHARE_OF_TARGET = 0.25
TARGET_ERROR = 1e-4
"""In frequency, over the whole prior box."""


@dataclass(frozen=True, eq=False)
class Box:
    """The range of tension in N and of log10 k of the springs, (1 + springs,) each."""

    lower: FloatArray
    upper: FloatArray

    def corners(self, most: int, rng: np.random.Generator) -> FloatArray:
        """All corners, or `most` of them by chance."""
        if len(self.lower) > 12:
            chosen = rng.integers(0, 2, (most, len(self.lower))).astype(bool)
        else:
            chosen = np.array(list(product([False, True], repeat=len(self.lower))))
            chosen = chosen[rng.permutation(len(chosen))[:most]]
        return np.where(chosen, self.upper, self.lower)

    def spread(self, n: int, rng: np.random.Generator) -> FloatArray:
        """`n` points (n, 1 + springs) anywhere in the box."""
        return rng.uniform(self.lower, self.upper, (n, len(self.lower)))


@dataclass(eq=False)
class Reservoir:
    """The span of all modes computed so far, orthonormal in the energy of a reference."""

    system: AffineSystem
    reference: scipy.sparse.csc_array
    vectors: FloatArray = field(init=False)
    coordinates: FloatArray = field(init=False)
    matrices: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.vectors = np.zeros((self.system.unknowns, 0))
        self.coordinates = np.zeros((0, 0))
        self.matrices = np.zeros((4 + len(self.system.springs), 0, 0))

    def add(self, modes: Modes) -> None:
        """Take in further modes; what earlier ones span already adds no vector."""
        energy = np.sqrt(np.einsum("ij,ij->j", modes.vectors, self.reference @ modes.vectors))
        new = modes.vectors / energy
        rest = self._beyond(self._beyond(new))
        gram = rest.T @ (self.reference @ rest)
        strength, direction = np.linalg.eigh(gram)
        significant = strength > _NEGLIGIBLE**2
        added = self._beyond(rest @ (direction[:, significant] / np.sqrt(strength[significant])))
        self.matrices = self._grown(added)
        self.vectors = np.hstack([self.vectors, added])
        padding = np.zeros((added.shape[1], self.coordinates.shape[1]))
        known = np.vstack([self.coordinates, padding])
        self.coordinates = np.hstack([known, self.vectors.T @ (self.reference @ new)])

    def _beyond(self, vectors: FloatArray) -> FloatArray:
        """Return the part of `vectors` outside of the span."""
        known = self.vectors @ (self.vectors.T @ (self.reference @ vectors))
        return np.asarray(vectors - known)

    def _grown(self, added: FloatArray) -> FloatArray:
        """Return the projected matrices (mass first), rows and columns of `added` vectors in."""
        system, old, count = self.system, self.vectors.shape[1], added.shape[1]
        grown = np.zeros((len(self.matrices), old + count, old + count))
        grown[:, :old, :old] = self.matrices
        full = (
            system.mass, system.stiffness, system.by_tension, system.by_square,
            *system.springs.values(),
        )  # fmt: skip
        for target, matrix in zip(grown, full, strict=True):
            image = matrix @ added
            target[:old, old:] = self.vectors.T @ image
            target[old:, :old] = target[:old, old:].T
            target[old:, old:] = added.T @ image
        return grown

    @property
    def size(self) -> int:
        return int(self.vectors.shape[1])

    def whole(self) -> Projected:
        """Return the system on all vectors."""
        return self.compressed(self.size)[1]

    def compressed(self, unknowns: int) -> tuple[FloatArray, Projected]:
        """Return the basis (reservoir, n) of the strongest directions, and the system on it.

        Directions whose mass is lost in rounding, local motions of very high frequency, are left
        out of it.
        """
        strongest = np.linalg.svd(self.coordinates, full_matrices=False)[0][:, :unknowns]
        mass = strongest.T @ self.matrices[0] @ strongest
        share, direction = np.linalg.eigh(mass)
        significant = share > _LOST_IN_ROUNDING * share[-1]
        basis = strongest @ (direction[:, significant] / np.sqrt(share[significant]))
        projected = basis.T @ self.matrices[1:] @ basis
        return basis, Projected((projected + projected.swapaxes(1, 2)) / 2)


def reduce(
    system: AffineSystem, box: Box, modes: int, progress: Callable[[float], None]
) -> Reduction:
    """Return the smallest basis with an estimated error within `TARGET_ERROR` over `box`.

    `progress` hears the fraction done, as far as it can be told.
    """
    rng = np.random.default_rng(1)
    corners = box.corners(_MOST_CORNERS, rng)
    candidates = np.vstack([box.spread(_CANDIDATES, rng), corners])
    reservoir, solutions = _filled(system, box, candidates, modes, progress)
    basis, projected, error = _smallest(reservoir, candidates, modes)
    progress(1.0)
    return Reduction(
        projected,
        system.axis_m,
        (system.axis_deflection @ reservoir.vectors) @ basis,
        solutions,
        error,
    )


def _filled(
    system: AffineSystem,
    box: Box,
    candidates: FloatArray,
    modes: int,
    progress: Callable[[float], None],
) -> tuple[Reservoir, int]:
    """Return a reservoir good over the candidates, and how many full solutions it holds."""
    middle = (box.lower + box.upper) / 2
    springs = np.full(len(system.springs), _REFERENCE_SPRING_N_M)
    reservoir = Reservoir(system, stiffness(system, float(middle[0]), springs))
    for point in (middle, box.lower, box.upper):
        reservoir.add(_solution(system, point, modes))
    good, solutions, unused = 0, 3, np.ones(len(candidates), dtype=bool)
    while good < _GOOD_IN_A_ROW and solutions < _MOST_POINTS:
        worst = _least_certain(reservoir, candidates, unused, modes)
        unused[worst] = False
        truth = _solution(system, candidates[worst], modes)
        error = _error(reservoir.whole(), candidates[[worst]], truth.frequencies_hz[None])
        good = good + 1 if error[0] < _SHARE_OF_TARGET * TARGET_ERROR else 0
        reservoir.add(truth)
        solutions += 1
        progress(min(0.99, max(good / _GOOD_IN_A_ROW, solutions / _MOST_POINTS)))
    return reservoir, solutions


def _solution(system: AffineSystem, point: FloatArray, modes: int) -> Modes:
    return natural_modes(system, float(point[0]), 10 ** point[1:], modes)


def _error(projected: Projected, points: FloatArray, truth_hz: FloatArray) -> FloatArray:
    """Return the worst fractional error (m,) of each point's frequencies (m, modes)."""
    reduced_hz = projected.frequencies_hz(points, truth_hz.shape[1])
    return np.asarray(np.abs(reduced_hz / truth_hz - 1).max(axis=1))


def _least_certain(
    reservoir: Reservoir, candidates: FloatArray, unused: BoolArray, modes: int
) -> int:
    """Return the unused candidate where the reservoir and most of it differ most."""
    whole = reservoir.whole().frequencies_hz(candidates, modes)
    most = reservoir.compressed(max(modes, int(0.8 * reservoir.size)))[1]
    return int(np.where(unused, _error(most, candidates, whole), -1.0).argmax())


def _smallest(
    reservoir: Reservoir, candidates: FloatArray, modes: int
) -> tuple[FloatArray, Projected, float]:
    """Return the smallest compression within the target of the reservoir, and its worst error."""
    whole = reservoir.whole().frequencies_hz(candidates, modes)
    within, worst = (1 - _SHARE_OF_TARGET) * TARGET_ERROR, 0
    for unknowns in range(modes, reservoir.size + 1):
        basis, projected = reservoir.compressed(unknowns)
        last = unknowns == reservoir.size
        # Where one too small erred most the next one mostly errs too, and the others cost time.
        if not last and _error(projected, candidates[[worst]], whole[[worst]])[0] >= within:
            continue
        errors = _error(projected, candidates, whole)
        worst = int(errors.argmax())
        if errors[worst] < within:
            break
    return basis, projected, float(errors[worst])


@dataclass(frozen=True, eq=False)
class Projected:
    """K(theta) on a basis whose mass matrix is the unit matrix.

    `matrices` (3 + springs, n, n): stiffness, what 1 N and what 1 N^2 of tension adds, springs of
    1 N/m per node.
    """

    matrices: FloatArray

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
    the full model were needed; `estimated_error` is the worst against the reservoir.
    """

    projected: Projected
    axis_m: FloatArray
    deflections: FloatArray
    solutions: int
    estimated_error: float
