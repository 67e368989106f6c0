"""dynesty's static nested sampler with random walks (500 live points, dlogz 0.509).

By default it draws evenly from ellipsoids below ten dimensions; here these hold so little of what
is likelier that a run had not ended after 570 s.
"""

from __future__ import annotations

import dynesty
import numpy as np
from problem import Outcome, Target, report
from run_dynesty import outcome


def run(target: Target, seed: int) -> Outcome:
    """One run; dynesty evaluates point by point."""
    sampler = dynesty.NestedSampler(
        target.at,
        target.parameters,
        target.dimension,
        sample="rwalk",
        rstate=np.random.default_rng(seed),
    )
    sampler.run_nested(print_progress=False)
    return outcome(sampler.results)


if __name__ == "__main__":
    report("dynesty", run)
