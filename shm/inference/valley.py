"""Points along the valleys that lead through the anchors.

Frequencies good to 1e-5 leave a valley that is 1e-4 wide, long where a stiff spring is hardly felt,
and bent. A normal distribution around its lowest point soon leaves it, and so does the population
of the sampler, or never finds it. Draws of the prior that walk there from the anchor, by least
squares, lie along its length nearly as the posterior does; weights correct for the rest. They walk
the first steps in a wider valley, of a larger model error: there the steps are longer.
"""

from __future__ import annotations

import numpy as np

from shm.inference.problem import Problem
from shm.inference.search import Anchors, carried
from shm.inference.tmcmc import normalised
from shm.values import FloatArray

_POINTS = 80
_WIDER = (10.0, 1.0)
_STEPS = 4
_DAMPING = 1e-4
_TEMPERED = 0.5
_APART = 1e-6
_FARTHEST = 15.0
_FEWEST = 30


def along(problem: Problem, anchors: Anchors, rng: np.random.Generator) -> FloatArray:
    """Points (n, d) along the valleys, most of them through the most probable anchors."""
    # Tempered, because a bent valley holds more or less than the normal around its lowest point.
    shares = normalised(_TEMPERED * anchors.log_evidence())
    chosen = rng.choice(len(shares), _POINTS, p=shares)
    prior = problem.coordinates.draw_prior(_POINTS, rng)
    # No two alike, even where they find no step down.
    z = anchors.z[chosen] + _APART * rng.standard_normal(prior.shape)
    for wider in _WIDER:
        sigma = wider * anchors.sigma[chosen]
        z = carried(problem, prior, sigma, rng, _STEPS, z, _DAMPING)
    density = problem.log_posterior(problem.evaluate(z))
    # Some do not arrive.
    least = min(density.max() - _FARTHEST, np.sort(density)[-_FEWEST])
    return np.asarray(z[density >= least])
