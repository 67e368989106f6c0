"""Adaptive importance sampling along the valley of a posterior (`shm.inference.sampler.valley`).

It gives the evidence, with the error of a plain mean, and independent weighted draws. Each trial
batch is drawn from a mixture refitted to all trials. The weights of draws that were fitted to are
too small, so that the answer rests on fresh draws from the last mixture alone.
"""

from __future__ import annotations

import numpy as np

from shm.inference.sampler.density import Density
from shm.inference.sampler.mixture import Pool, Weighted, tempered
from shm.inference.sampler.valley import Draws, Proposal
from shm.values import ENOUGH_EFFECTIVE

# Numerical: the cost of a batch, and of all.
_TRIAL, _MOST_TRIALS = 400, 8
_FIRST, _FEWEST = 2.0, 200
_MOST_EXTENSIONS, _LONGEST, _MOST = 3, 3.0, 10_000
_HOPELESS = ENOUGH_EFFECTIVE / _MOST  # of the trials: the most draws would not give enough

_FEWEST_TO_FIT = 10  # effective draws a parameter: fewer make a covariance nearly singular


def weigh(
    density: Density, first: Proposal, enough: float, rng: np.random.Generator
) -> Weighted[Draws]:
    """Draw until `enough` draws are effective and the evidence is as certain as asked.

    Where next to none is effective, the trials are returned: another start is needed.
    """
    proposal, trial = first, _pool()
    fewest = _FEWEST_TO_FIT * density.dimension
    for _ in range(_MOST_TRIALS):
        _draw(density, trial, proposal, _TRIAL, rng)
        weights = tempered(trial.log_weights, min(fewest, len(trial.batch.z) / 2))
        proposal = proposal.refitted(trial.batch, weights)
        if trial.weighted.effective_sample_size >= min(enough, fewest):
            break
    if trial.weighted.effective_sample_size < _HOPELESS * trial.draws:
        return trial.weighted
    return _final(density, proposal, enough, rng).weighted


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
        found = final.weighted
        error = found.log_evidence_sd / density.largest_error
        short = max(enough / found.effective_sample_size, error**2)
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
    pool.add(proposal, draws, density.log_posterior(draws))
