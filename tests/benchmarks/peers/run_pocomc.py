"""pocoMC's preconditioned Monte Carlo, vectorised, default settings (512 effective particles)."""

from __future__ import annotations

import numpy as np
import pocomc
import torch
from problem import Outcome, Target, kish, moments, report
from scipy.stats import uniform


def run(target: Target, seed: int) -> Outcome:
    """One run: 4096 effective samples, 4096 draws of its flow for the evidence."""
    torch.set_num_threads(1)
    width = target.upper - target.lower
    sampler = pocomc.Sampler(
        prior=pocomc.Prior([uniform(*side) for side in zip(target.lower, width, strict=True)]),
        likelihood=target.log_likelihood,
        vectorize=True,
        random_state=seed,
    )
    sampler.run(progress=False)
    points, weights, _, _ = sampler.posterior()
    log_evidence, sd = sampler.evidence()
    return Outcome(
        float(log_evidence), float(sd), kish(np.asarray(weights)), *moments(points[:, 0], weights)
    )


if __name__ == "__main__":
    report("pocomc", run)
