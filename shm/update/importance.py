"""The last step: importance sampling from a t mixture fitted to the sampler's population.

It gives the evidence without the bias and the scatter of the stages, with an error that is that of
a plain mean, and independent weighted draws of the posterior. A share of the draws comes from the
prior (Hesterberg 1995, Technometrics 37(2), defensive mixture), so that no weight is unbounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.special import gammaln, logsumexp

from shm.update.problem import Points, Problem
from shm.update.tmcmc import Normal
from shm.values import FloatArray

_COMPONENTS = 8
_DEGREES_OF_FREEDOM = 4.0
_FROM_PRIOR = 0.1
_ENOUGH_ERROR = 0.05
_BATCH = 4000
_MOST_BATCHES = 10


@dataclass(frozen=True, eq=False)
class Weighted:
    """Draws with log weights (n,); of all `draws`, those outside of the prior weigh nothing."""

    points: Points
    log_weights: FloatArray
    draws: int

    @property
    def log_evidence(self) -> float:
        """log of the mean weight."""
        return float(logsumexp(self.log_weights) - np.log(self.draws))

    @property
    def log_evidence_sd(self) -> float:
        """Standard error of `log_evidence`, by the delta method."""
        square_mean = np.sum(np.exp(2 * (self.log_weights - self.log_evidence))) / self.draws
        return float(np.sqrt((square_mean - 1) / self.draws))

    @property
    def effective_sample_size(self) -> float:
        """Kish's effective number of draws."""
        relative = np.exp(self.log_weights - self.log_weights.max())
        return float(relative.sum() ** 2 / (relative**2).sum())

    def joined(self, other: Weighted) -> Weighted:
        """Both sets of draws as one."""
        return Weighted(
            self.points.joined(other.points),
            np.append(self.log_weights, other.log_weights),
            self.draws + other.draws,
        )


def weigh(
    problem: Problem, population: FloatArray, enough: float, rng: np.random.Generator
) -> Weighted:
    """Draws until `enough` effective ones and a standard error of 0.05, ten batches at most."""
    mixture = TMixture(population, rng)
    weighted = _batch(problem, mixture, rng)
    for _ in range(_MOST_BATCHES - 1):
        if weighted.effective_sample_size >= enough and weighted.log_evidence_sd <= _ENOUGH_ERROR:
            break
        weighted = weighted.joined(_batch(problem, mixture, rng))
    return weighted


def _batch(problem: Problem, mixture: TMixture, rng: np.random.Generator) -> Weighted:
    from_prior = rng.binomial(_BATCH, _FROM_PRIOR)
    z = np.vstack([problem.draw_prior(from_prior, rng), mixture.draw(_BATCH - from_prior, rng)])
    log_prior = problem.log_prior(z)
    z, log_prior = z[np.isfinite(log_prior)], log_prior[np.isfinite(log_prior)]
    points = problem.evaluate(z)
    log_drawn = np.logaddexp(
        np.log(_FROM_PRIOR) + log_prior, np.log1p(-_FROM_PRIOR) + mixture.log_density(z)
    )
    inside = problem.log_likelihood(points) + log_prior - log_drawn
    return Weighted(points, inside, draws=_BATCH)


class TMixture:
    """A mixture of multivariate t distributions, one on each cluster of a population (n, d)."""

    def __init__(self, population: FloatArray, rng: np.random.Generator):
        whole = Normal.of(population)
        seed = int(rng.integers(2**31))
        label = kmeans2(whole.whiten(population), _COMPONENTS, minit="++", rng=seed)[1]
        clusters = [population[label == k] for k in range(_COMPONENTS) if np.sum(label == k) > 2]
        sizes = np.array([len(cluster) for cluster in clusters])
        self.shares = sizes / sizes.sum()
        self.parts = [_shrunk(cluster, whole) for cluster in clusters]

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """`n` draws (n, d)."""
        counts = rng.multinomial(n, self.shares)
        return np.vstack([_draw_t(p, k, rng) for p, k in zip(self.parts, counts, strict=True)])

    def log_density(self, z: FloatArray) -> FloatArray:
        """Log density (n,) at `z` (n, d)."""
        parts = [np.log(s) + _log_t(p, z) for s, p in zip(self.shares, self.parts, strict=True)]
        return np.asarray(logsumexp(parts, axis=0))


def _shrunk(cluster: FloatArray, whole: Normal) -> Normal:
    """The normal of a cluster; a small one borrows covariance from the whole."""
    n, d = cluster.shape
    towards_whole = (d + 2) / (n + d + 2)
    own = np.cov(cluster.T)
    mixed = (1 - towards_whole) * own + towards_whole * whole.factor @ whole.factor.T
    return Normal(cluster.mean(axis=0), mixed)


def _draw_t(part: Normal, n: int, rng: np.random.Generator) -> FloatArray:
    nu = _DEGREES_OF_FREEDOM
    scale = np.sqrt(rng.chisquare(nu, n) / nu)
    return part.colour(rng.standard_normal((n, len(part.mean))) / scale[:, None])


def _log_t(part: Normal, z: FloatArray) -> FloatArray:
    nu, d = _DEGREES_OF_FREEDOM, z.shape[1]
    square = (part.whiten(z) ** 2).sum(axis=1)
    constant = gammaln((nu + d) / 2) - gammaln(nu / 2) - d / 2 * np.log(nu * np.pi)
    log_volume = np.log(np.diag(part.factor)).sum()
    return np.asarray(constant - log_volume - (nu + d) / 2 * np.log1p(square / nu))
