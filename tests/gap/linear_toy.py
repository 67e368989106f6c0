"""A linear stand-in for a hanger: two planes of eight modes, three tests, four biaxial sensors."""

from __future__ import annotations

import numpy as np
from scipy import stats
from scipy.special import logsumexp

from shm.gap.hypotheses.contract import Design, Fit, Hypothesis, Observations
from shm.inference.sampler.likelihood import Covariance, NoiseNode
from shm.models.effects import Conditions
from shm.values import FloatArray
from tests.helpers.toy_gap import design_of

MODES, TESTS, PLACES = 8, 3, 4
FREQUENCY_SD, SHAPE_SD = 1e-4, 0.005


def design(temperatures: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Design:
    """Every mode in every test, both components of its shape at every sensor."""
    modes = [(plane, order) for plane in (0, 1) for order in range(1, MODES + 1)]
    conditions = [Conditions(f"t{k}", shift) for k, shift in enumerate(temperatures, 1)]
    return design_of(conditions, modes, tuple(1.0 + 2.0 * k for k in range(PLACES)), True)


def observations(value: FloatArray, of: Design | None = None) -> Observations:
    """Measured values (data,) with the toy's standard deviations."""
    own = of or design()
    sd = np.full(own.size, SHAPE_SD)
    sd[: own.frequencies] = FREQUENCY_SD
    return Observations(own, value, sd)


def noise(rng: np.random.Generator) -> FloatArray:
    """Errors (data,) of the identification; of shapes what scaling to unit length leaves."""
    own = design()
    sd = observations(np.zeros(own.size)).sd
    errors = sd * rng.standard_normal(own.size)
    shapes = errors[own.frequencies :].reshape(-1, 2 * PLACES)
    shapes -= shapes.mean(axis=1, keepdims=True)
    return np.asarray(errors)


def tension(size: float = 0.2) -> FloatArray:
    """The baseline's one slope (data, 1): all frequencies alike."""
    own = design()
    slopes = np.zeros((own.size, 1))
    slopes[: own.frequencies] = size
    return slopes


def stiffening(size: float) -> FloatArray:
    """A shift (data,) of the frequencies that grows with the order."""
    own = design()
    shift = np.zeros(own.size)
    shift[: own.frequencies] = size * (own.frequency_order / MODES) ** 2
    return shift


def log_evidence(nodes: tuple[NoiseNode, ...], slopes: FloatArray, value: FloatArray) -> float:
    """Of a linear hypothesis with standard normal parameters: value ~ N(0, noise + J J')."""
    count = design().frequencies
    if slopes[count:].any():
        raise ValueError("the toy's shapes do not depend on its parameters")
    logs = []
    for node in nodes:
        covariance = node.covariance.frequency + slopes[:count] @ slopes[:count].T
        frequencies = stats.multivariate_normal.logpdf(value[:count], None, covariance)
        shapes = stats.norm.logpdf(value[count:], scale=np.sqrt(node.covariance.shape)).sum()
        logs.append(node.log_weight + frequencies + shapes)
    return float(logsumexp(logs))


def fit(predicted: FloatArray, slopes: FloatArray, name: str = "") -> Fit:
    """A fit that sits at the origin of its coordinates, nothing drawn."""
    own = design()
    known = Covariance(
        np.eye(own.frequencies) * FREQUENCY_SD**2,
        np.full(len(own.shape_mode), SHAPE_SD**2),
        np.zeros((len(own.shape_mode), 0)),
    )
    parameters = slopes.shape[1]
    return Fit(
        Hypothesis(),
        np.zeros(parameters),
        np.eye(parameters),
        predicted,
        slopes,
        known,
        0.0,
        np.zeros((1, parameters)),
        0.0,
        0.0,
        0.0,
        name or "normal",
    )
