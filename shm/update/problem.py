"""One updating problem in the space where its prior is standard normal.

Parameters and the model error sigma map to z by the normal quantile of their uniform priors, so
that no proposal leaves the box. Where the model can swap groups of parameters without changing
any frequency, z is folded to one of the equal copies; the prior there is that many times denser,
and the final samples are unfolded again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from shm.models import Model
from shm.update.likelihood import Measured, log_likelihood, predicted_hz
from shm.values import BoolArray, FloatArray, IntArray

SIGMA = "sigma"


@dataclass(frozen=True, eq=False)
class Points:
    """Points of the space with what they predict: `z` (n, d), `predicted` (n, measurements)."""

    z: FloatArray
    predicted: FloatArray
    sigma: FloatArray

    def take(self, index: IntArray) -> Points:
        """The chosen points."""
        return Points(self.z[index], self.predicted[index], self.sigma[index])

    def joined(self, other: Points) -> Points:
        """These points and then the others."""
        return Points(
            np.vstack([self.z, other.z]),
            np.vstack([self.predicted, other.predicted]),
            np.append(self.sigma, other.sigma),
        )

    def replaced(self, where: BoolArray, by: Points) -> Points:
        """These points with those `where` (n,) is true taken from `by`."""
        column = where[:, None]
        return Points(
            np.where(column, by.z, self.z),
            np.where(column, by.predicted, self.predicted),
            np.where(where, by.sigma, self.sigma),
        )


class Problem:
    """The prior and the likelihood of one model class and one set of measurements."""

    def __init__(self, model: Model, data: Measured):
        prior = model.prior
        self.model = model
        self.data = data
        self.names = (*prior.names, SIGMA)
        self.lower = np.append(prior.lower, 0.0)
        self.upper = np.append(prior.upper, 1.0)
        self.dimension = len(self.names)
        self.evaluations = 0
        self._swaps = [
            ([self.names.index(n) for n in one], [self.names.index(n) for n in other])
            for one, other in model.swaps
        ]

    def theta(self, z: FloatArray) -> FloatArray:
        """Parameters and sigma (n, d) of points (n, d)."""
        return np.asarray(self.lower + (self.upper - self.lower) * ndtr(z))

    def evaluate(self, z: FloatArray) -> Points:
        """Runs the model at `z` (n, d)."""
        self.evaluations += len(z)
        theta = self.theta(z)
        return Points(z, predicted_hz(self.model, theta[:, :-1], self.data), theta[:, -1])

    def log_likelihood(self, points: Points, floor: float = 0.0) -> FloatArray:
        """Log likelihood (n,) with the fictitious error `floor`."""
        return log_likelihood(points.predicted, points.sigma, self.data, floor)

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Log density (n,) of the folded prior; -inf outside the fold."""
        copies = 2 ** len(self._swaps)
        normal = -0.5 * (z**2).sum(axis=1) - 0.5 * self.dimension * np.log(2 * np.pi)
        return np.where(self._in_fold(z), normal + np.log(copies), -np.inf)

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Points (n, d) from the folded prior."""
        z = rng.standard_normal((n, self.dimension))
        for one, other in self._swaps:
            self._exchange(z, z[:, one[0]] < z[:, other[0]], one, other)
        return z

    def unfold(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """`z` with each swap made or not by chance: all equal copies are equally likely."""
        z = z.copy()
        for one, other in self._swaps:
            self._exchange(z, rng.random(len(z)) < 0.5, one, other)
        return z

    def _in_fold(self, z: FloatArray) -> BoolArray:
        inside = np.ones(len(z), dtype=bool)
        for one, other in self._swaps:
            inside &= z[:, one[0]] >= z[:, other[0]]
        return inside

    @staticmethod
    def _exchange(z: FloatArray, where: BoolArray, one: list[int], other: list[int]) -> None:
        rows = np.flatnonzero(where)[:, None]
        z[rows, one + other] = z[rows, other + one]
