"""A fit again on part of its data: a few Gauss-Newton steps that start from the full fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shm.gap.contract import Fit, NoiseNode
from shm.gap.likelihood import Likelihood
from shm.gap.problem import GapProblem
from shm.values import BoolArray, FloatArray, IntArray

_STEPS = 6
_STEP_IN_SDS = 0.05
_SHORTER = 0.3


@dataclass(frozen=True, eq=False)
class _Part:
    """The data `rows` of a fold that stay in the fit, of which the first are frequencies."""

    rows: IntArray
    value: FloatArray
    slopes: FloatArray
    errors: Likelihood

    @classmethod
    def of(cls, problem: GapProblem, fit: Fit, kept: BoolArray) -> _Part:
        """`kept` (F,) are the frequencies that stay; a shape goes with its frequency."""
        design = problem.observations.design
        frequency, shape = np.flatnonzero(kept), np.flatnonzero(kept[design.shape_mode])
        rows = np.concatenate([frequency, design.frequencies + shape])
        return cls(
            rows,
            problem.observations.value[rows],
            fit.slopes[rows],
            Likelihood([NoiseNode(fit.noise.part(frequency, shape), 0.0, fit.model_error)]),
        )

    def weighed(self, data: FloatArray) -> FloatArray:
        """The precision of the data times `data` (rows, ...)."""
        found = self.errors.weighed(data.reshape(len(data), -1))
        return np.concatenate([found.frequency[0], found.shape[0]]).reshape(data.shape)

    @cached_property
    def information(self) -> FloatArray:
        """The inverse of the posterior's covariance (d, d)."""
        return np.eye(self.slopes.shape[1]) + self.slopes.T @ self.weighed(self.slopes)

    def misfit(self, z: FloatArray, predicted: FloatArray) -> float:
        """Twice the negative log of the posterior density, but for a constant."""
        residual = self.value - predicted[self.rows]
        return float(residual @ self.weighed(residual) + z @ z)

    def step(self, z: FloatArray, predicted: FloatArray) -> FloatArray:
        """The Gauss-Newton step (d,)."""
        residual = self.value - predicted[self.rows]
        downhill = self.slopes.T @ self.weighed(residual) - z
        return np.asarray(np.linalg.solve(self.information, downhill))

    def sds(self, step: FloatArray) -> float:
        """The length of a step in standard deviations of the posterior."""
        return float(np.sqrt(step @ self.information @ step))


def refitted(problem: GapProblem, fit: Fit, kept: BoolArray) -> FloatArray:
    """Predictions (folds, data) of `fit` refitted to the frequencies `kept` (folds, F) alone.

    The slopes and the sizes of unknown errors are those of the full fit; the predictions are
    computed anew in every step, for all folds at once. A step that does not lower the misfit is
    taken back and tried shorter.
    """
    parts = [_Part.of(problem, fit, rows) for rows in kept]
    z = np.repeat(fit.z[None], len(parts), axis=0)
    predicted = np.repeat(fit.predicted[None], len(parts), axis=0)
    misfit = _misfits(parts, z, predicted)
    length = np.ones(len(parts))
    for _ in range(_STEPS):
        steps = length[:, None] * _steps(parts, z, predicted)
        large = [part.sds(step) > _STEP_IN_SDS for part, step in zip(parts, steps, strict=True)]
        if not any(large):
            break
        there = problem.predict(fit.hypothesis, z + steps)
        tried = _misfits(parts, z + steps, there)
        better = tried < misfit
        z = np.where(better[:, None], z + steps, z)
        predicted = np.where(better[:, None], there, predicted)
        misfit = np.where(better, tried, misfit)
        length = np.where(better, 1.0, _SHORTER * length)
    return predicted


def _steps(parts: list[_Part], z: FloatArray, predicted: FloatArray) -> FloatArray:
    return np.array([part.step(*each) for part, *each in zip(parts, z, predicted, strict=True)])


def _misfits(parts: list[_Part], z: FloatArray, predicted: FloatArray) -> FloatArray:
    return np.array([part.misfit(*each) for part, *each in zip(parts, z, predicted, strict=True)])
