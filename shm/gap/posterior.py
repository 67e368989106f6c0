"""The posterior of one hypothesis, and its peaks.

Levenberg and Marquardt's steps lead to the peaks from several starts. Slopes by parameters in which
the data are nearly linear are taken over from step to step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import scipy

from shm.gap.contract import Hypothesis, Peak
from shm.gap.likelihood import Likelihood
from shm.inference.coordinates import log_normal
from shm.values import FloatArray, IntArray

# Numerical: a climb's steps, and the gain in log posterior that is none; forward differences in
# standard deviations of a prior; a slope beyond is a cliff, where two modes change places.
_STEPS, _NO_GAIN, _MOST_DAMPING = 25, 0.02, 1e5
_DIFFERENCE, _STEEPEST, _FARTHEST, FARTHEST_LINEAR = 1e-4, 1e3, 4.5, 12.0
_SAME = 0.3  # numerical: standard deviations of a peak within which two are one
SETTLED = 0.3
"""Numerical: of a prior's standard deviation; over less the slopes of linear parameters hold."""


class Problem(Protocol):
    """Predictions of hypotheses for one set of data."""

    @property
    def value(self) -> FloatArray:
        """Return the data (data,)."""

    def linear(self, hypothesis: Hypothesis) -> IntArray:
        """Return the columns in which predictions are nearly linear."""

    def dimension(self, hypothesis: Hypothesis) -> int:
        """Return how many parameters there are."""

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        """Return the data (n, data) that z (n, d) predict; NaN where they cannot."""

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        """Return the likelihood of residuals."""


class Target:
    """The posterior of a hypothesis in coordinates z (d,) with standard normal priors."""

    def __init__(
        self, problem: Problem, hypothesis: Hypothesis, likelihood: Likelihood | None = None
    ):
        self.problem, self.hypothesis = problem, hypothesis
        self.likelihood = likelihood or problem.likelihood(hypothesis)
        self.dimension = problem.dimension(hypothesis)
        self.linear = problem.linear(hypothesis)
        self.other: IntArray = np.setdiff1d(np.arange(self.dimension), self.linear)
        self.farthest: FloatArray = np.full(self.dimension, _FARTHEST)
        self.farthest[self.linear] = FARTHEST_LINEAR

    def residual(self, z: FloatArray) -> FloatArray:
        """Return measured less predicted (n, data) at z (n, d)."""
        with np.errstate(all="ignore"):
            return np.asarray(self.problem.value - self.problem.predict(self.hypothesis, z))

    def log(self, z: FloatArray) -> FloatArray:
        """Return the log of likelihood times prior (n,) at z (n, d)."""
        return np.asarray(self.likelihood.log(self.residual(z)) + log_normal(z))

    def view(self, z: FloatArray, known: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Return the residual (data,) and the prediction's slopes (data, d) at z (d,).

        Of `known` slopes near z those by the linear parameters are taken over.
        """
        moved = np.arange(self.dimension) if known is None else self.other
        step = np.where(z > 0, -_DIFFERENCE, _DIFFERENCE)
        residual = self.residual(np.vstack([z, z + np.diag(step)[moved]]))
        slopes = np.zeros((len(residual[0]), self.dimension)) if known is None else known.copy()
        found = (residual[0] - residual[1:]).T / step[moved]
        slopes[:, moved] = np.where(np.abs(found) < _STEEPEST, found, 0.0)
        return residual[0], slopes

    def climb(self, z: FloatArray, hopeless: float = -np.inf) -> Peak:
        """Return the peak above z (d,); gives up where it cannot reach the log posterior
        `hopeless`.
        """
        log, damping = float(self.log(z[None])[0]), 1e-2
        residual, slopes = self.view(z)
        hessian, gradient = self._curvature(z, residual, slopes)
        for taken in range(_STEPS):
            step = np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
            step = step / max(1.0, np.abs(step).max())
            tried = np.clip(z + step, -self.farthest, self.farthest)
            gain = float(self.log(tried[None])[0]) - log
            if gain > 0:
                far = np.abs(tried - z)[self.linear].max(initial=0.0) > SETTLED
                z, log, damping = tried, log + gain, damping / 5
                residual, slopes = self.view(z, None if far else slopes)
                hessian, gradient = self._curvature(z, residual, slopes)
            else:
                damping *= 6
            hoped = float(gradient @ np.linalg.solve(hessian, gradient))
            if 0 <= gain < _NO_GAIN or damping > _MOST_DAMPING or hoped < _NO_GAIN:
                break
            if taken > 3 and log + 2 * hoped < hopeless:
                break
        return Peak(z, log, np.asarray(np.linalg.inv(hessian), dtype=np.float64))

    def _curvature(
        self, z: FloatArray, residual: FloatArray, slopes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return Gauss and Newton's Hessian (d, d) and the gradient (d,) of the log posterior."""
        if not np.isfinite(residual).all():
            return np.eye(len(z)), -z
        share = scipy.special.softmax(self.likelihood.by_node(residual[None])[0])
        gram = self.likelihood.gram(np.column_stack([slopes, residual])[None])[0]
        mean = np.tensordot(share, gram, axes=1)
        return mean[:-1, :-1] + np.eye(len(z)), mean[:-1, -1] - z


def find_peaks(target: Target, starts: FloatArray, hopeless: float = -np.inf) -> list[Peak]:
    """Return the distinct peaks above `starts` z (m, d), the highest first.

    `hopeless` is the log posterior from which on a peak counts.
    """
    found: list[Peak] = []
    for z in starts:
        peak = target.climb(z, hopeless)
        if np.isfinite(peak.log) and not any(_same(peak, each) for each in found):
            found.append(peak)
    return sorted(found, key=lambda peak: -peak.log)


def _same(one: Peak, other: Peak) -> bool:
    away = np.abs(one.z - other.z) / np.sqrt(np.diag(other.covariance))
    return bool((away < _SAME).all())


def laplace(peaks: Sequence[Peak]) -> float:
    """Return the log evidence by normal distributions on the peaks."""
    return float(scipy.special.logsumexp([peak.log_evidence for peak in peaks]))
