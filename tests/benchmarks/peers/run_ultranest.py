"""ultranest's reactive nested sampler, vectorised, default settings (400 live points)."""

from __future__ import annotations

import numpy as np
import ultranest
from problem import Outcome, Target, moments, report


def run(target: Target, seed: int) -> Outcome:
    """One run; ultranest draws from numpy's global generator."""
    np.random.seed(seed)  # noqa: NPY002
    sampler = ultranest.ReactiveNestedSampler(
        target.names, target.log_likelihood, target.parameters, vectorized=True
    )
    results = sampler.run(show_status=False, viz_callback=False)
    weighted = results["weighted_samples"]
    return Outcome(
        float(results["logz"]),
        float(results["logzerr"]),
        float(results["ess"]),
        *moments(weighted["points"][:, 0], weighted["weights"]),
    )


if __name__ == "__main__":
    report("ultranest", run)
