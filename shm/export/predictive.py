"""What each draw of a posterior says of each measured frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.errors import BadInput
from shm.inference.field import FieldLikelihood
from shm.inference.likelihood import Likelihood
from shm.inference.options import silent
from shm.inference.problem import Problem
from shm.models import THESIS, class_of
from shm.values import FloatArray, Hanger, ModalTest, Posterior

_TOLERANCE = 1e-6
_NATS = 0.2
"""The covariance was settled near the optimum that the sampler found, not at the most probable
draw: between the two the joint likelihood differs by 0.06 nats."""


@dataclass(frozen=True, eq=False)
class Predictive:
    """By draw and measurement, all (samples, measurements).

    `frequency_hz` are draws of what would be measured: the model's frequency with model error and
    identification error. `log_likelihood` is that of each measurement, its density in 1/Hz. With
    the priors of a description it is that of each by itself: errors that several share, and the
    doubt about the stated ones, belong to no measurement alone, and it does not add up to the
    posterior's.
    """

    frequency_hz: FloatArray
    log_likelihood: FloatArray


def predictive(posterior: Posterior, tests: Sequence[ModalTest], hanger: Hanger) -> Predictive:
    """Evaluates the model class again; draws are seeded with the posterior's seed.

    Raises BadInput where `tests` and `hanger` are not those that the posterior was made from.
    """
    if posterior.priors != THESIS:
        return _of_the_field(posterior, tests, hanger)
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


def _of_the_field(posterior: Posterior, tests: Sequence[ModalTest], hanger: Hanger) -> Predictive:
    """The same where the likelihood is that of `shm.inference.field`."""
    problem = Problem.of(tests, class_of(posterior, hanger), 1, silent)
    likelihood, sigma = problem.likelihood, posterior.samples[:, -1]
    if isinstance(likelihood, FieldLikelihood):
        likelihood.settle(problem.model, posterior.most_probable[:-1])
    predicted = problem.run(posterior.samples[:, :-1])
    kept = posterior.log_likelihood
    if not np.allclose(likelihood.joint(predicted, sigma), kept, rtol=1e-4, atol=_NATS):
        raise _another(posterior)
    by_mode = likelihood.by_mode(predicted)
    stated = [mode.frequency_sd_hz / mode.frequency_hz for mode in likelihood.modes]
    sd = np.hypot(sigma[:, None], np.nan_to_num(np.array(stated)))
    measured = np.array([mode.frequency_hz for mode in likelihood.modes])
    standardised = np.log(measured / by_mode) / sd
    own = -0.5 * standardised**2 - np.log(sd * measured) - 0.5 * np.log(2 * np.pi)
    rng = np.random.default_rng(posterior.seed)
    return Predictive(by_mode * np.exp(sd * rng.standard_normal(sd.shape)), np.asarray(own))


def _refuse_another(posterior: Posterior, joint: FloatArray) -> None:
    """The joint likelihood was kept; a data set that counts N_D times has N_D times as much."""
    repeat = max(1, round(float(np.median(posterior.log_likelihood / joint))))
    if not np.allclose(repeat * joint, posterior.log_likelihood, rtol=_TOLERANCE, atol=_TOLERANCE):
        raise _another(posterior)


def _another(posterior: Posterior) -> BadInput:
    return BadInput(
        f"the posterior of {', '.join(posterior.tests)} was not made from these tests and this "
        "description of the hanger.",
        remedy="Give those that it was made from, or leave them out.",
    )
