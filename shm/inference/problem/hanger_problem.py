"""One updating problem: the prior and the likelihood of a model class and of tests."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import cast

import numpy as np

from shm.inference.options import Calibration, Progress
from shm.inference.problem.described import DescribedCoordinates
from shm.inference.problem.field import FieldLikelihood
from shm.inference.problem.measured import MeasuredFrequencies
from shm.inference.problem.priors import reading_of
from shm.inference.problem.shapes import swaps_of
from shm.inference.problem.thesis_noise import ThesisLikelihood
from shm.inference.sampler.coordinates import Coordinates
from shm.inference.sampler.density import DIFFERENCE, Density
from shm.inference.sampler.likelihood import Likelihood
from shm.models import THESIS, AsMade, Model
from shm.values import FloatArray, ModalTest


class Problem(Density):
    """The prior and the likelihood of one model class and one set of measurements.

    A class with the priors of a description has the noise of the field; one with those of the
    thesis has the thesis's own.
    """

    def __init__(
        self,
        model: Model,
        measured: MeasuredFrequencies,
        calibration: Calibration | None = None,
    ):
        self.model = model
        self.measured, self.calibration = measured, calibration
        self.value = np.zeros(len(measured.fit_error))
        self.evaluations = 0
        self._settled = False
        middle = (1 + measured.highest_order) / 2
        stiffness = model.wave_stiffness_n_m_rad(middle)
        self.coordinates: Coordinates | DescribedCoordinates
        if isinstance(model, AsMade):
            self.coordinates = DescribedCoordinates(model, measured.tests, stiffness, calibration)
        else:
            self.coordinates = Coordinates(model.prior, swaps_of(model, measured.tests), stiffness)
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
        model.prepare(problem.measured.highest_order, lambda done: progress(label, done))
        return problem

    def predict(self, z: FloatArray) -> FloatArray:
        """Return predictions (n, data) at `z` (n, d)."""
        return self.run(self.coordinates.theta(z))

    def run(self, theta: FloatArray) -> FloatArray:
        """Return predictions (n, data) of parameter sets (n, d)."""
        self.evaluations += len(theta)
        return self.measured.predict(self.model, theta)

    @cached_property
    def rough(self) -> Problem:
        """Return the problem with a rougher model of the bar, the noise and coordinates shared."""
        found = copy(self)
        if isinstance(self.model, AsMade):
            found.model = self.model.rough
        return found

    def renumbered(self, by: int, theta: FloatArray) -> Problem | None:
        """Return the problem with all orders higher `by` so many, its noise taken from `theta`
        (d,); None where an order would fall below 1.
        """
        measured = self.measured
        if not isinstance(measured, FieldLikelihood) or measured.lowest_order + by < 1:
            return None
        found = copy(self)
        found.measured = measured.renumbered(by, self.model, theta)
        return found

    @property
    def likelihood(self) -> Likelihood:
        """Return the likelihood of residuals, near the optimum once the noise has settled."""
        return self.measured.likelihood

    def residual_of(self, predicted: FloatArray) -> FloatArray:
        """Return fractional misfits (n, data) of predictions with the other sign."""
        return -self.measured.misfit(predicted)

    def log_likelihood(self, predicted: FloatArray) -> FloatArray:
        return self.measured.marginal(predicted)

    def settle(self, z: FloatArray) -> None:
        """Take the model's part of the noise's covariance from `z` (d,), the first time: near the
        optimum.
        """
        if not self._settled:
            self.measured.settle(self.model, self.coordinates.theta(z[None])[0])
        self._settled = True

    def misfit_of(self, theta: FloatArray) -> FloatArray:
        """Return fractional misfits (n, data) of parameter sets (n, parameters); a large one where
        there is no such mode.
        """
        found = self.measured.misfit(self.run(theta))
        return np.nan_to_num(found, nan=_NO_MODE, posinf=_NO_MODE, neginf=-_NO_MODE)

    def log_prior(self, z: FloatArray) -> FloatArray:
        return self.coordinates.log_prior(z)

    def fold(self, z: FloatArray) -> FloatArray:
        return self.coordinates.fold(z)

    def connect(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        return self.coordinates.connect(z, rng)

    def look(
        self, z: FloatArray, directions: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        if not self._has_slopes:
            return super().look(z, directions)
        steps = DIFFERENCE * (np.eye(z.shape[1]) if directions is None else directions.T)
        self.evaluations += len(z)
        theta = self.coordinates.theta(z)
        others = [self.coordinates.theta(z + step) for step in steps]
        model, likelihood = cast(AsMade, self.model), cast(FieldLikelihood, self.measured)
        predicted, changes = likelihood.changes(model, theta, others)
        return self.residual_of(predicted), np.nan_to_num(changes) / DIFFERENCE

    @property
    def largest_error(self) -> float:
        costly = self.model.expensive or (isinstance(self.model, AsMade) and self.model.has_terms)
        return super().largest_error if costly else 0.02

    @property
    def _has_slopes(self) -> bool:
        """Return True where the class gives the frequencies of near parameter sets at once."""
        likelihood = self.measured
        slopes = isinstance(self.model, AsMade) and self.model.has_slopes
        return (
            slopes and isinstance(likelihood, FieldLikelihood) and likelihood.has_equal_conditions
        )


_NO_MODE = 10.0  # of ln f: beyond any data


def _likelihood(
    tests: Sequence[ModalTest], model: Model, calibration: Calibration | None
) -> MeasuredFrequencies:
    if model.priors == THESIS:
        return ThesisLikelihood(tests)
    reading = reading_of(tests, model.hanger.assumptions)
    if reading is None:
        return FieldLikelihood(tests, model)
    sd = reading.sd
    if isinstance(model, AsMade):
        sd = DescribedCoordinates(model, tests, 1.0, calibration).reading_sd
    return FieldLikelihood(tests, model, (reading.tension_n, sd))
