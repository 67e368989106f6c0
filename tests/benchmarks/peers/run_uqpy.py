"""UQpy's `SequentialTemperingMCMC` (TMCMC) as in its documentation's example: 20 chains a stage.

A tenth of the samples is resampled, the chains draw the rest; 2000 samples; steps of a tenth of
each prior's width, as the default of 1 does not fit these parameters. The variant that only
resamples leaves every point where it is (version 4.1.6). It evaluates point by point.
"""

from __future__ import annotations

import numpy as np
from problem import Outcome, Target, distinct, moments, report
from UQpy.distributions import JointIndependent, Normal, Uniform
from UQpy.sampling import MetropolisHastings, SequentialTemperingMCMC

_SAMPLES = 2000
_STEP = 0.1


def run(target: Target, seed: int) -> Outcome:
    """One run."""
    width = target.upper - target.lower
    prior = JointIndependent(
        [Uniform(float(a), float(b)) for a, b in zip(target.lower, width, strict=True)]
    )
    sampler = SequentialTemperingMCMC(
        log_pdf_intermediate=lambda x, power: power * target.log_likelihood(x),
        distribution_reference=prior,
        nsamples=_SAMPLES,
        sampler=MetropolisHastings(
            dimension=target.dimension,
            n_chains=20,
            proposal=JointIndependent([Normal(0.0, _STEP * float(side)) for side in width]),
            proposal_is_symmetric=True,
        ),
        percentage_resampling=10,
        random_state=np.random.RandomState(seed),
    )
    evidence = float(np.squeeze(sampler.evidence))
    points = np.asarray(sampler.samples)
    log_evidence = float(np.log(evidence)) if evidence > 0 else None
    return Outcome(log_evidence, None, distinct(points), *moments(points[:, 0]))


if __name__ == "__main__":
    report("uqpy", run)
