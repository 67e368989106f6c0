"""One updating problem: the prior and the likelihood of a model class and of tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from shm.inference.coordinates import Coordinates
from shm.inference.described import DescribedCoordinates
from shm.inference.field import FieldLikelihood
from shm.inference.likelihood import Likelihood
from shm.inference.mixture import Rows
from shm.inference.options import Progress
from shm.inference.priors import Calibration, reading_of
from shm.inference.shapes import swaps_of
from shm.models import THESIS, AsMade, Model
from shm.models.as_made import TENSION
from shm.values import FloatArray, ModalTest

DIFFERENCE = 1e-4
"""Forward difference in z, whose prior has a standard deviation of 1. It steers searches and
proposals, which weights correct, and is as exact as a first-order repeatability needs."""


@dataclass(frozen=True, eq=False)
class Points(Rows):
    """Points `z` (n, d) with their predictions `predicted` (n, measurements)."""

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
            self.coordinates = Coordinates(model.prior, swaps_of(model, likelihood.tests), own)
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
        """Return the problem of `tests`, the model made ready.

        Raises BadInput where a test has no modes or conditions that the class cannot describe.
        """
        for test in tests:
            model.refuse(test)
        problem = cls(model, _likelihood(tests, model, calibration), calibration)
        label = f"{model.name}: reduced basis"
        model.prepare(problem.likelihood.highest_order, lambda done: progress(label, done))
        return problem

    def predict(self, z: FloatArray) -> FloatArray:
        """Return predicted frequencies (n, measurements) at `z` (n, d)."""
        return self.run(self.coordinates.theta(z))

    def run(self, theta: FloatArray) -> FloatArray:
        """Return predicted frequencies (n, measurements) of parameter sets (n, d)."""
        self.evaluations += len(theta)
        found = self.likelihood.predict(self.model, theta)
        if isinstance(self.likelihood, FieldLikelihood) and self.likelihood.has_reading:
            ratio = theta[:, self.model.parameter_names.index(TENSION)]
            tension_n = ratio * self.model.hanger.nominal_tension_n
            found = np.column_stack([found, tension_n])
        return self._with_shapes(found, theta)

    def _with_shapes(self, found: FloatArray, theta: FloatArray) -> FloatArray:
        """Return `found` (n, data) with the misfits of shapes behind."""
        if not isinstance(self.likelihood, FieldLikelihood) or not self.likelihood.shapes.size:
            return found
        return np.hstack([found, self.likelihood.shapes.misfits(self.model, theta)])

    def evaluate(self, z: FloatArray) -> Points:
        """Run the model at `z` (n, d)."""
        return Points(z, self.predict(z))

    def settle(self, z: FloatArray) -> None:
        """Take the model's part of the noise's covariance from `z` (d,), the first time: near the
        optimum.
        """
        if isinstance(self.likelihood, FieldLikelihood) and not self._settled:
            self.likelihood.settle(self.model, self.coordinates.theta(z[None])[0])
        self._settled = True

    def misfit(self, z: FloatArray) -> FloatArray:
        """Return fractional misfits (n, measurements) at `z` (n, d); a large one where there is no
        such mode.
        """
        return self.misfit_of(self.coordinates.theta(z))

    def misfit_of(self, theta: FloatArray) -> FloatArray:
        """Return the same (n, measurements) of parameter sets (n, parameters)."""
        found = self.likelihood.misfit(self.run(theta))
        return np.nan_to_num(found, nan=_NO_MODE, posinf=_NO_MODE, neginf=-_NO_MODE)

    def slopes(self, z: FloatArray, directions: FloatArray | None = None) -> FloatArray:
        """Return derivatives (m, measurements, k) of the misfit at `z` (m, d).

        They are along the columns of `directions` (d, k), or by all coordinates.
        """
        steps = DIFFERENCE * (np.eye(z.shape[1]) if directions is None else directions.T)
        if self._has_slopes:
            return self._near(z, steps) / DIFFERENCE
        shifted = np.vstack([z, *(z + step for step in steps)])
        misfit = self.misfit(shifted).reshape(len(steps) + 1, len(z), -1)
        return np.asarray(np.moveaxis(misfit[1:] - misfit[0], 0, -1) / DIFFERENCE)

    @property
    def is_costly(self) -> bool:
        """Return True where an evaluation costs much more than the closed form of a beam."""
        return self.model.expensive or (isinstance(self.model, AsMade) and self.model.has_terms)

    @property
    def _has_slopes(self) -> bool:
        """Return True where the class gives the frequencies of near parameter sets at once."""
        likelihood = self.likelihood
        slopes = isinstance(self.model, AsMade) and self.model.has_slopes
        return slopes and isinstance(likelihood, FieldLikelihood) and likelihood.alike_conditions

    def _near(self, z: FloatArray, steps: FloatArray) -> FloatArray:
        """Return changes (m, measurements, steps) of the misfit by `steps` (k, d) from `z`."""
        if not len(steps):
            return np.empty((len(z), len(self.likelihood.fit_error), 0))
        self.evaluations += len(z)
        theta = self.coordinates.theta(z)
        others = [self.coordinates.theta(z + step) for step in steps]
        model, likelihood = cast(AsMade, self.model), cast(FieldLikelihood, self.likelihood)
        found = likelihood.changes(model, theta, others)
        if likelihood.has_reading:
            column = self.model.parameter_names.index(TENSION)
            ratio = np.stack([each[:, column] / theta[:, column] for each in others], axis=1)
            found = np.concatenate([found, np.log(ratio)[:, None]], axis=1)
        if likelihood.shapes.size:
            moved = likelihood.shapes.changes(model, theta, others)
            found = np.concatenate([found, moved], axis=1)
        return np.nan_to_num(found)

    def log_posterior(self, points: Points) -> FloatArray:
        """Return the log of prior times likelihood (n,); -inf without a prediction."""
        found = self.coordinates.log_prior(points.z)
        known = np.isfinite(self.likelihood.misfit(points.predicted)).all(axis=1)
        found[~known] = -np.inf
        if known.any():
            found[known] += self.likelihood.marginal(points.predicted[known])
        return np.where(np.isnan(found), -np.inf, found)


_NO_MODE = 10.0  # of ln f: beyond any data


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
