"""nautilus, vectorised, default settings (2000 live points, 10,000 effective samples)."""

from __future__ import annotations

import numpy as np
from nautilus import Sampler
from problem import Outcome, Target, moments, report


def run(target: Target, seed: int) -> Outcome:
    """One run; nautilus claims 1/sqrt(effective samples) as the error of the log evidence."""
    sampler = Sampler(
        target.parameters,
        target.log_likelihood,
        n_dim=target.dimension,
        vectorized=True,
        pass_dict=False,
        seed=seed,
    )
    sampler.run()
    points, log_weights, _ = sampler.posterior()
    return Outcome(
        float(sampler.log_z),
        float(sampler.n_eff**-0.5),
        float(sampler.n_eff),
        *moments(points[:, 0], np.exp(log_weights)),
    )


if __name__ == "__main__":
    report("nautilus-sampler", run)
