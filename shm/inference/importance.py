"""The last step: adaptive importance sampling from t mixtures fitted to the sampler's population.

It gives the evidence without the bias and the scatter of the stages, with the error of a plain
mean, and independent weighted draws of the posterior. Each trial batch is drawn from a mixture
refitted to all trials before, every draw weighed against the mixture of all batches' proposals
(Cornuet et al. 2012, adaptive multiple importance sampling). The weights of draws that were fitted
to are too small, so that the answer rests on fresh draws from the last mixture alone. Shares of it
come from the prior (Hesterberg 1995, defensive mixture) and from the sampler's earlier, wider
stages: no weight is unbounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from shm.inference.mixture import TMixture
from shm.inference.problem import Points, Problem
from shm.inference.search import Anchors
from shm.inference.tmcmc import effective, normalised, systematic
from shm.inference.valley import along
from shm.values import FloatArray

_CLUSTERS = 16
_TAIL_CLUSTERS = 6
_FROM_TAILS = 0.35
_LATER = 0.3
_FROM_PRIOR = 0.1
_VALLEY_CLUSTERS = 10
_FROM_VALLEYS = 0.5
_FROM_ANCHORS = 0.2
_ENOUGH_ERROR = 0.06
_UNSEEN = 1.25
_AIMED_ERROR = 0.025
_TRIAL = 600
_MOST_TRIALS = 10
_ATTEMPTS = 3
_POOR = 0.4
_ENOUGH_TO_FIT = 1.0
_FEWEST, _MOST = 3000, 12000
_EXTENSION = 4000
_MOST_EXTENSIONS = 4
_FEWEST_TO_FIT = 10
_BATCHES = 4


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
        """Standard error of `log_evidence`, by the delta method.

        Somewhat widened: draws seldom hold their share of the largest weights.
        """
        square_mean = np.sum(np.exp(2 * (self.log_weights - self.log_evidence))) / self.draws
        return float(_UNSEEN * np.sqrt((square_mean - 1) / self.draws))

    @property
    def effective_sample_size(self) -> float:
        """Kish's effective number of draws."""
        return effective(normalised(self.log_weights))

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
    wider: Sequence[FloatArray] = (),
) -> Weighted:
    """Draws until `enough` effective ones and a standard error of 0.06, within reason.

    `population` (n, d) follows the posterior, each (n, d) of `wider` an earlier stage: these keep
    a share of all proposals, for the tails. The first mixture holds the anchors and the valleys
    through them too, lest the population have missed one that matters. Where too few of the final
    draws are effective, they become trials, and others are drawn.
    """
    tails = _tails(wider, rng)
    core = _first(problem, population, anchors, rng)
    trial = _Pool(problem, tails)
    for _ in range(_ATTEMPTS):
        core = _adapted(core, trial, enough, rng)
        final = _Pool(problem, tails)
        _fill(final, core, trial.share(), enough, rng)
        if final.weighted().effective_sample_size >= _POOR * enough:
            break
        trial.absorb(final)
    return final.weighted()


def _first(
    problem: Problem, population: FloatArray, anchors: Anchors, rng: np.random.Generator
) -> TMixture:
    """A mixture on the population, on the valleys through the anchors, and on the anchors."""
    valleys = TMixture.of(along(problem, anchors, rng), _VALLEY_CLUSTERS, rng)
    found = TMixture.of(population, _CLUSTERS, rng).mixed(valleys, _FROM_VALLEYS)
    return found.joined(anchors.normals(0.0), _FROM_ANCHORS)


def _adapted(core: TMixture, trial: _Pool, enough: float, rng: np.random.Generator) -> TMixture:
    """The mixture refitted to all trial draws, batch by batch."""
    for _ in range(_MOST_TRIALS):
        trial.draw(core, _TRIAL, rng)
        weighted = trial.weighted()
        core = core.refitted(weighted.points.z, _to_fit(weighted))
        if weighted.effective_sample_size >= _ENOUGH_TO_FIT * enough:
            break
    return core


def _tails(stages: Sequence[FloatArray], rng: np.random.Generator) -> TMixture | None:
    """A mixture for the earlier stages, the later the more; None where there are none."""
    tails = None
    for stage in stages:
        fitted = TMixture.of(stage, _TAIL_CLUSTERS, rng)
        tails = tails.mixed(fitted, _LATER) if tails else fitted
    return tails


def _fill(
    final: _Pool, core: TMixture, share: float, enough: float, rng: np.random.Generator
) -> None:
    """Draws from one mixture, of which a `share` is expected to be effective.

    Their number is set beforehand: to stop as soon as the weights look even would prefer samples
    that have missed a large one.
    """
    needed = max(enough, 1 / _AIMED_ERROR**2) / share
    final.draw(core, int(np.clip(needed, _FEWEST, _MOST)), rng)
    for _ in range(_MOST_EXTENSIONS):
        if _suffices(final.weighted(), enough):
            break
        final.draw(core, _EXTENSION, rng)


def _suffices(weighted: Weighted, enough: float) -> bool:
    return weighted.effective_sample_size >= enough and weighted.log_evidence_sd <= _ENOUGH_ERROR


def _to_fit(weighted: Weighted) -> FloatArray:
    """Weights to fit to, raised to a power below 1 where too few draws carry them."""
    fewest = min(_FEWEST_TO_FIT * weighted.points.z.shape[1], len(weighted.log_weights) / 2)
    power = 1.0
    weights = normalised(weighted.log_weights)
    while effective(weights) < fewest:
        power *= 0.8
        weights = normalised(power * weighted.log_weights)
    return weights


class _Pool:
    """All draws so far, each with the log density of the mixture of all batches' proposals.

    A proposal is a core of its own and what all have in common: the prior and the `tails`, whose
    density at a draw is found once.
    """

    def __init__(self, problem: Problem, tails: TMixture | None):
        self._problem = problem
        self._tails = tails
        self._from_tails = _FROM_TAILS if tails else 0.0
        self._proposals: list[tuple[TMixture, int]] = []
        self._z: FloatArray = np.empty((0, problem.dimension))
        self._predicted: list[FloatArray] = []
        self._log_common: FloatArray = np.empty(0)
        self._log_posterior: FloatArray = np.empty(0)
        self._log_drawn: FloatArray = np.empty(0)

    def draw(self, core: TMixture, draws: int, rng: np.random.Generator) -> None:
        """One more batch; draws outside of the prior are counted, not evaluated."""
        n = rng.binomial(draws, _FROM_PRIOR)
        mixture = core.mixed(self._tails, _FROM_TAILS) if self._tails else core
        z = np.vstack([self._problem.coordinates.draw_prior(n, rng), mixture.draw(draws - n, rng)])
        log_prior = self._problem.coordinates.log_prior(z)
        inside = np.isfinite(log_prior)
        z, log_prior = z[inside], log_prior[inside]
        points = self._problem.evaluate(z)
        log_posterior = log_prior + self._problem.likelihood.marginal(points.predicted)
        log_common = self._common(z, log_prior)
        self._append([(core, draws)], z, [points.predicted], log_common, log_posterior)

    def absorb(self, other: _Pool) -> None:
        """Takes over the draws of another pool of the same problem and tails."""
        self._append(
            other._proposals, other._z, other._predicted, other._log_common, other._log_posterior
        )

    def _append(
        self,
        proposals: list[tuple[TMixture, int]],
        z: FloatArray,
        predicted: list[FloatArray],
        log_common: FloatArray,
        log_posterior: FloatArray,
    ) -> None:
        old = self._drawn(proposals, self._z, self._log_common)
        self._proposals += proposals
        new = self._drawn(self._proposals, z, log_common)
        self._log_drawn = np.append(np.logaddexp(self._log_drawn, old), new)
        self._z = np.vstack([self._z, z])
        self._predicted += predicted
        self._log_common = np.append(self._log_common, log_common)
        self._log_posterior = np.append(self._log_posterior, log_posterior)

    def weighted(self) -> Weighted:
        """The draws with their weights."""
        points = Points(self._z, np.vstack(self._predicted))
        log_weights = self._log_posterior - self._log_drawn
        draws = sum(k for _, k in self._proposals)
        return Weighted(points, log_weights + np.log(draws), draws)

    def share(self) -> float:
        """Effective draws as a share of all."""
        weighted = self.weighted()
        return weighted.effective_sample_size / weighted.draws

    def _common(self, z: FloatArray, log_prior: FloatArray) -> FloatArray:
        """Log density (n,) of the prior's and the tails' shares of every proposal."""
        log_common = np.log(_FROM_PRIOR) + log_prior
        if self._tails is None:
            return np.asarray(log_common)
        share = np.log1p(-_FROM_PRIOR) + np.log(_FROM_TAILS)
        return np.asarray(np.logaddexp(log_common, share + self._tails.log_density(z)))

    def _drawn(
        self, proposals: list[tuple[TMixture, int]], z: FloatArray, log_common: FloatArray
    ) -> FloatArray:
        """Log of how many draws per volume (n,) the proposals, each of so many, put at `z`."""
        share = np.log1p(-_FROM_PRIOR) + np.log1p(-self._from_tails)
        parts = [
            np.log(draws) + np.logaddexp(log_common, share + core.log_density(z))
            for core, draws in proposals
        ]
        return np.asarray(logsumexp(parts, axis=0))
