"""Data that are not yet measured, as a fit predicts them given the data that are.

Parameters vary by their posterior, and the prediction with them to first order; errors that repeat
are conditioned on what the fit left over of the old data. So the new data are normal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from shm.assumptions import Assumptions
from shm.gap.causes.residuals import identification_sd
from shm.gap.hypotheses.contract import Design, Fit
from shm.gap.hypotheses.noise import same_mode
from shm.gap.hypotheses.problem import GapProblem
from shm.inference.problem.noise import correlate_model_errors
from shm.values import NAN, FloatArray, IntArray

_STEP_IN_SDS = 0.1  # numerical: far from rounding, near enough for slopes to hold


@dataclass(frozen=True, eq=False)
class Foresight:
    """The normal distribution of new data: `mean` (data,), `covariance` (data, data)."""

    mean: FloatArray
    covariance: FloatArray


Pattern = Callable[[Design, Design], FloatArray]
"""How alike the frequencies of two designs are (F of one, F of the other), from 0 to 1."""


@dataclass(frozen=True, eq=False)
class Errors:
    """The errors of data: of old frequencies by `frequency_sd` (F,), of any shape by `shape_sd`.

    Frequencies err by `repeated` as well, a fraction: the model error, the same for a mode in all
    tests, correlated as is `assumed`. Explanations that are compared are given the same errors,
    lest a difference in errors pass for one in prediction. Something unknown adds a `remainder`, a
    fraction that comes again in every test, alike over orders by `pattern`.
    """

    frequency_sd: FloatArray
    shape_sd: float
    repeated: float
    assumed: Assumptions
    remainder: float = 0.0
    pattern: Pattern = same_mode

    @classmethod
    def of(cls, problem: GapProblem, fit: Fit) -> Errors:
        count = problem.design.frequencies
        known, sd = problem.observations.sd[:count], identification_sd(problem, fit)
        unseen = problem.hanger.assumptions.unstated_shape_sd.value
        return cls(
            sd[:count],
            float(np.median(sd[count:])) if len(sd) > count else unseen,
            fit.model_error if np.isfinite(known).any() else 0.0,
            problem.observations.assumed,
        )

    def between(self, one: Design, other: Design) -> FloatArray:
        """Return the covariance (F of one, F of the other) of what repeats."""
        together = correlate_model_errors(
            one.planes_and_orders, other.planes_and_orders, self.assumed
        )
        return np.asarray(
            self.repeated**2 * together + self.remainder**2 * self.pattern(one, other)
        )


class NewTests:
    """Tests not yet made, and what errors that repeat do to their data.

    With a `reading_sd` (a fraction) the last datum is the logarithm of a tension that is read.
    Shapes have the signs of the first fit's.
    """

    def __init__(self, problem: GapProblem, design: Design, reading_sd: float = NAN):
        self.problem, self.design, self.reading_sd = problem, design, reading_sd
        self._section, self._sensors = problem.section_of(design), problem.sensors_of(design)
        tensions, masses = problem.tensions_of(design), problem.masses_of(design)
        self._of_frequencies = np.hstack([self._section, tensions, masses])
        self._predictions: dict[Fit, tuple[FloatArray, FloatArray]] = {}
        self._first: FloatArray | None = None

    def foresee(self, fit: Fit, errors: Errors, rows: IntArray | None = None) -> Foresight:
        """Return the data that `fit` predicts, given the old ones: all, or those of `rows`.

        New data err as the present ones do (median). The model error of a mode is the same in the
        new test as in the old ones, so that what the fit left over of a mode is expected again.
        """
        problem, design, old = self.problem, self.design, self.problem.design
        if fit not in self._predictions:
            self._predictions[fit] = self._predict(fit)
        mean, spread = (each.copy() for each in self._predictions[fit])
        new, size = design.frequencies, design.size
        was, mode_loads = problem.repeated_with(fit.hypothesis.effects), self._of_frequencies
        shared = errors.between(design, old) + self._section @ was.section.T
        among_old = errors.between(old, old) + was.frequency + np.diag(errors.frequency_sd**2)
        gain = np.linalg.solve(among_old, shared.T).T
        mean[:new] += gain @ (problem.observations.value - fit.predicted)[: old.frequencies]
        spread[:new] -= gain @ (fit.slopes @ _roots(fit.covariance).T)[: old.frequencies]
        repeated = errors.between(design, design) + mode_loads @ mode_loads.T - gain @ shared.T
        rows = np.arange(len(mean)) if rows is None else rows
        sd = [np.median(errors.frequency_sd), errors.shape_sd, self.reading_sd]
        variance = np.repeat(sd, [new, size - new, len(mean) - size])[rows] ** 2
        covariance = spread[rows] @ spread[rows].T + np.diag(variance)
        frequencies = np.flatnonzero(rows < new)
        shapes = np.flatnonzero((rows >= new) & (rows < size))
        loads = self._sensors[rows[shapes] - new]
        covariance[np.ix_(frequencies, frequencies)] += repeated[
            np.ix_(rows[frequencies], rows[frequencies])
        ]
        covariance[np.ix_(shapes, shapes)] += loads @ loads.T
        return Foresight(mean[rows], covariance)

    def _predict(self, fit: Fit) -> tuple[FloatArray, FloatArray]:
        """Return the prediction (data,) and its change (data, d) along the posterior's roots."""
        around = _around(self.problem, fit, _roots(fit.covariance))
        predicted = self.problem.predict(fit.hypothesis, around, self.design)
        if self._first is None:
            self._first = predicted[0].copy()
        predicted = predicted * find_signs(self.design, predicted, self._first)
        if np.isfinite(self.reading_sd):
            tension_n = self.problem.tension_n(fit.hypothesis, around)
            predicted = np.column_stack([predicted, np.log(tension_n)])
        ahead, back = np.split(predicted[1:], 2)
        return predicted[0], (ahead - back).T / (2 * _STEP_IN_SDS)


def divergence(one: Foresight, other: Foresight) -> float:
    """Return the Kullback-Leibler divergence of two normal distributions, in natural units.

    That is the log Bayes factor to expect in favour of `one` where it is true.
    """
    factor = scipy.linalg.cho_factor(other.covariance, lower=True)
    apart = one.mean - other.mean
    trace = np.trace(scipy.linalg.cho_solve(factor, one.covariance))
    logs = 2 * np.log(np.diag(factor[0])).sum() - np.linalg.slogdet(one.covariance)[1]
    return float((trace + apart @ scipy.linalg.cho_solve(factor, apart) - len(apart) + logs) / 2)


def _roots(covariance: FloatArray) -> FloatArray:
    """Return rows (d, d) whose outer products add to the covariance."""
    variance, directions = np.linalg.eigh(covariance)
    return np.asarray((directions * np.sqrt(np.maximum(variance, 0.0))).T)


def _around(problem: GapProblem, fit: Fit, roots: FloatArray) -> FloatArray:
    """Return the fit's point, then a step ahead and back in each direction (2 d + 1, d).

    A parameter that may have either sign jumps at 0: its points keep to the sign of the fit.
    """
    step = _STEP_IN_SDS * roots
    points = np.concatenate([fit.z[None], fit.z + step, fit.z - step])
    coordinates = problem.coordinates(fit.hypothesis)
    effects = np.array([parameter.signed for parameter in coordinates.effects], dtype=bool)
    signed = np.append(np.zeros(coordinates.baseline, dtype=bool), effects)
    other_side = signed & (points * fit.z < 0)
    return np.where(other_side, np.copysign(1e-6, fit.z), points)


def find_signs(design: Design, predicted: FloatArray, reference: FloatArray) -> FloatArray:
    """Return signs (n, data) that turn the shapes in `predicted` (n, data) to the `reference`'s."""
    signs = np.ones_like(predicted)
    frequencies = design.frequencies
    products = (predicted * reference)[:, frequencies:]
    for mode in np.unique(design.shape_mode):
        rows = np.flatnonzero(design.shape_mode == mode)
        agrees = products[:, rows].sum(axis=1) >= 0
        signs[:, frequencies + rows] = np.where(agrees, 1.0, -1.0)[:, None]
    return signs
