"""The posterior density of a hypothesis over its coordinates, and its slopes by differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shm.gap.contract import Hypothesis
from shm.gap.coordinates import Branch
from shm.gap.likelihood import Likelihood
from shm.gap.problem import GapProblem
from shm.inference.coordinates import log_normal
from shm.values import BoolArray, FloatArray

_DIFFERENCE = 1e-4  # technical: forward differences err by half of it times the curvature
_STEEPEST = 1e3
"""Slopes beyond this are cliffs: where a support's own mode crosses one of the bar, the names of
the two change places. Nothing can be followed over them."""


@dataclass(frozen=True, eq=False)
class Views:
    """The data seen from `m` points w (m, d): `residual` (m, data), measured less predicted.

    `slopes` (m, data, d) are the prediction's derivatives by w; `log_posterior` (m,) is the log of
    likelihood times prior density by w.
    """

    w: FloatArray
    residual: FloatArray
    slopes: FloatArray
    log_posterior: FloatArray

    def where(self, chosen: BoolArray, other: Views) -> Views:
        """These views where `chosen` (m,), elsewhere `other`."""
        return Views(
            np.where(chosen[:, None], self.w, other.w),
            np.where(chosen[:, None], self.residual, other.residual),
            np.where(chosen[:, None, None], self.slopes, other.slopes),
            np.where(chosen, self.log_posterior, other.log_posterior),
        )

    def take(self, rows: BoolArray) -> Views:
        """The views of some rows."""
        return Views(self.w[rows], self.residual[rows], self.slopes[rows], self.log_posterior[rows])


class Landscape:
    """The posterior of a hypothesis, by the problem's own likelihood or by another one."""

    def __init__(
        self, problem: GapProblem, hypothesis: Hypothesis, likelihood: Likelihood | None = None
    ):
        self.problem = problem
        self.hypothesis = hypothesis
        self.likelihood = likelihood or problem.likelihood(hypothesis)
        self.coordinates = problem.coordinates(hypothesis)
        self._value = problem.observations.value

    def residual(self, z: FloatArray) -> FloatArray:
        """Measured less predicted (n, data) at z (n, d)."""
        with np.errstate(all="ignore"):
            return np.asarray(self._value - self.problem.predict(self.hypothesis, z))

    def log_posterior(self, z: FloatArray) -> FloatArray:
        """Log of likelihood times prior density by z (n, d), (n,)."""
        return self.likelihood.log(self.residual(z)) + log_normal(z)

    def views(self, w: FloatArray, signs: FloatArray, known: FloatArray | None = None) -> Views:
        """From points w (m, d), each on the branch of `signs` (m, d), all in one batch.

        `known` (m, data, d) are slopes of near points, of which those by the nearly linear
        parameters are taken over.
        """
        m, d = w.shape
        moved = np.arange(d) if known is None else self.coordinates.other
        shifted = w + _DIFFERENCE * np.concatenate([np.zeros((1, 1, d)), np.eye(d)[moved, None]])
        branch = Branch(np.tile(signs, (len(shifted), 1)))
        residual = self.residual(branch.z(shifted.reshape(-1, d))).reshape(len(shifted), m, -1)
        slopes = np.empty((m, residual.shape[2], d)) if known is None else known.copy()
        slopes[:, :, moved] = np.moveaxis(residual[0] - residual[1:], 0, -1) / _DIFFERENCE
        likelihood = self.likelihood.log(residual[0])
        likelihood = np.where(np.isfinite(slopes).all(axis=(1, 2)), likelihood, -np.inf)
        slopes[np.abs(slopes) > _STEEPEST] = 0.0
        return Views(w, residual[0], slopes, likelihood + log_normal(w))
