"""Measured frequencies as data of an update, and their likelihood with an unknown model error."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy

from shm.errors import BadInput
from shm.inference.sampler.likelihood import Likelihood, NoiseNode
from shm.models import Model
from shm.models.classes.base import Conditions
from shm.values import FloatArray, IntArray, ModalTest, Mode


class MeasuredFrequencies(ABC):
    """Measured frequencies and the likelihood of predictions of them.

    The model error sigma, whose prior lies within `sigma_range`, is integrated out on a grid that
    is even in its logarithm, in `steps` of the standard deviation with which N data tell it,
    1/sqrt(2 N): coarse to integrate, fine to draw from. Misfits are fractions. Raises BadInput
    where the tests hold no mode.
    """

    modes: list[Mode]
    frequency_hz: FloatArray
    identification_error: FloatArray
    sigma_range: tuple[float, float]
    steps: tuple[float, float]
    _plane: IntArray
    _order: IntArray

    def __init__(self, tests: Sequence[ModalTest]):
        self.tests = tuple(tests)
        self.modes = measured(tests)

    @abstractmethod
    def predict(self, model: Model, theta: FloatArray) -> FloatArray:
        """Return the model's frequency for each datum (n, data), in Hz."""

    @abstractmethod
    def misfit(self, predicted: FloatArray) -> FloatArray:
        """Return fractional differences (n, data) of predictions from the measurements."""

    @abstractmethod
    def sigma_grid(self, step_in_sd: float) -> tuple[FloatArray, FloatArray]:
        """Return values of sigma (k,), and the log of the prior probability of each (k,)."""

    @abstractmethod
    def frequency_nodes(self, step_in_sd: float) -> list[NoiseNode]:
        """Return the possible errors of frequencies, those of one sigma of the grid together."""

    def log_shapes(self, misfit: FloatArray) -> FloatArray:
        """Return the log likelihood (n,) of what is no frequency in misfits (n, data)."""
        return np.zeros(len(misfit))

    @property
    @abstractmethod
    def fit_error(self) -> FloatArray:
        """Return fractional standard deviations (data,) of all errors but sigma."""

    @property
    def highest_order(self) -> int:
        """Return the highest order of a measured mode, which a model has to reach."""
        return int(self._order.max()) + 1

    @property
    def lowest_order(self) -> int:
        """Return the lowest order of a measured mode."""
        return int(self._order.min()) + 1

    @cached_property
    def likelihood(self) -> Likelihood:
        """Return the likelihood of residuals, which are misfits with the other sign."""
        return self._coarse

    @cached_property
    def _coarse(self) -> Likelihood:
        return Likelihood(self.frequency_nodes(self.steps[0]))

    @cached_property
    def _fine(self) -> Likelihood:
        return Likelihood(self.frequency_nodes(self.steps[1]))

    def marginal(self, predicted: FloatArray) -> FloatArray:
        """Return the log likelihood (n,) of predictions (n, data), all unknowns integrated out."""
        misfit = self.misfit(predicted)
        of_frequencies = self._coarse.log(-misfit[:, : self._coarse.frequencies])
        return np.asarray(of_frequencies + self.log_shapes(misfit))

    def joint(self, predicted: FloatArray, sigma: FloatArray) -> FloatArray:
        """Return the log likelihood (n,) of predictions (n, data), each with its sigma (n,)."""
        grid, share = self.sigma_grid(self.steps[1])
        found = self._by_sigma(self._fine, predicted, len(grid)) - share
        at = np.log(sigma.clip(grid[0], grid[-1]) / grid[0]) / np.log(grid[1] / grid[0])
        return np.asarray(found[np.arange(len(found)), np.round(at).astype(int)])

    def draw_sigma(self, predicted: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draw sigma (n,) from its posterior given each prediction (n, data)."""
        grid, _ = self.sigma_grid(self.steps[1])
        joint = self._by_sigma(self._fine, predicted, len(grid))
        share = scipy.special.softmax(joint, axis=1).cumsum(axis=1)
        node = (share < rng.random((len(joint), 1))).sum(axis=1).clip(0, len(grid) - 1)
        jitter = np.log(grid[1] / grid[0]) * (rng.random(len(node)) - 0.5)
        return np.asarray((grid[node] * np.exp(jitter)).clip(*self.sigma_range))

    def most_likely_sigma(self, predicted: FloatArray) -> FloatArray:
        """Return the node of the grid with the largest joint likelihood (n,)."""
        grid, share = self.sigma_grid(self.steps[0])
        found = self._by_sigma(self._coarse, predicted, len(grid)) - share
        return np.asarray(grid[found.argmax(axis=1)])

    def _by_sigma(self, by: Likelihood, predicted: FloatArray, count: int) -> FloatArray:
        """Return the log likelihood with the prior of each sigma (n, count)."""
        misfit = self.misfit(predicted)
        found = by.by_node(-misfit[:, : by.frequencies]).reshape(len(predicted), count, -1)
        of_frequencies = scipy.special.logsumexp(found, axis=2)
        return np.asarray(of_frequencies + self.log_shapes(misfit)[:, None])

    def explained(self, predicted: FloatArray) -> FloatArray:
        """Return predictions (n, data) with the errors that are shared: here none is."""
        return predicted

    def by_mode(self, predicted: FloatArray) -> FloatArray:
        """Return predictions (n, modes) of every mode of every test: here each is a datum."""
        return self.explained(predicted)

    def settle(self, model: Model, theta: FloatArray) -> None:
        """Take what is systematic from `theta` (parameters,); the likelihood is made anew."""
        for each in ("likelihood", "_coarse", "_fine"):
            self.__dict__.pop(each, None)


def measured(tests: Sequence[ModalTest]) -> list[Mode]:
    """Return the modes that count; raises BadInput where there are none."""
    modes = [mode for test in tests for mode in test.regular_modes]
    if not modes:
        raise BadInput("no measured frequency to update with.", remedy="Give a test with modes.")
    return modes


def conditions_of(tests: Sequence[ModalTest], model: Model) -> list[Conditions]:
    """Return the conditions of each measured mode, as far as the model takes notice of them."""
    return [each for test in tests for each in [model.conditions(test)] * len(test.regular_modes)]


def predicted_hz(
    model: Model,
    theta: FloatArray,
    conditions: Sequence[Conditions],
    plane: IntArray,
    order: IntArray,
) -> FloatArray:
    """Return the model's frequencies (n, data), each of its conditions, plane and order from 0.

    Data under equal conditions are one evaluation.
    """
    rows: dict[Conditions, list[int]] = {}
    for index, each in enumerate(conditions):
        rows.setdefault(each, []).append(index)
    # One measurement after the other, as indexing lays them: sums round alike, to the last bit.
    predicted, highest = np.empty((len(plane), len(theta))).T, int(order.max()) + 1
    for each, indices in rows.items():
        found = model.frequencies_at(theta, highest, each)
        predicted[:, indices] = found[:, plane[indices], order[indices]]
    return predicted
