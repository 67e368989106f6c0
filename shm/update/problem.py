"""One updating problem in the space where its prior is standard normal.

Parameters map to z by the normal quantile of their uniform priors, so that no proposal leaves the
box. Where the model can swap groups of parameters without changing any frequency, z is folded to
one of the equal copies; the prior there is that many times denser, and samples are unfolded again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from shm.models import Model
from shm.update.likelihood import Likelihood
from shm.values import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Points:
    """Points `z` (n, d) with what they predict, `predicted` (n, measurements)."""

    z: FloatArray
    predicted: FloatArray

    def take(self, index: IntArray) -> Points:
        """The chosen points."""
        return Points(self.z[index], self.predicted[index])

    def joined(self, other: Points) -> Points:
        """These points and then the others."""
        return Points(np.vstack([self.z, other.z]), np.vstack([self.predicted, other.predicted]))

    def replaced(self, where: BoolArray, by: Points) -> Points:
        """These points with those `where` (n,) is true taken from `by`."""
        column = where[:, None]
        return Points(
            np.where(column, by.z, self.z), np.where(column, by.predicted, self.predicted)
        )


class Problem:
    """The prior and the likelihood of one model class and one set of measurements."""

    def __init__(self, model: Model, likelihood: Likelihood):
        self.model = model
        self.likelihood = likelihood
        self.prior = model.prior
        self.dimension = len(self.prior.names)
        self.evaluations = 0
        names = self.prior.names
        self._swaps = [
            ([names.index(n) for n in one], [names.index(n) for n in other])
            for one, other in model.swaps
        ]

    def theta(self, z: FloatArray) -> FloatArray:
        """Parameters (n, d) of points (n, d)."""
        width = self.prior.upper - self.prior.lower
        return np.asarray(self.prior.lower + width * ndtr(z))

    def predict(self, z: FloatArray) -> FloatArray:
        """Predicted frequencies (n, measurements) at `z` (n, d)."""
        return self.run(self.theta(z))

    def run(self, theta: FloatArray) -> FloatArray:
        """Predicted frequencies (n, measurements) of parameter sets (n, d)."""
        self.evaluations += len(theta)
        return self.likelihood.predict(self.model, theta)

    def evaluate(self, z: FloatArray) -> Points:
        """Runs the model at `z` (n, d)."""
        return Points(z, self.predict(z))

    def log_posterior(self, points: Points, floor: float = 0.0) -> FloatArray:
        """Log of prior times likelihood (n,) with the fictitious error `floor`."""
        return self.log_prior(points.z) + self.likelihood.marginal(points.predicted, floor)

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Log density (n,) of the folded prior; -inf outside the fold."""
        copies = 2 ** len(self._swaps)
        normal = -0.5 * (z**2).sum(axis=1) - 0.5 * self.dimension * np.log(2 * np.pi)
        return np.where(self._in_fold(z), normal + np.log(copies), -np.inf)

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Points (n, d) from the folded prior."""
        return self.fold(rng.standard_normal((n, self.dimension)))

    def fold(self, z: FloatArray) -> FloatArray:
        """`z` (n, d) with each point replaced by its copy inside the fold."""
        z = z.copy()
        for one, other in self._swaps:
            _exchange(z, z[:, one[0]] < z[:, other[0]], one, other)
        return z

    def unfold(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """`z` with each swap made or not by chance: all equal copies are equally likely."""
        z = z.copy()
        for one, other in self._swaps:
            _exchange(z, rng.random(len(z)) < 0.5, one, other)
        return z

    def _in_fold(self, z: FloatArray) -> BoolArray:
        inside = np.ones(len(z), dtype=bool)
        for one, other in self._swaps:
            inside &= z[:, one[0]] >= z[:, other[0]]
        return inside


def _exchange(z: FloatArray, where: BoolArray, one: list[int], other: list[int]) -> None:
    rows = np.flatnonzero(where)[:, None]
    z[rows, one + other] = z[rows, other + one]
