"""Natural frequencies and vectors of a batch of systems.

The eigenvalues are mu = 1/omega^2 of A = L^-1 M L^-T with K = L L^T: the stiffness is factorised,
not the mass, so that springs from soft to rigid do no harm and the lowest modes, which have the
largest mu, come out best. Where supports let a hanger go, or it is in compression, K + shift M
takes the place of K.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.values import BoolArray, FloatArray, IntArray

_LEAST = 1e-6
"""What omega^2 is taken for where a bar buckles."""

_ROUNDING = 1e-15
"""Smaller mu than this share of the largest one are noise."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Modes of (rows) systems, lowest first: `omega_squared` (rows, modes), inf for those left out.

    `vectors` (rows, unknowns, modes) have unit modal mass; None unless asked for.
    """

    omega_squared: FloatArray
    vectors: FloatArray | None

    def without(self, left_out: BoolArray) -> Spectrum:
        """The modes `left_out` (rows, modes) become the last ones."""
        squared = np.where(left_out, np.inf, self.omega_squared)
        order = np.argsort(squared, axis=1, kind="stable")
        return Spectrum(np.take_along_axis(squared, order, axis=1), self._vectors(order))

    def taken(self, order: IntArray) -> Spectrum:
        """The modes `order` (rows, fewer modes)."""
        return Spectrum(np.take_along_axis(self.omega_squared, order, axis=1), self._vectors(order))

    def first(self, modes: int) -> Spectrum:
        vectors = None if self.vectors is None else self.vectors[:, :, :modes]
        return Spectrum(self.omega_squared[:, :modes], vectors)

    def _vectors(self, order: IntArray) -> FloatArray | None:
        if self.vectors is None:
            return None
        return np.take_along_axis(self.vectors, order[:, None], axis=2)


def spectrum(
    stiffness: FloatArray, mass: FloatArray, shift: FloatArray, with_vectors: bool
) -> Spectrum:
    """All modes of systems (rows, unknowns, unknowns).

    `shift` (rows,) makes K + shift M definite.
    """
    held = stiffness + shift[:, None, None] * mass if np.any(shift) else stiffness
    inverse = np.linalg.inv(np.linalg.cholesky(held))
    transposed = inverse.transpose(0, 2, 1)
    reduced = inverse @ mass @ transposed
    if not with_vectors:
        lone = np.asarray(np.linalg.eigvalsh(reduced)[:, ::-1], dtype=float)
        return Spectrum(_omega_squared(lone, shift), None)
    rising, vectors = np.linalg.eigh(reduced)
    mu = rising[:, ::-1]
    unit = vectors[:, :, ::-1] / np.sqrt(_resolved(mu))[:, None]
    return Spectrum(_omega_squared(mu, shift), transposed @ unit)


def _omega_squared(mu: FloatArray, shift: FloatArray) -> FloatArray:
    return np.asarray(np.maximum(1 / _resolved(mu) - shift[:, None], _LEAST))


def _resolved(mu: FloatArray) -> FloatArray:
    """Of falling mu (rows, modes): what rounding leaves of a motion without mass is none."""
    return np.maximum(mu, _ROUNDING * mu[:, :1])
