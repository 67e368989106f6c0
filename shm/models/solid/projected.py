"""A solid model on its reduced basis: what is kept of it, and how it is evaluated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray

TARGET_ERROR = 1e-4
"""In frequency, over the whole prior box."""


@dataclass(frozen=True, eq=False)
class Projected:
    """K(theta) on a basis whose mass matrix is the unit matrix.

    `matrices` (2 + springs, n, n): stiffness, initial stress of 1 N, springs of 1 N/m per node.
    """

    matrices: FloatArray

    @property
    def unknowns(self) -> int:
        return int(self.matrices.shape[1])

    def stiffness(self, points: FloatArray) -> FloatArray:
        """K (m, n, n) at points (m, 1 + springs) of tension in N and log10 k."""
        factors = np.column_stack([np.ones(len(points)), points[:, :1], 10 ** points[:, 1:]])
        flat = self.matrices.reshape(len(self.matrices), -1)
        square = (len(points), self.unknowns, self.unknowns)
        return np.asarray((factors @ flat).reshape(square))

    def frequencies_hz(self, points: FloatArray, modes: int) -> FloatArray:
        """The lowest frequencies (m, modes) at points (m, 1 + springs)."""
        eigenvalues = np.linalg.eigvalsh(self.stiffness(points))[:, :modes]
        return np.asarray(np.sqrt(eigenvalues) / (2 * np.pi))

    def mode(self, point: FloatArray, order: int) -> FloatArray:
        """The coordinates (n,) of one mode at a point (1 + springs,)."""
        return np.asarray(np.linalg.eigh(self.stiffness(point[None])[0])[1][:, order - 1])


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
