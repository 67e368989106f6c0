"""The hybrid: a cheap class's posterior says where to look for that of an expensive one.

Parameters that both classes share by name start from a widened t distribution of the hint's
samples, the others from the prior; half of all starts come from the prior alone. The hint is only
a place to start from: the importance weights correct for it, so that posterior and evidence are
those without it, and a wrong hint costs half of the starts and no more.
"""

from __future__ import annotations

import numpy as np

from shm.inference.coordinates import log_normal, quantile
from shm.inference.described import DescribedCoordinates
from shm.inference.mixture import Normal, TMixture
from shm.inference.problem import Problem
from shm.models import DESCRIPTION
from shm.values import FloatArray, IntArray, Posterior

_WIDER = 3.0
_FROM_PRIOR = 0.5


class Hint:
    """A density of starts for `problem` that follows another class's posterior.

    Parameters that ends can exchange are never shared: their names do not say which end.
    """

    def __init__(self, problem: Problem, posterior: Posterior):
        self._problem = problem
        self._columns, z = _shared_places(problem, posterior)
        found = Normal.of(z)
        self._near = TMixture([Normal(found.mean, _WIDER**2 * found.covariance)], np.ones(1))

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Starts (n, d), all inside the fold."""
        z = self._problem.coordinates.draw_prior(n, rng)
        hinted = rng.random(n) >= _FROM_PRIOR
        z[np.ix_(hinted, self._columns)] = self._near.draw(int(hinted.sum()), rng)
        return z

    def log_ratio(self, z: FloatArray) -> FloatArray:
        """Log of the density of starts over that of the prior (n,) at `z` (n, d)."""
        shared = z[:, self._columns]
        near = self._near.log_density(shared) - log_normal(shared)
        return np.asarray(np.logaddexp(np.log(_FROM_PRIOR), np.log1p(-_FROM_PRIOR) + near))


def hinted(problem: Problem, posterior: Posterior | None) -> Hint | None:
    """The hint that a posterior gives; None where there is none or no parameter is shared."""
    if posterior is None or not len(_shared_places(problem, posterior)[0]):
        return None
    return Hint(problem, posterior)


def _shared_places(problem: Problem, posterior: Posterior) -> tuple[IntArray, FloatArray]:
    """Which columns of z the posterior knows, and its draws there (n, columns)."""
    coordinates = problem.coordinates
    if isinstance(coordinates, DescribedCoordinates):
        if posterior.priors != DESCRIPTION:
            return np.empty(0, dtype=int), np.empty((0, 0))
        return coordinates.shared(posterior.names, posterior.samples)
    columns = _shared(problem, posterior)
    lower, upper = problem.prior.lower[columns], problem.prior.upper[columns]
    names = [problem.prior.names[i] for i in columns]
    samples = np.array([posterior.parameter(name) for name in names])
    samples = samples.reshape(len(names), len(posterior.samples)).T
    return columns, quantile((samples - lower) / (upper - lower))


def _shared(problem: Problem, posterior: Posterior) -> IntArray:
    """Columns of the problem's parameters that the posterior has too and no swap moves."""
    moved = {name for swap in problem.model.swaps for name in swap}
    names = problem.prior.names
    both = [i for i, name in enumerate(names) if name in posterior.names and name not in moved]
    return np.array(both, dtype=int)
