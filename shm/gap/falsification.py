"""Which explanations the data do not contradict at stated error bounds, without any prior.

Error-domain model falsification (Goulet and Smith, Comput. Struct. 124, 2013): an explanation stays
as long as every residual of it lies within the bounds of the errors of measurement and model
together, bounds that all n of them keep with 95 %, each by itself with 0.95^(1/n) (Sidak 1967). It
ranks nothing. What it adds to probabilities: it does not depend on what else was tried.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.attribution import Attribution
from shm.gap.contract import Fit, Hypothesis
from shm.gap.noise import SD_LOWER
from shm.gap.problem import GapProblem
from shm.values import NO_GAP, Compatibility, FloatArray

# As far as frequencies of sound hangers of others were off in all tests alike (`shm.gap.noise`):
# larger model errors are possible, but who allows for them falsifies nothing.
_MODEL_ERROR = 5e-4
_LEVEL = 0.95  # Goulet and Smith's, and the usual one
_STEPS = 60  # technical: halvings from ten standard deviations to a rounding error


@dataclass(frozen=True, eq=False)
class Bounds:
    """`width` (data,): what a datum may be off, either way, once errors that repeat, of sensors and
    of the section along the bar with loads (data, k), are taken as they fit best."""

    width: FloatArray
    loads: FloatArray

    def keep(self, residual: FloatArray) -> bool:
        """Whether residuals (data,) all lie within."""
        sds = self.width / scipy.special.ndtri((1 + _each(len(self.width))) / 2)
        weighed = self.loads / sds[:, None] ** 2
        inner = np.eye(self.loads.shape[1]) + weighed.T @ self.loads
        own = residual - self.loads @ np.linalg.solve(inner, weighed.T @ residual)
        return bool(np.all(np.abs(own) <= self.width))


def error_bounds(problem: GapProblem) -> Bounds:
    """Of the field's noise, whose size is one of several possibilities, each with its weight."""
    nodes, repeated = problem.likelihood(Hypothesis()).nodes, problem.repeated
    # Where no standard deviation is stated, `model_error` is the one that all errors have.
    stated = any(node.model_error < SD_LOWER for node in nodes)
    some = [node for node in nodes if not stated or node.model_error <= _MODEL_ERROR]
    shared = np.diag(repeated.frequency)
    variance = np.array(
        [
            np.concatenate([np.diag(each.covariance.frequency) - shared, each.covariance.shape])
            for each in some
        ]
    )
    weight = np.exp([node.log_weight for node in some])
    weight, sd = weight / weight.sum(), np.sqrt(variance)
    beyond = 1 - _each(sd.shape[1])
    low, high = np.zeros(sd.shape[1]), 10 * sd.max(axis=0)
    for _ in range(_STEPS):
        middle = (low + high) / 2
        too_narrow = 2 * weight @ scipy.special.ndtr(-middle / sd) > beyond
        low, high = np.where(too_narrow, middle, low), np.where(too_narrow, high, middle)
    return Bounds(np.asarray(high), repeated.loads)


def _each(data: int) -> float:
    """The probability with which each of so many data keeps its bound."""
    return float(_LEVEL ** (1 / data))


def compatibility(problem: GapProblem, attribution: Attribution) -> Compatibility:
    """Of no gap and of every cause that was fitted in full, each where it fits best."""
    bounds = error_bounds(problem)
    kept: dict[str, bool] = {NO_GAP: bounds.keep(_residual(problem, attribution.baseline))}
    for each in attribution.explanations:
        fits = [variant.fit for variant in each.variants if variant.fit is not None]
        if fits:
            kept[each.effect] = any(bounds.keep(_residual(problem, fit)) for fit in fits)
    frequencies = bounds.width[: problem.design.frequencies]
    return Compatibility(
        not_falsified=tuple(name for name, stays in kept.items() if stays),
        falsified=tuple(name for name, stays in kept.items() if not stays),
        bound_percent=100 * float(np.median(frequencies)),
        data=len(bounds.width),
    )


def _residual(problem: GapProblem, fit: Fit) -> FloatArray:
    return np.asarray(problem.observations.value - fit.predicted)
