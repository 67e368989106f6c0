"""Markov chains of the affine-invariant ensemble sampler emcee (Foreman-Mackey et al. 2013).

They go on where importance sampling has too few effective draws, and check it on request.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from shm.values import FloatArray

# Numerical: walkers for each parameter; steps until the chain is fifty times as long as the mean
# autocorrelation time, which leaves its estimate within a tenth.
_WALKERS_A_PARAMETER, _FEWEST_WALKERS = 8, 64
_BLOCK, _MOST_STEPS, _LONG_ENOUGH = 250, 2000, 50
_DISCARDED = 0.3
_FROZEN = 1e-9
_SPREAD = 1e-4


class Posterior(Protocol):
    """A density that can be evaluated up to a constant."""

    @property
    def dimension(self) -> int:
        """Return how many coordinates a point has."""

    def evaluate(self, z: FloatArray) -> Any:
        """Return the points z (n, d) with what the density needs of them."""

    def log_posterior(self, points: Any) -> FloatArray:
        """Return the log density (n,) of evaluated points."""


def run_chain(
    problem: Posterior, start: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, float, float]:
    """Return points (n, d) of the posterior, how many of them are effective, and R-hat.

    R-hat compares the walkers' means with their scatter (Gelman and Rubin 1992), the worst
    parameter counts. The walkers start at points drawn from `start` (m, d).
    """
    # Its moves load all of scipy.stats, and most posteriors need none of them.
    from emcee import EnsembleSampler
    from emcee.autocorr import integrated_time
    from emcee.moves import DEMove, DESnookerMove, StretchMove

    count = max(_FEWEST_WALKERS, _WALKERS_A_PARAMETER * problem.dimension)
    walkers = start[rng.choice(len(start), count, replace=len(start) < count)]
    walkers = walkers + _SPREAD * rng.standard_normal(walkers.shape)
    sampler = EnsembleSampler(
        count,
        problem.dimension,
        lambda z: problem.log_posterior(problem.evaluate(z)),
        moves=[(DEMove(), 0.6), (StretchMove(), 0.3), (DESnookerMove(), 0.1)],
        vectorize=True,
    )
    sampler.random_state = np.random.RandomState(rng.integers(2**32)).get_state()
    state, length = walkers, np.inf
    for done in range(_BLOCK, _MOST_STEPS + 1, _BLOCK):
        state = sampler.run_mcmc(state, _BLOCK, skip_initial_state_check=True)
        chain = sampler.get_chain(discard=int(_DISCARDED * done))
        moving = chain[:, (np.ptp(chain, axis=0) > _FROZEN).any(axis=1)]
        if moving.shape[1]:
            length = float(np.max(integrated_time(moving, tol=0)))
        if done > _LONG_ENOUGH * length:
            break
    points = moving.reshape(-1, problem.dimension)
    if not np.isfinite(length):
        return points, 0.0, np.inf
    between, within = moving.mean(axis=0).var(axis=0, ddof=1), moving.var(axis=0).mean(axis=0)
    return points, len(points) / length, float(np.sqrt(1 + between / within).max())
