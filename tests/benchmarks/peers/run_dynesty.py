"""dynesty's static nested sampler, default settings (500 live points, dlogz 0.509)."""

from __future__ import annotations

import dynesty
import numpy as np
from problem import Outcome, Target, kish, moments, report


def run(target: Target, seed: int, sample: str = "auto") -> Outcome:
    """One run; dynesty evaluates point by point. `sample` is its way to draw a live point."""
    sampler = dynesty.NestedSampler(
        target.at,
        target.parameters,
        target.dimension,
        sample=sample,
        rstate=np.random.default_rng(seed),
    )
    sampler.run_nested(print_progress=False)
    return outcome(sampler.results)


def outcome(results: dynesty.results.Results) -> Outcome:
    """What the results of either sampler of dynesty say."""
    weights = results.importance_weights()
    return Outcome(
        float(results.logz[-1]),
        float(results.logzerr[-1]),
        kish(weights),
        *moments(results.samples[:, 0], weights),
    )


if __name__ == "__main__":
    report("dynesty", run)
