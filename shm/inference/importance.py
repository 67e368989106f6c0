"""Adaptive importance sampling along the valley of a posterior (`shm.inference.valley`).

It gives the evidence, with the error of a plain mean, and independent weighted draws. Each trial
batch is drawn from a mixture refitted to all trials. The weights of draws that were fitted to are
too small, so that the answer rests on fresh draws from the last mixture alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from shm.inference.mixture import Pool, effective, evidence_error, normalised, systematic, tempered
from shm.inference.posterior import Density
from shm.inference.valley import Draws, Proposal
from shm.values import ENOUGH_EFFECTIVE, FloatArray

# Numerical: the cost of a batch, and of all.
_TRIAL, _MOST_TRIALS = 400, 8
_FIRST, _FEWEST = 2.0, 200
_MOST_EXTENSIONS, _LONGEST, _MOST = 3, 3.0, 10_000
_HOPELESS = ENOUGH_EFFECTIVE / _MOST  # of the trials: the most draws would not give enough

_FEWEST_TO_FIT = 10  # effective draws a parameter: fewer make a covariance nearly singular
_BATCHES = 4  # Gelman and Rubin's few chains: a quarter of the draws each


@dataclass(frozen=True, eq=False)
class Weighted:
    """Weighted draws with log weights (n,), of `draws` that were made."""

    points: Draws
    log_weights: FloatArray
    draws: int

    @property
    def log_evidence(self) -> float:
        """log of the mean weight."""
        return float(scipy.special.logsumexp(self.log_weights) - np.log(self.draws))

    @property
    def log_evidence_sd(self) -> float:
        """Standard error of `log_evidence`."""
        return evidence_error(self.log_weights, self.draws)

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

    def resampled(self, n: int, rng: np.random.Generator) -> Draws:
        """`n` equally weighted points."""
        return self.points.take(systematic(normalised(self.log_weights), n, rng))

    def spread(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Return `n` different points (n, d) where most of the weight is, more evenly weighted."""
        weights = tempered(self.log_weights, n / 2)
        lots = np.log(weights + np.finfo(float).tiny) + rng.gumbel(size=len(weights))
        return np.asarray(self.points.z[np.argsort(-lots)[:n]])


def weigh(density: Density, first: Proposal, enough: float, rng: np.random.Generator) -> Weighted:
    """Draw until `enough` draws are effective and the evidence is as certain as asked.

    Where next to none is effective, the trials are returned: another start is needed.
    """
    proposal, trial = first, _pool()
    fewest = _FEWEST_TO_FIT * density.dimension
    for _ in range(_MOST_TRIALS):
        _draw(density, trial, proposal, _TRIAL, rng)
        weights = tempered(trial.log_weights, min(fewest, len(trial.batch.z) / 2))
        proposal = proposal.refitted(trial.batch, weights)
        if trial.effective >= min(enough, fewest):
            break
    if trial.effective < _HOPELESS * trial.draws:
        return Weighted(trial.batch, trial.log_weights, trial.draws)
    final = _final(density, proposal, enough, rng)
    return Weighted(final.batch, final.log_weights, final.draws)


def _final(
    density: Density,
    proposal: Proposal,
    enough: float,
    rng: np.random.Generator,
) -> Pool[Proposal, Draws]:
    """Return draws from one proposal, `enough` of them effective.

    A first batch tells how many more are needed. To stop as soon as the weights look even would
    prefer samples that have missed a large one.
    """
    final = _pool()
    _draw(density, final, proposal, int(_FIRST * enough), rng)
    for _ in range(_MOST_EXTENSIONS):
        error = Weighted(final.batch, final.log_weights, final.draws).log_evidence_sd
        short = max(enough / final.effective, (error / density.largest_error) ** 2)
        if short <= 1 or final.draws >= _MOST:
            break
        more = int(np.clip((short - 1) * final.draws, _FEWEST, _LONGEST * final.draws))
        more = min(more, _MOST - final.draws)
        _draw(density, final, proposal, more, rng)
    return final


def _pool() -> Pool[Proposal, Draws]:
    return Pool(lambda proposal, draws: proposal.log_density(draws))


def _draw(
    density: Density,
    pool: Pool[Proposal, Draws],
    proposal: Proposal,
    n: int,
    rng: np.random.Generator,
) -> None:
    """Add a batch of `n` draws to the pool."""
    draws = proposal.draw(density, n, rng)
    pool.add(proposal, n, draws, density.log_posterior(draws))
