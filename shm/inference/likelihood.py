"""The likelihood of modal tests: f_hat ~ N(f(theta), (sigma f_hat)^2 + sd^2), thesis (4.5).

sigma is the unknown fractional model error, uniform on [0, 1]; sd is the standard deviation of the
identification where it is known.

sigma is integrated out on a grid that is even in log sigma. The integrand is a bell there, of
standard deviation 1/sqrt(2 N) for N data: to the sampler the model error costs no dimension.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from shm.errors import BadInput
from shm.models import Model
from shm.models.base import Conditions
from shm.values import PLANES, FloatArray, IntArray, ModalTest, Mode

# Numerical: the trapezoidal rule of a bell in steps of h sd is off by 2 exp(-2 pi^2/h^2), 2e-6; a
# draw is spread over its step, which adds h^2/12 to the variance, 0.3 %.
_STEP_IN_SD = 1.2
_STEP_IN_SD_TO_DRAW = 0.2

# Assumed (judgement): below that a logger's clock, a tenth of a kelvin and the hammer's level move
# a frequency more than any model of a hanger can follow.
_SMALLEST_SIGMA = 1e-4


class Likelihood:
    """Measured frequencies (measurements,) and the likelihood of predictions of them.

    Raises BadInput where the tests hold no mode.
    """

    def __init__(self, tests: Sequence[ModalTest]):
        self.modes = modes = measured(tests)
        self.tests = tuple(tests)
        self.frequency_hz: FloatArray = np.array([mode.frequency_hz for mode in modes])
        sd_hz: FloatArray = np.array([mode.frequency_sd_hz for mode in modes])
        self.identification_error: FloatArray = np.nan_to_num(sd_hz, nan=0.0) / self.frequency_hz
        self._plane = np.array([PLANES.index(mode.plane) for mode in modes])
        self._order = np.array([mode.order - 1 for mode in modes])
        self._constant = -np.log(self.frequency_hz).sum() - len(modes) / 2 * np.log(2 * np.pi)
        self._log_sigma, self._log_share = self._grid(_STEP_IN_SD)

    @property
    def highest_order(self) -> int:
        """The highest order of a measured mode, which a model has to reach in each plane."""
        return int(self._order.max()) + 1

    def predict(self, model: Model, theta: FloatArray) -> FloatArray:
        """The model's frequency for each measurement, shape (n, measurements).

        Tests that the model sees under equal conditions are one evaluation.
        """
        return predicted_hz(
            model, theta, conditions_of(self.tests, model), self._plane, self._order
        )

    @property
    def fit_error(self) -> FloatArray:
        """Fractional standard deviations (measurements,) of all errors but sigma."""
        return self.identification_error

    def explained(self, predicted: FloatArray) -> FloatArray:
        """Predictions (n, data) as they are: no error is shared."""
        return predicted

    def by_mode(self, predicted: FloatArray) -> FloatArray:
        """Predictions (n, modes) of every mode of every test: each is a datum of its own."""
        return self.explained(predicted)

    def whitening(self, sigma: float) -> FloatArray:
        """Return the matrix (measurements, measurements) that makes misfits independent with
        standard deviations of 1, for a model error of `sigma`.
        """
        return np.diag(1 / np.hypot(sigma, self.identification_error))

    def misfit(self, predicted: FloatArray) -> FloatArray:
        """Fractional differences (n, measurements) of predictions from the measurements."""
        return predicted / self.frequency_hz - 1

    def marginal(self, predicted: FloatArray) -> FloatArray:
        """Log likelihood (n,) of predictions (n, measurements), sigma integrated out."""
        joint = self._joint(predicted, np.exp(self._log_sigma)) + self._log_share
        highest = joint.max(axis=1)
        return np.asarray(highest + np.log(np.exp(joint - highest[:, None]).sum(axis=1)))

    def joint(self, predicted: FloatArray, sigma: FloatArray) -> FloatArray:
        """Log likelihood (n,) of predictions (n, measurements), each with its sigma (n,)."""
        variance = sigma[:, None] ** 2 + self.identification_error**2
        terms = self.misfit(predicted) ** 2 / variance + np.log(variance)
        return np.asarray(self._constant - 0.5 * terms.sum(axis=1))

    def draw_sigma(self, predicted: FloatArray, rng: np.random.Generator) -> FloatArray:
        """sigma (n,) from its posterior given each prediction (n, measurements)."""
        log_sigma, log_share = self._grid(_STEP_IN_SD_TO_DRAW)
        joint = self._joint(predicted, np.exp(log_sigma)) + log_share
        total = scipy.special.logsumexp(joint, axis=1, keepdims=True)
        shares = np.exp(joint - total).cumsum(axis=1)
        node = (shares < rng.random((len(joint), 1))).sum(axis=1).clip(0, len(log_sigma) - 1)
        jitter = (log_sigma[1] - log_sigma[0]) * (rng.random(len(node)) - 0.5)
        return np.asarray(np.exp((log_sigma[node] + jitter).clip(None, 0.0)))

    def likeliest_sigma(self, predicted: FloatArray) -> FloatArray:
        """The node of the grid with the largest joint likelihood, shape (n,)."""
        sigma = np.exp(self._log_sigma)
        return np.asarray(sigma[self._joint(predicted, sigma).argmax(axis=1)])

    def model_error(self, predicted: FloatArray) -> FloatArray:
        """The misfit's mean square beyond the identification's own, as a sigma (n,)."""
        beyond = self.misfit(predicted) ** 2 - self.identification_error**2
        return np.asarray(np.sqrt(beyond.mean(axis=1).clip(_SMALLEST_SIGMA**2)))

    def _joint(self, predicted: FloatArray, sigma: FloatArray) -> FloatArray:
        """Log likelihood (n, nodes) for all nodes of `sigma` (nodes,)."""
        variance = sigma**2 + self.identification_error[:, None] ** 2
        quadratic = self.misfit(predicted) ** 2 @ (1 / variance)
        constant = self._constant - 0.5 * np.log(variance).sum(axis=0)
        return np.asarray(constant - 0.5 * quadratic)

    def _grid(self, step_in_sd: float) -> tuple[FloatArray, FloatArray]:
        """Nodes of log sigma, and the log of each one's share of the uniform prior."""
        lowest = np.log(_SMALLEST_SIGMA)
        step = step_in_sd / np.sqrt(2 * len(self.modes))
        nodes, spacing = np.linspace(lowest, 0.0, int(-lowest / step) + 2, retstep=True)
        share = np.log(spacing) + nodes
        share[[0, -1]] -= np.log(2)
        share[0] = np.logaddexp(share[0], lowest)
        return nodes, share


def measured(tests: Sequence[ModalTest]) -> list[Mode]:
    """The modes that count; raises BadInput where there are none."""
    modes = [mode for test in tests for mode in test.regular_modes]
    if not modes:
        raise BadInput("no measured frequency to update with.", remedy="Give a test with modes.")
    return modes


def conditions_of(tests: Sequence[ModalTest], model: Model) -> list[Conditions]:
    """The conditions of each measured mode, as far as the model takes notice of them."""
    return [each for test in tests for each in [model.conditions(test)] * len(test.regular_modes)]


def predicted_hz(
    model: Model,
    theta: FloatArray,
    conditions: Sequence[Conditions],
    plane: IntArray,
    order: IntArray,
) -> FloatArray:
    """The model's frequencies (n, data) of data each with its conditions, plane and order from 0.

    Data under equal conditions are one evaluation.
    """
    rows: dict[Conditions, list[int]] = {}
    for index, each in enumerate(conditions):
        rows.setdefault(each, []).append(index)
    # One measurement after the other, as indexing lays them: sums round alike, to the last bit.
    predicted, highest = np.empty((len(plane), len(theta))).T, int(order.max()) + 1
    for each, own in rows.items():
        found = model.frequencies_at(theta, highest, each)
        predicted[:, own] = found[:, plane[own], order[own]]
    return predicted
