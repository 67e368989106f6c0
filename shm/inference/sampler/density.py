"""A posterior density in coordinates with a standard normal prior, and its peaks.

Levenberg and Marquardt's steps lead to the peaks from several starts at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.inference.sampler.coordinates import log_normal
from shm.inference.sampler.likelihood import Likelihood
from shm.inference.sampler.mixture import Drawn
from shm.values import BoolArray, FloatArray, IntArray

# Numerical: a climb's steps, the longest in a coordinate, and the gain in log posterior that is
# none; a slope beyond is a cliff, where two modes change places.
_STEPS, _LONGEST, _NO_GAIN, _MOST_DAMPING = 25, 1.0, 0.02, 1e5
_STEEPEST, _FARTHEST = 1e3, 12.0
_BEHIND = 8.0  # numerical: of the log density; a lower peak has no share of the evidence
_SAME = 0.3  # numerical: standard deviations of a peak within which two are one

DIFFERENCE = 1e-4
"""Forward difference in z, whose prior has a standard deviation of 1. It steers climbs and
proposals, which weights correct, and is as exact as a first-order repeatability needs."""


@dataclass(frozen=True, eq=False)
class Points(Drawn):
    """Points with their predictions `predicted` (n, data)."""

    predicted: FloatArray


@dataclass(frozen=True, eq=False)
class Peak:
    """One of the most probable points `z` (d,) of a posterior, with the log density there.

    `covariance` (d, d) is that of a normal distribution on it.
    """

    z: FloatArray
    log: float
    covariance: FloatArray

    @property
    def log_evidence(self) -> float:
        """Return the log of its integral by Laplace's method (Tierney and Kadane 1986)."""
        volume = len(self.z) * np.log(2 * np.pi) + np.linalg.slogdet(self.covariance)[1]
        return float(self.log + volume / 2)


class Density(ABC):
    """The posterior of parameters z (d,) with standard normal priors, given the data `value`."""

    value: FloatArray
    dimension: int

    @property
    def largest_error(self) -> float:
        """Return the standard error of a log evidence that is wanted at most.

        A Bayes factor good to 6 %, of which 3 would be a hint.
        """
        return 0.06

    @property
    def rough(self) -> Density:
        """Return nearly the same density at less cost, for a search."""
        return self

    @property
    @abstractmethod
    def likelihood(self) -> Likelihood:
        """Return the likelihood of residuals."""

    @abstractmethod
    def predict(self, z: FloatArray) -> FloatArray:
        """Return the data (n, data) that z (n, d) predict; NaN where they cannot."""

    def residual_of(self, predicted: FloatArray) -> FloatArray:
        """Return measured less predicted (n, data)."""
        return np.asarray(self.value - predicted)

    def residual(self, z: FloatArray) -> FloatArray:
        """Return the same at z (n, d)."""
        return self.residual_of(self.predict(z))

    def log_likelihood(self, predicted: FloatArray) -> FloatArray:
        """Return the log likelihood (n,) of predictions (n, data)."""
        return self.likelihood.log(self.residual_of(predicted))

    def evaluate(self, z: FloatArray) -> Points:
        """Return the points z (n, d) with their predictions."""
        return Points(z, self.predict(z))

    def log_posterior(self, points: Points) -> FloatArray:
        """Return the log of prior times likelihood (n,); -inf without a prediction."""
        found = self.log_prior(points.z)
        known = np.isfinite(self.residual_of(points.predicted)).all(axis=1) & np.isfinite(found)
        found = np.where(known, found, -np.inf)
        if known.any():
            found[known] += self.log_likelihood(points.predicted[known])
        return np.where(np.isnan(found), -np.inf, found)

    def log(self, z: FloatArray) -> FloatArray:
        """Return the same at z (n, d)."""
        return self.log_posterior(self.evaluate(z))

    def look(
        self, z: FloatArray, directions: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the residual (n, data) at z (n, d), and slopes (n, data, k) of the prediction.

        They are derivatives along the columns of `directions` (d, k), or by all coordinates.
        """
        ways = np.eye(z.shape[1]) if directions is None else directions
        n, k = len(z), ways.shape[1]
        # Inwards, where priors do not end.
        step = np.where(z @ ways > 0, -DIFFERENCE, DIFFERENCE)
        moved = z[:, None] + step[:, :, None] * ways.T
        residual = self.residual(np.vstack([z, moved.reshape(n * k, -1)]))
        there = residual[n:].reshape(n, k, -1)
        found = (residual[:n, None] - there) / step[:, :, None]
        found = np.where(np.abs(found) < _STEEPEST, found, 0.0)
        return residual[:n], np.asarray(np.swapaxes(found, 1, 2))

    def slopes(self, z: FloatArray, directions: FloatArray | None = None) -> FloatArray:
        """Return these slopes alone."""
        return self.look(z, directions)[1]

    def follow(self, z: FloatArray, before: FloatArray, slopes: FloatArray) -> FloatArray:
        """Return derivatives (n, data, d) at z (n, d), of where those at `before` are `slopes`."""
        return self.slopes(z)

    # ------------------------------------------------ symmetries

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Return the log density (n,) of the prior, that of a fold included."""
        return log_normal(z)

    def fold(self, z: FloatArray) -> FloatArray:
        """Return the points (n, d) that stand for all that are like z by symmetry."""
        return z

    def connect(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Fold only where the posterior, that of points z (n, d), does not reach the fold."""
        return z


def find_peaks(density: Density, starts: FloatArray, hopeless: float = -np.inf) -> list[Peak]:
    """Return the distinct peaks above `starts` z (m, d), the highest first.

    A climb ends where it cannot reach the log posterior `hopeless`.
    """
    z, log = climb(density, starts, hopeless=hopeless, behind=_BEHIND)
    finite = np.isfinite(log)
    z, log = density.fold(z[finite]), log[finite]
    if not len(z):
        return []
    residual, slopes = density.look(z)
    curvature, _ = _curvature(density.likelihood, residual, slopes, z)
    found: list[Peak] = []
    for row in np.argsort(-log, kind="stable"):
        peak = Peak(z[row], float(log[row]), np.asarray(np.linalg.inv(curvature[row])))
        if not any(_same(peak, each) for each in found):
            found.append(peak)
    return found


def climb(
    density: Density,
    starts: FloatArray,
    likelihood: Likelihood | None = None,
    centre: FloatArray | None = None,
    noise: FloatArray | None = None,
    steps: int = _STEPS,
    hopeless: float = -np.inf,
    behind: float = np.inf,
) -> tuple[FloatArray, FloatArray]:
    """Move points `starts` (m, d) uphill together; return them and their log densities (m,).

    With a `centre` (m, d) the prior is centred there, with a `noise` (m, data) the data are moved
    by it; `likelihood` may be another one. Points are given up that cannot reach the log density
    `hopeless`, or come as near as `behind` to the best one.
    """
    by = likelihood or density.likelihood
    centre = np.zeros_like(starts) if centre is None else centre
    noise = np.zeros((len(starts), 1)) if noise is None else noise

    def log_at(z: FloatArray, rows: IntArray, residual: FloatArray) -> FloatArray:
        return np.asarray(by.log(residual) + log_normal(z - centre[rows]))

    z = starts.copy()
    going: IntArray = np.arange(len(starts))
    residual, slopes = density.look(z)
    residual = residual + noise
    log = log_at(z, going, residual)
    damping = np.full(len(z), 1e-2)
    hessian = np.empty((len(z), z.shape[1], z.shape[1]))
    gradient, moved = np.empty_like(z), going
    for taken in range(steps):
        if len(moved):
            away = z[moved] - centre[moved]
            hessian[moved], gradient[moved] = _curvature(by, residual[moved], slopes[moved], away)
        if not len(going):
            break
        curvature, pull = hessian[going], gradient[going][..., None]
        diagonal = np.einsum("nii->ni", curvature) * damping[going, None]
        step = np.linalg.solve(curvature + diagonal[..., None] * np.eye(z.shape[1]), pull)[..., 0]
        hoped = (pull * np.linalg.solve(curvature, pull))[..., 0].sum(axis=1)
        step /= np.maximum(np.abs(step).max(axis=1, keepdims=True) / _LONGEST, 1.0)
        tried = np.clip(z[going] + step, -_FARTHEST, _FARTHEST)
        there = density.residual(tried) + noise[going]
        log_there = log_at(tried, going, there)
        gain = log_there - log[going]
        better = gain > 0
        moved, before = going[better], z.copy()
        z[moved], residual[moved], log[moved] = tried[better], there[better], log_there[better]
        damping[going] *= np.where(better, 0.2, 6.0)
        done: BoolArray = np.asarray(better & (gain < _NO_GAIN))
        done |= (damping[going] > _MOST_DAMPING) | (hoped < _NO_GAIN)
        if taken > 3:
            done |= log[going] + 2 * hoped < max(hopeless, log.max() - behind)
        going, moved = going[~done], going[better & ~done]
        if len(moved):
            slopes[moved] = density.follow(z[moved], before[moved], slopes[moved])
    return z, log


def _curvature(
    likelihood: Likelihood, residual: FloatArray, slopes: FloatArray, away: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return Gauss and Newton's Hessian (n, d, d) and the gradient (n, d) of the log posterior."""
    known = np.asarray(np.isfinite(residual).all(axis=1))
    columns = np.concatenate([slopes, residual[..., None]], axis=2)
    columns = np.where(known[:, None, None], np.nan_to_num(columns), 0.0)
    by_node = likelihood.by_node(columns[..., -1])
    share = scipy.special.softmax(by_node, axis=1)
    mean = np.einsum("nk,nkab->nab", share, likelihood.gram(columns))
    return mean[:, :-1, :-1] + np.eye(slopes.shape[2]), mean[:, :-1, -1] - away


def _same(one: Peak, other: Peak) -> bool:
    away = np.abs(one.z - other.z) / np.sqrt(np.diag(other.covariance))
    return bool((away < _SAME).all())


def laplace(peaks: Sequence[Peak]) -> float:
    """Return the log evidence by normal distributions on the peaks."""
    return float(scipy.special.logsumexp([peak.log_evidence for peak in peaks]))
