"""emcee, vectorised: 32 walkers from the prior, as long as its documentation asks.

It stops at 50 autocorrelation times, and no later than at 20,000 steps; two autocorrelation times
are left out as burn-in. It gives no evidence.
"""

from __future__ import annotations

import emcee
import numpy as np
from problem import Outcome, Target, moments, report

_WALKERS = 32
_MOST_STEPS = 20_000


def run(target: Target, seed: int) -> Outcome:
    """One run."""
    rng = np.random.default_rng(seed)
    start = target.parameters(rng.random((_WALKERS, target.dimension)))
    sampler = emcee.EnsembleSampler(
        _WALKERS, target.dimension, target.log_likelihood, vectorize=True
    )
    sampler.random_state = np.random.RandomState(seed).get_state()
    for _ in sampler.sample(start, iterations=_MOST_STEPS):
        steps = sampler.iteration
        if steps % 500 == 0 and steps > 50 * longest_time(sampler):
            break
    time = longest_time(sampler)
    theta_f = sampler.get_chain(discard=int(2 * time), flat=True)[:, 0]
    return Outcome(None, None, len(theta_f) / time, *moments(theta_f))


def longest_time(sampler: emcee.EnsembleSampler) -> float:
    """The largest autocorrelation time of the parameters, in steps."""
    return float(np.max(sampler.get_autocorr_time(tol=0)))


if __name__ == "__main__":
    report("emcee", run)
