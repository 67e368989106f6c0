"""What a fit predicts of data not yet measured, and how far two such predictions differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from shm.gap.contract import Design, Fit, Observations
from shm.gap.problem import GapProblem
from shm.gap.where import identification_sd
from shm.values import FloatArray

_USUAL_SHAPE_SD = 0.01
_STEP_IN_SDS = 0.1


@dataclass(frozen=True, eq=False)
class Foresight:
    """The normal distribution of new data: `mean` (data,), `covariance` (data, data)."""

    design: Design
    mean: FloatArray
    covariance: FloatArray

    def turned_to(self, other: Foresight) -> Foresight:
        """The same with the sign of each shape that agrees with `other`."""
        sign = _agreement(self.design, self.mean[None], other.mean)[0]
        return Foresight(self.design, sign * self.mean, np.outer(sign, sign) * self.covariance)


@dataclass(frozen=True, eq=False)
class Errors:
    """What the data err by: `sd` (data,) independently, the frequencies by `repeated` as well.

    The latter, a fraction, is the model error, the same for a mode in all tests. Explanations that
    are compared are given the same errors, lest a difference in errors pass for one in prediction.
    """

    sd: FloatArray
    repeated: float

    @classmethod
    def of(cls, observations: Observations, fit: Fit) -> Errors:
        known = np.isfinite(observations.sd[: observations.design.frequencies])
        return cls(identification_sd(observations, fit), fit.model_error if known.any() else 0.0)


def foreseen(problem: GapProblem, fit: Fit, design: Design, errors: Errors) -> Foresight:
    """What `fit` predicts of the data of a new test, given the old ones.

    Parameters vary by their posterior, the prediction with them to first order. New data err as
    the present ones do (median). The model error of a mode is the same in the new test as in the
    old ones, so that what the fit left over of a mode is expected again.
    """
    roots = _roots(fit.covariance)
    predicted = problem.predict(fit.hypothesis, _around(problem, fit, roots), design)
    predicted = predicted * _agreement(design, predicted, predicted[0])
    ahead, back = np.split(predicted[1:], 2)
    spread = (ahead - back).T / (2 * _STEP_IN_SDS)
    return _given_the_old(problem, fit, design, errors, predicted[0], spread)


def divergence(one: Foresight, other: Foresight) -> float:
    """The Kullback-Leibler divergence of two normal distributions, in natural units.

    The log Bayes factor to expect in favour of `one` where it is true.
    """
    factor = cho_factor(other.covariance, lower=True)
    apart = one.mean - other.mean
    trace = np.trace(cho_solve(factor, one.covariance))
    logs = 2 * np.log(np.diag(factor[0])).sum() - np.linalg.slogdet(one.covariance)[1]
    return float((trace + apart @ cho_solve(factor, apart) - len(apart) + logs) / 2)


def _roots(covariance: FloatArray) -> FloatArray:
    """Rows (d, d) whose outer products add to the covariance."""
    variance, directions = np.linalg.eigh(covariance)
    return np.asarray((directions * np.sqrt(np.maximum(variance, 0.0))).T)


def _around(problem: GapProblem, fit: Fit, roots: FloatArray) -> FloatArray:
    """The fit's point, then a step ahead and back in each direction (2 d + 1, d).

    A parameter that may have either sign jumps at 0: its points keep to the sign of the fit.
    """
    step = _STEP_IN_SDS * roots
    points = np.concatenate([fit.z[None], fit.z + step, fit.z - step])
    parameters = problem.coordinates(fit.hypothesis).parameters
    signed = np.array([parameter.signed for parameter in parameters])
    other_side = signed & (points * fit.z < 0)
    return np.where(other_side, np.copysign(1e-6, fit.z), points)


def _given_the_old(
    problem: GapProblem,
    fit: Fit,
    design: Design,
    errors: Errors,
    mean: FloatArray,
    spread: FloatArray,
) -> Foresight:
    """Condition predictions `mean` (data,) and `spread` (data, d) on the errors of the old data."""
    observations = problem.observations
    old, new = observations.design.frequencies, design.frequencies
    variance = errors.repeated**2
    was, will = problem.repeated, problem.section_of(design)
    shared = variance * _same_modes(design, observations.design)
    shared += will @ was.section.T
    among_old = variance * _same_modes(observations.design, observations.design) + was.frequency
    gain = np.linalg.solve(among_old + np.diag(errors.sd[:old] ** 2), shared.T).T
    mean, spread = mean.copy(), spread.copy()
    mean[:new] += gain @ (observations.value - fit.predicted)[:old]
    spread[:new] -= gain @ (fit.slopes @ _roots(fit.covariance).T)[:old]
    shapes = np.hypot(errors.sd[old:], np.linalg.norm(was.sensors, axis=1))
    shape_sd = np.median(shapes) if shapes.size else _USUAL_SHAPE_SD
    sd = np.repeat([np.median(errors.sd[:old]), shape_sd], [new, len(mean) - new])
    noise = np.diag(sd**2)
    read = problem.readings_of(design)
    among_new = variance * _same_modes(design, design) + will @ will.T + read @ read.T
    noise[:new, :new] += among_new - gain @ shared.T
    return Foresight(design, mean, spread @ spread.T + noise)


def _same_modes(one: Design, other: Design) -> FloatArray:
    """(F of one, F of the other): 1 where two frequencies are of one plane and order."""
    planes = one.frequency_plane[:, None] == other.frequency_plane
    return np.asarray(planes & (one.frequency_order[:, None] == other.frequency_order), dtype=float)


def _agreement(design: Design, predicted: FloatArray, reference: FloatArray) -> FloatArray:
    """Signs (n, data) that turn the shapes in `predicted` (n, data) to those in `reference`."""
    signs = np.ones_like(predicted)
    frequencies = design.frequencies
    products = (predicted * reference)[:, frequencies:]
    for mode in np.unique(design.shape_mode):
        rows = np.flatnonzero(design.shape_mode == mode)
        agrees = products[:, rows].sum(axis=1) >= 0
        signs[:, frequencies + rows] = np.where(agrees, 1.0, -1.0)[:, None]
    return signs
