"""The posterior of one hypothesis, and its peaks.

Levenberg and Marquardt's steps lead to the peaks from several starts, all at once: most of the time
of a solution is the same for one hanger and for twenty. Slopes by parameters in which the data are
nearly linear are taken over from step to step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy

from shm.gap.contract import Hypothesis, Peak
from shm.gap.likelihood import Likelihood
from shm.inference.coordinates import log_normal
from shm.inference.mixture import Rows
from shm.values import BoolArray, FloatArray, IntArray

_STEEPEST, FARTHEST_LINEAR = 1e3, 12.0  # numerical: a slope beyond is a cliff: two modes cross
SETTLED = 0.3
"""Numerical: of a prior's standard deviation; over less the slopes of linear parameters hold."""


@dataclass(frozen=True)
class ClimbOptions:
    """Hold the numbers of a climb, all of them numerical.

    It takes so many `steps`, of which the first are `free`, until one gains less than `no_gain` in
    log posterior, or it is `far_behind` the best. Each step is `tried` with several dampings, by
    factors, with the `longest` way of each in standard deviations of a prior; the next one is a
    factor `shorter` where none leads up. Slopes are forward differences over `difference`. No
    climb goes beyond `farthest`. Peaks within `same` of their standard deviations are one.
    """

    steps: int = 25
    free: int = 3
    no_gain: float = 0.02
    far_behind: float = 8.0
    damping: float = 0.03
    least_damping: float = 1e-3
    most_damping: float = 1e5
    tried: tuple[float, ...] = (0.03, 1.0, 30.0)
    longest: tuple[float, ...] = (3.0, 1.0, 1.0)
    shorter: float = 100.0
    difference: float = 1e-4
    farthest: float = 4.5
    same: float = 0.3


_HOW = ClimbOptions()


class Problem(Protocol):
    """Predictions of hypotheses for one set of data."""

    @property
    def value(self) -> FloatArray:
        """Return the data (data,)."""

    def linear(self, hypothesis: Hypothesis) -> IntArray:
        """Return the columns in which predictions are nearly linear."""

    def dimension(self, hypothesis: Hypothesis) -> int:
        """Return how many parameters there are."""

    def predict(self, hypothesis: Hypothesis, z: FloatArray) -> FloatArray:
        """Return the data (n, data) that z (n, d) predict; NaN where they cannot."""

    def likelihood(self, hypothesis: Hypothesis) -> Likelihood:
        """Return the likelihood of residuals."""


class Target:
    """The posterior of a hypothesis in coordinates z (d,) with standard normal priors."""

    def __init__(
        self, problem: Problem, hypothesis: Hypothesis, likelihood: Likelihood | None = None
    ):
        self.problem, self.hypothesis = problem, hypothesis
        self.likelihood = likelihood or problem.likelihood(hypothesis)
        self.dimension = problem.dimension(hypothesis)
        self.linear = problem.linear(hypothesis)
        self.other: IntArray = np.setdiff1d(np.arange(self.dimension), self.linear)
        self.farthest: FloatArray = np.full(self.dimension, _HOW.farthest)
        self.farthest[self.linear] = FARTHEST_LINEAR

    def residual(self, z: FloatArray) -> FloatArray:
        """Return measured less predicted (n, data) at z (n, d)."""
        with np.errstate(all="ignore"):
            return np.asarray(self.problem.value - self.problem.predict(self.hypothesis, z))

    def log(self, z: FloatArray) -> FloatArray:
        """Return the log of likelihood times prior (n,) at z (n, d)."""
        return np.asarray(self.likelihood.log(self.residual(z)) + log_normal(z))

    def view(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the residual (data,) and the prediction's slopes (data, d) at z (d,)."""
        return self.residual(z[None])[0], self._slopes(z[None])[0]

    def climb(self, starts: FloatArray, hopeless: float = -np.inf) -> list[Peak]:
        """Return the peaks above `starts` z (m, d), all climbed at once; one where ways meet.

        Those are given up that cannot come near the best, or to the log posterior `hopeless`.
        """
        residual = self.residual(starts)
        log = np.asarray(self.likelihood.log(residual) + log_normal(starts))
        slopes, damping = self._slopes(starts), np.full(len(starts), _HOW.damping)
        ways, found = self._ways(starts, log, residual, slopes, damping), list[Peak]()
        for taken in range(_HOW.steps):
            hopeless = max(hopeless, float(ways.log.max()) - _HOW.far_behind)
            over = ways.settled | ways.met
            if taken >= _HOW.free:
                over |= ways.log + 2 * ways.hoped < hopeless
            found += ways.take(over).peaks
            ways = ways.take(~over)
            if not len(ways.z):
                break
            ways = self._step(ways)
        return found + ways.peaks

    def _step(self, ways: _Ways) -> _Ways:
        """Take the best of steps of Levenberg and Marquardt of several lengths on each way."""
        damping = ways.damping[:, None] * np.array(_HOW.tried)
        inner = ways.hessian[:, None] * (1 + damping[..., None, None] * np.eye(self.dimension))
        step = np.linalg.solve(
            inner, np.tile(ways.gradient[:, None, :, None], (len(_HOW.tried), 1, 1))
        )
        largest = np.abs(step).max(axis=2, keepdims=True)
        step = (step / np.maximum(1.0, largest / np.array(_HOW.longest)[:, None, None]))[..., 0]
        tried = np.clip(ways.z[:, None] + step, -self.farthest, self.farthest)
        flat = tried.reshape(-1, self.dimension)
        residual = self.residual(flat)
        log = np.asarray(self.likelihood.log(residual) + log_normal(flat)).reshape(damping.shape)
        best = np.arange(len(log)), log.argmax(axis=1)
        up = np.asarray(log[best] > ways.log)
        shorter = np.where(up, np.inf, ways.damping * _HOW.shorter)
        stayed = replace(ways, damping=shorter).take(~up)
        if not up.any():
            return stayed
        gained = np.where(log[best] - ways.log < _HOW.no_gain, np.inf, damping[best])[up]
        z, residual = tried[best][up], residual.reshape(*damping.shape, -1)[best][up]
        away = np.abs(z - ways.z[up])
        near = np.zeros(z.shape, dtype=bool)
        near[:, self.linear] = (away[:, self.linear] <= SETTLED).all(axis=1)[:, None]
        near |= (away < _HOW.same * ways.sd[up]).all(axis=1)[:, None]
        slopes = self._slopes(z, ways.slopes[up], near)
        moved = self._ways(z, log[best][up], residual, slopes, gained.clip(_HOW.least_damping))
        return moved.joined(stayed)

    def _slopes(
        self,
        z: FloatArray,
        known: FloatArray | None = None,
        near: BoolArray | None = None,
    ) -> FloatArray:
        """Return the prediction's slopes (m, data, d) at z (m, d).

        Those of `near` (m, d) points are taken over from those `known`.
        """
        row, column = np.nonzero(np.ones(z.shape, dtype=bool) if near is None else ~near)
        slopes = np.zeros((*z.shape[:1], len(self.problem.value), z.shape[1]))
        slopes = slopes if known is None else known.copy()
        if not len(row):
            return slopes
        step = np.where(z > 0, -_HOW.difference, _HOW.difference)[row, column]
        points = z[row]
        points[np.arange(len(row)), column] += step
        # In one batch: what the others of a batch do to a point is small, but no difference.
        here, there = np.split(self.residual(np.vstack([z, points])), [len(z)])
        found = (here[row] - there) / step[:, None]
        slopes[row, :, column] = np.where(np.abs(found) < _STEEPEST, found, 0.0)
        return slopes

    def _ways(
        self,
        z: FloatArray,
        log: FloatArray,
        residual: FloatArray,
        slopes: FloatArray,
        damping: FloatArray,
    ) -> _Ways:
        """Return the ways at z (m, d), with Gauss and Newton's Hessian of the log posterior."""
        finite = np.asarray(np.isfinite(residual).all(axis=1))
        known = np.where(finite[:, None], residual, 0.0)
        share = scipy.special.softmax(self.likelihood.by_node(known), axis=1)
        columns = np.concatenate([slopes, known[:, :, None]], axis=2)
        gram = np.einsum("mk,mkij->mij", share, self.likelihood.gram(columns))
        gram[~finite] = 0.0
        hessian = gram[:, :-1, :-1] + np.eye(self.dimension)
        return _Ways(z, log, slopes, hessian, gram[:, :-1, -1] - z, damping)


@dataclass(frozen=True, eq=False)
class _Ways(Rows):
    """Where m climbs are: points z (m, d) with their log posterior (m,) and slopes (m, data, d).

    `hessian` (m, d, d) and `gradient` (m, d) are those of the log posterior, up to the sign;
    `damping` (m,) is that of the next step, infinite where the last one gained nothing.
    """

    z: FloatArray
    log: FloatArray
    slopes: FloatArray
    hessian: FloatArray
    gradient: FloatArray
    damping: FloatArray

    @property
    def sd(self) -> FloatArray:
        """Return the standard deviations (m, d) of normal distributions there."""
        return np.asarray(np.sqrt(np.einsum("mii->mi", np.linalg.inv(self.hessian))))

    @property
    def hoped(self) -> FloatArray:
        """Return twice the gain (m,) of the undamped step, were all linear."""
        step = np.linalg.solve(self.hessian, self.gradient[..., None])[..., 0]
        return np.asarray((self.gradient * step).sum(axis=1))

    @property
    def settled(self) -> BoolArray:
        return np.asarray((self.hoped < _HOW.no_gain) | (self.damping > _HOW.most_damping))

    @property
    def met(self) -> BoolArray:
        """Return which points (m,) lie beside a higher one, by its standard deviations."""
        beside = (np.abs(self.z[:, None] - self.z) < _HOW.same * self.sd).all(axis=2)
        rank = np.argsort(np.argsort(-self.log, kind="stable"))
        return np.asarray((beside & (rank[:, None] > rank)).any(axis=1))

    @property
    def peaks(self) -> list[Peak]:
        covariance = np.linalg.inv(self.hessian)
        return [Peak(*each) for each in zip(self.z, self.log.tolist(), covariance, strict=True)]


def find_peaks(target: Target, starts: FloatArray, hopeless: float = -np.inf) -> list[Peak]:
    """Return the distinct peaks above `starts` z (m, d), the highest first.

    `hopeless` is the log posterior from which on a peak counts.
    """
    found: list[Peak] = []
    for peak in sorted(target.climb(starts, hopeless), key=lambda each: -each.log):
        if np.isfinite(peak.log) and not any(_same(peak, each) for each in found):
            found.append(peak)
    return found


def _same(one: Peak, other: Peak) -> bool:
    away = np.abs(one.z - other.z) / np.sqrt(np.diag(other.covariance))
    return bool((away < _HOW.same).all())


def laplace(peaks: Sequence[Peak]) -> float:
    """Return the log evidence by normal distributions on the peaks."""
    return float(scipy.special.logsumexp([peak.log_evidence for peak in peaks]))
