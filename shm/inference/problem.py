"""One updating problem: what a point predicts, and how probable it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.inference.coordinates import Coordinates
from shm.inference.described import DescribedCoordinates
from shm.inference.field import FieldLikelihood
from shm.inference.likelihood import Likelihood
from shm.inference.mixture import Rows
from shm.inference.options import Progress
from shm.inference.priors import Calibration, reading_of
from shm.models import THESIS, AsMade, Model
from shm.models.as_made import TENSION
from shm.values import FloatArray, ModalTest

DIFFERENCE = 1e-4
"""Forward difference in z, whose prior has a standard deviation of 1. It steers searches and
proposals, which weights correct, and is as exact as a first-order repeatability needs."""


@dataclass(frozen=True, eq=False)
class Points(Rows):
    """Points `z` (n, d) with what they predict, `predicted` (n, measurements)."""

    z: FloatArray
    predicted: FloatArray


class Problem:
    """The prior and the likelihood of one model class and one set of measurements.

    A class with the priors of a description has the noise of the field; one with those of the
    thesis has the thesis's own.
    """

    def __init__(
        self,
        model: Model,
        likelihood: Likelihood | FieldLikelihood,
        calibration: Calibration | None = None,
    ):
        self.model = model
        self.likelihood, self.calibration = likelihood, calibration
        self.evaluations = 0
        self._settled = False
        middle = (1 + likelihood.highest_order) / 2
        own = model.wave_stiffness_n_m_rad(middle)
        self.coordinates: Coordinates | DescribedCoordinates
        if isinstance(model, AsMade):
            self.coordinates = DescribedCoordinates(model, likelihood.tests, own, calibration)
        else:
            self.coordinates = Coordinates(model.prior, model.swaps, own)
        self.prior = model.prior
        self.dimension = self.coordinates.dimension

    @classmethod
    def of(
        cls,
        tests: Sequence[ModalTest],
        model: Model,
        progress: Progress,
        calibration: Calibration | None = None,
    ) -> Problem:
        """The problem of `tests`, each of which the model can describe, the model made ready.

        Raises BadInput where a test has no modes or conditions that the class cannot describe.
        """
        for test in tests:
            model.refuse(test)
        problem = cls(model, _likelihood(tests, model, calibration), calibration)
        label = f"{model.name}: reduced basis"
        model.prepare(problem.likelihood.highest_order, lambda done: progress(label, done))
        return problem

    def predict(self, z: FloatArray) -> FloatArray:
        """Predicted frequencies (n, measurements) at `z` (n, d)."""
        return self.run(self.coordinates.theta(z))

    def run(self, theta: FloatArray) -> FloatArray:
        """Predicted frequencies (n, measurements) of parameter sets (n, d)."""
        self.evaluations += len(theta)
        found = self.likelihood.predict(self.model, theta)
        if isinstance(self.likelihood, FieldLikelihood) and self.likelihood.has_reading:
            ratio = theta[:, self.model.parameter_names.index(TENSION)]
            tension_n = ratio * self.model.hanger.nominal_tension_n
            found = np.column_stack([found, tension_n])
        return found

    def evaluate(self, z: FloatArray) -> Points:
        """Runs the model at `z` (n, d)."""
        return Points(z, self.predict(z))

    def settle(self, z: FloatArray) -> None:
        """Takes what the covariance of the noise has of the model from `z` (d,), the first time:
        near the optimum.
        """
        if isinstance(self.likelihood, FieldLikelihood) and not self._settled:
            self.likelihood.settle(self.model, self.coordinates.theta(z[None])[0])
        self._settled = True

    def slopes(self, z: FloatArray) -> FloatArray:
        """Derivatives of the fractional misfit by z (m, d): (m, measurements, d)."""
        steps = DIFFERENCE * np.eye(z.shape[1])
        shifted = np.vstack([z, *(z + step for step in steps)])
        misfit = self.likelihood.misfit(self.predict(shifted)).reshape(len(steps) + 1, len(z), -1)
        return np.asarray(np.moveaxis(misfit[1:] - misfit[0], 0, -1) / DIFFERENCE)

    def log_posterior(self, points: Points, floor: float = 0.0) -> FloatArray:
        """Log of prior times likelihood (n,) with the fictitious error `floor`."""
        return self.coordinates.log_prior(points.z) + self.likelihood.marginal(
            points.predicted, floor
        )


def _likelihood(
    tests: Sequence[ModalTest], model: Model, calibration: Calibration | None
) -> Likelihood | FieldLikelihood:
    if model.priors == THESIS:
        return Likelihood(tests)
    reading = reading_of(tests, model.hanger.assumptions)
    if reading is None:
        return FieldLikelihood(tests, model)
    sd = reading.sd
    if isinstance(model, AsMade):
        sd = DescribedCoordinates(model, tests, 1.0, calibration).reading_sd
    return FieldLikelihood(tests, model, (reading.tension_n, sd))
