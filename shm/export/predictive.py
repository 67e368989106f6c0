"""What each draw of a posterior says of each measured frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.errors import BadInput
from shm.models import class_of
from shm.inference.likelihood import Likelihood
from shm.values import FloatArray, Hanger, ModalTest, Posterior

_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Predictive:
    """By draw and measurement, all (samples, measurements).

    `frequency_hz` are draws of what would be measured: the model's frequency with model error and
    identification error. `log_likelihood` is that of each measurement, its density in 1/Hz.
    """

    frequency_hz: FloatArray
    log_likelihood: FloatArray


def predictive(posterior: Posterior, tests: Sequence[ModalTest], hanger: Hanger) -> Predictive:
    """Evaluates the model class again; draws are seeded with the posterior's seed.

    Raises BadInput where `tests` and `hanger` are not those that the posterior was made from.
    """
    likelihood = Likelihood(tests)
    sigma, theta = posterior.samples[:, -1], posterior.samples[:, :-1]
    model = class_of(posterior, hanger)
    model.prepare(likelihood.highest_order)
    predicted = likelihood.predict(model, theta)
    measured = likelihood.frequency_hz
    noise = np.hypot(sigma[:, None], likelihood.identification_error) * measured
    standardised = (measured - predicted) / noise
    log_likelihood = -0.5 * standardised**2 - np.log(noise) - 0.5 * np.log(2 * np.pi)
    _refuse_another(posterior, log_likelihood.sum(axis=1))
    rng = np.random.default_rng(posterior.seed)
    return Predictive(
        predicted + noise * rng.standard_normal(predicted.shape), np.asarray(log_likelihood)
    )


def _refuse_another(posterior: Posterior, joint: FloatArray) -> None:
    """The joint likelihood was kept; a data set that counts N_D times has N_D times as much."""
    repeat = max(1, round(float(np.median(posterior.log_likelihood / joint))))
    if not np.allclose(repeat * joint, posterior.log_likelihood, rtol=_TOLERANCE, atol=_TOLERANCE):
        raise BadInput(
            f"the posterior of {', '.join(posterior.tests)} was not made from these tests and this "
            "description of the hanger.",
            remedy="Give those that it was made from, or leave them out.",
        )
