"""The likelihood of modal tests: f_hat ~ N(f(theta), (sigma f_hat)^2 + sd^2), thesis (4.5).

sigma is the unknown fractional model error, uniform on [0, 1]; sd is the standard deviation of the
identification where it is known.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.inference.problem.measured import MeasuredFrequencies, conditions_of, predicted_hz
from shm.inference.sampler.likelihood import Covariance, NoiseNode
from shm.models import Model
from shm.values import PLANES, FloatArray, ModalTest

# Assumed (judgement): below that a logger's clock, a tenth of a kelvin and the hammer's level move
# a frequency more than any model of a hanger can follow.
_SMALLEST_SIGMA = 1e-4


class ThesisLikelihood(MeasuredFrequencies):
    """Measured frequencies (measurements,), each a datum, and the likelihood of the thesis.

    Raises BadInput where the tests hold no mode.
    """

    sigma_range = (0.0, 1.0)
    # Numerical: the trapezoidal rule of a bell in steps of h sd is off by 2 exp(-2 pi^2/h^2), 2e-6;
    # a draw is spread over its step, which adds h^2/12 to the variance, 0.3 %.
    steps = (1.2, 0.2)

    def __init__(self, tests: Sequence[ModalTest]):
        super().__init__(tests)
        self.frequency_hz = np.array([mode.frequency_hz for mode in self.modes])
        sd_hz: FloatArray = np.array([mode.frequency_sd_hz for mode in self.modes])
        self.identification_error = np.nan_to_num(sd_hz, nan=0.0) / self.frequency_hz
        self._plane = np.array([PLANES.index(mode.plane) for mode in self.modes])
        self._order = np.array([mode.order - 1 for mode in self.modes])
        self._jacobian = -float(np.log(self.frequency_hz).sum())

    def predict(self, model: Model, theta: FloatArray) -> FloatArray:
        """Return the model's frequency for each measurement (n, measurements).

        Tests that the model sees under equal conditions are one evaluation.
        """
        return predicted_hz(
            model, theta, conditions_of(self.tests, model), self._plane, self._order
        )

    def misfit(self, predicted: FloatArray) -> FloatArray:
        return np.asarray(predicted / self.frequency_hz - 1)

    @property
    def fit_error(self) -> FloatArray:
        return self.identification_error

    def frequency_nodes(self, step_in_sd: float) -> list[NoiseNode]:
        variance = self.identification_error**2
        return [
            NoiseNode(
                Covariance.of_frequencies(np.diag(sigma**2 + variance)),
                float(share + self._jacobian),
                float(sigma),
            )
            for sigma, share in zip(*self.sigma_grid(step_in_sd), strict=True)
        ]

    def joint(self, predicted: FloatArray, sigma: FloatArray) -> FloatArray:
        variance = sigma[:, None] ** 2 + self.identification_error**2
        terms = self.misfit(predicted) ** 2 / variance + np.log(2 * np.pi * variance)
        return np.asarray(self._jacobian - 0.5 * terms.sum(axis=1))

    def sigma_grid(self, step_in_sd: float) -> tuple[FloatArray, FloatArray]:
        lowest = np.log(_SMALLEST_SIGMA)
        step = step_in_sd / np.sqrt(2 * len(self.modes))
        nodes, spacing = np.linspace(lowest, 0.0, int(-lowest / step) + 2, retstep=True)
        share = np.log(spacing) + nodes
        share[[0, -1]] -= np.log(2)
        share[0] = np.logaddexp(share[0], lowest)
        return np.exp(nodes), share
