"""One updating problem: what a point predicts, and how probable it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.models import Model
from shm.inference.coordinates import Coordinates
from shm.inference.likelihood import Likelihood
from shm.inference.options import Progress
from shm.values import BoolArray, FloatArray, IntArray, ModalTest


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
        middle = (1 + likelihood.highest_order) / 2
        own = model.wave_stiffness_n_m_rad(middle)
        self.coordinates = Coordinates(model.prior, model.swaps, own)

    @classmethod
    def of(
        cls, tests: Sequence[ModalTest], model: Model, repeat: int, progress: Progress
    ) -> Problem:
        """The problem of `tests`, each of which the model can describe, the model made ready.

        Raises BadInput where a test has no modes or conditions that the class cannot describe.
        """
        for test in tests:
            model.refuse(test)
        problem = cls(model, Likelihood(tests, repeat))
        label = f"{model.name}: reduced basis"
        model.prepare(problem.likelihood.highest_order, lambda done: progress(label, done))
        return problem

    def predict(self, z: FloatArray) -> FloatArray:
        """Predicted frequencies (n, measurements) at `z` (n, d)."""
        return self.run(self.coordinates.theta(z))

    def run(self, theta: FloatArray) -> FloatArray:
        """Predicted frequencies (n, measurements) of parameter sets (n, d)."""
        self.evaluations += len(theta)
        return self.likelihood.predict(self.model, theta)

    def evaluate(self, z: FloatArray) -> Points:
        """Runs the model at `z` (n, d)."""
        return Points(z, self.predict(z))

    def log_posterior(self, points: Points, floor: float = 0.0) -> FloatArray:
        """Log of prior times likelihood (n,) with the fictitious error `floor`."""
        return self.coordinates.log_prior(points.z) + self.likelihood.marginal(
            points.predicted, floor
        )
