"""The last step: adaptive importance sampling from a t mixture fitted to the sampler's population.

It gives the evidence without the bias and the scatter of the stages, with the error of a plain
mean, and independent weighted draws of the posterior. The mixture is fitted anew to its own draws,
resampled and moved, a few times (Cappe et al. 2004, population Monte Carlo); the best one is used.
A share of the draws comes from the prior (Hesterberg 1995, defensive mixture), so that no weight
is unbounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from shm.update.mixture import Normal, TMixture
from shm.update.problem import Points, Problem
from shm.update.search import Anchors
from shm.update.tmcmc import Mover, normalised, systematic
from shm.values import FloatArray

_CLUSTERS = 16
_FROM_PRIOR = 0.1
_FROM_ANCHORS = 0.2
_ENOUGH_ERROR = 0.05
_BATCH = 4000
_ADAPTATIONS = 4
_MOST_BATCHES = 6
_REFIT = 2000
_BATCHES = 4
_REFIT_STEPS = 6


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
        return float(1 / np.sum(normalised(self.log_weights) ** 2))

    @property
    def r_hat(self) -> float:
        """Potential scale reduction (Gelman and Rubin 1992) of independent batches, the worst.

        Each batch estimates mean and variance of every parameter by its own weights.
        """
        moments = [self._moments(slice(batch, None, _BATCHES)) for batch in range(_BATCHES)]
        means, variances = np.swapaxes(moments, 0, 1)
        return float(np.sqrt(1 + means.var(axis=0, ddof=1) / variances.mean(axis=0)).max())

    def _moments(self, part: slice) -> tuple[FloatArray, FloatArray]:
        weights = normalised(self.log_weights[part])[:, None]
        z = self.points.z[part]
        mean = (weights * z).sum(axis=0)
        return mean, (weights * (z - mean) ** 2).sum(axis=0) + np.finfo(float).tiny

    def resampled(self, n: int, rng: np.random.Generator) -> Points:
        """`n` equally weighted points."""
        return self.points.take(systematic(normalised(self.log_weights), n, rng))

    def joined(self, other: Weighted) -> Weighted:
        """Both sets of draws as one."""
        return Weighted(
            self.points.joined(other.points),
            np.append(self.log_weights, other.log_weights),
            self.draws + other.draws,
        )


def weigh(
    problem: Problem,
    population: FloatArray,
    anchors: Anchors,
    enough: float,
    rng: np.random.Generator,
) -> Weighted:
    """Draws from the best mixture until `enough` effective ones and a standard error of 0.05.

    The first mixtures hold the anchors too, lest the population have missed one that matters.
    """
    mixture, weighted = _adapted(problem, population, anchors, enough, rng)
    for _ in range(_MOST_BATCHES):
        if _suffices(weighted, enough):
            break
        weighted = weighted.joined(_batch(problem, mixture, rng))
    return weighted


def _suffices(weighted: Weighted, enough: float) -> bool:
    return weighted.effective_sample_size >= enough and weighted.log_evidence_sd <= _ENOUGH_ERROR


def _adapted(
    problem: Problem,
    population: FloatArray,
    anchors: Anchors,
    enough: float,
    rng: np.random.Generator,
) -> tuple[TMixture, Weighted]:
    """The mixture with the most effective draws among a few refits, and a first batch of it."""
    tried: list[tuple[TMixture, Weighted]] = []
    for _ in range(1 + _ADAPTATIONS):
        clusters = TMixture.of(population, _CLUSTERS, rng)
        mixture = clusters.joined(anchors.normals(0.0), _FROM_ANCHORS)
        weighted = _batch(problem, mixture, rng)
        tried.append((mixture, weighted))
        if _suffices(weighted, enough):
            break
        mover = Mover(problem, 0.0, Normal.of(population), step=0.3)
        population = mover.walk(weighted.resampled(_REFIT, rng), _REFIT_STEPS, rng).z
    return max(tried, key=lambda pair: pair[1].effective_sample_size)


def _batch(problem: Problem, mixture: TMixture, rng: np.random.Generator) -> Weighted:
    from_prior = rng.binomial(_BATCH, _FROM_PRIOR)
    z = np.vstack([problem.draw_prior(from_prior, rng), mixture.draw(_BATCH - from_prior, rng)])
    z = z[np.isfinite(problem.log_prior(z))]
    points = problem.evaluate(z)
    log_drawn = np.logaddexp(
        np.log(_FROM_PRIOR) + problem.log_prior(z),
        np.log1p(-_FROM_PRIOR) + mixture.log_density(z),
    )
    return Weighted(points, problem.log_posterior(points) - log_drawn, _BATCH)
