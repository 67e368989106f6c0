"""dynesty's dynamic nested sampler, default settings (at least 10,000 effective samples)."""

from __future__ import annotations

import dynesty
import numpy as np
from problem import Outcome, Target, report
from run_dynesty import outcome


def run(target: Target, seed: int) -> Outcome:
    """One run; dynesty evaluates point by point."""
    sampler = dynesty.DynamicNestedSampler(
        target.at, target.parameters, target.dimension, rstate=np.random.default_rng(seed)
    )
    sampler.run_nested(print_progress=False)
    return outcome(sampler.results)


if __name__ == "__main__":
    report("dynesty", run)
