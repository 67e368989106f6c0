"""The likelihood of modal tests: f_hat ~ N(f(theta), (sigma f_hat)^2 + sd^2), thesis (4.5).

sigma is the unknown fractional model error (a parameter, uniform on [0, 1]); sd is the standard
deviation of the identification where it is known. A fictitious error `floor`, a fraction of f_hat
like sigma, may be added to the variance: it is what the sampler lowers from infinity to 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.errors import BadInput
from shm.models import Model
from shm.values import PLANES, FloatArray, IntArray, ModalTest, Mode


@dataclass(frozen=True, eq=False)
class Measured:
    """All measured frequencies of the tests as arrays of shape (measurements,).

    `plane` and `order` index the model's frequencies (order from 0); `sd_hz` is 0 where unknown;
    `repeat` counts the data set N_D times, as the thesis does.
    """

    plane: IntArray
    order: IntArray
    frequency_hz: FloatArray
    sd_hz: FloatArray
    repeat: int = 1

    @property
    def modes(self) -> int:
        """How many modes a plane the model must give."""
        return int(self.order.max()) + 1


def measured(tests: Sequence[ModalTest], repeat: int = 1) -> Measured:
    """The frequencies of all modes of all tests; raises BadInput where there are none."""
    modes: list[Mode] = [mode for test in tests for mode in test.modes]
    if not modes:
        raise BadInput("no measured frequency to update with.", remedy="Give a test with modes.")
    return Measured(
        plane=np.array([PLANES.index(mode.plane) for mode in modes]),
        order=np.array([mode.order - 1 for mode in modes]),
        frequency_hz=np.array([mode.frequency_hz for mode in modes]),
        sd_hz=np.nan_to_num([mode.frequency_sd_hz for mode in modes], nan=0.0),
        repeat=repeat,
    )


def predicted_hz(model: Model, theta: FloatArray, data: Measured) -> FloatArray:
    """The model's frequency for each measurement, shape (n, measurements)."""
    return model.frequencies_hz(theta, data.modes)[:, data.plane, data.order]


def log_likelihood(
    predicted: FloatArray, sigma: FloatArray, data: Measured, floor: float = 0.0
) -> FloatArray:
    """Log likelihood, shape (n,), of predictions (n, measurements) and model errors (n,)."""
    fraction = sigma[:, None] ** 2 + floor**2
    variance = fraction * data.frequency_hz**2 + data.sd_hz**2
    misfit = (predicted - data.frequency_hz) ** 2 / variance
    terms = misfit + np.log(2 * np.pi * variance)
    return np.asarray(-0.5 * data.repeat * terms.sum(axis=1))
