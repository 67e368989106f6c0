"""The posterior density of a hypothesis and, from several starts, its most probable points.

All are climbed to in one batch, by slopes from differences and by
damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963). The unknown size of the errors is
averaged over its probabilities at each point, which is expectation maximisation (Dempster et al.
1977): the gradient is exact, and no step is too bold while the misfit is large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.contract import Hypothesis
from shm.gap.coordinates import Branch
from shm.gap.likelihood import Likelihood
from shm.gap.problem import GapProblem
from shm.inference.coordinates import log_normal
from shm.inference.mixture import Rows
from shm.values import BoolArray, FloatArray

_DIFFERENCE = 1e-4  # technical: forward differences err by half of it times the curvature
_STEEPEST = 1e3
"""Slopes beyond this are cliffs: where a support's own mode crosses one of the bar, the names of
the two change places. Nothing can be followed over them."""


@dataclass(frozen=True, eq=False)
class Views(Rows):
    """The data seen from `m` points w (m, d): `residual` (m, data), measured less predicted.

    `slopes` (m, data, d) are the prediction's derivatives by w; `log_posterior` (m,) is the log of
    likelihood times prior density by w.
    """

    w: FloatArray
    residual: FloatArray
    slopes: FloatArray
    log_posterior: FloatArray


class Landscape:
    """The posterior of a hypothesis, by the problem's own likelihood or by another one."""

    def __init__(
        self, problem: GapProblem, hypothesis: Hypothesis, likelihood: Likelihood | None = None
    ):
        self.problem = problem
        self.hypothesis = hypothesis
        self.likelihood = likelihood or problem.likelihood(hypothesis)
        self.coordinates = problem.coordinates(hypothesis)
        self._value = problem.observations.value

    def residual(self, z: FloatArray) -> FloatArray:
        """Measured less predicted (n, data) at z (n, d)."""
        with np.errstate(all="ignore"):
            return np.asarray(self._value - self.problem.predict(self.hypothesis, z))

    def log_posterior(self, z: FloatArray) -> FloatArray:
        """Log of likelihood times prior density by z (n, d), (n,)."""
        return self.likelihood.log(self.residual(z)) + log_normal(z)

    def views(self, w: FloatArray, signs: FloatArray, known: FloatArray | None = None) -> Views:
        """From points w (m, d), each on the branch of `signs` (m, d), all in one batch.

        `known` (m, data, d) are slopes of near points, of which those by the nearly linear
        parameters are taken over.
        """
        m, d = w.shape
        moved = np.arange(d) if known is None else self.coordinates.other
        shifted = w + _DIFFERENCE * np.concatenate([np.zeros((1, 1, d)), np.eye(d)[moved, None]])
        branch = Branch(np.tile(signs, (len(shifted), 1)))
        residual = self.residual(branch.z(shifted.reshape(-1, d))).reshape(len(shifted), m, -1)
        slopes = np.empty((m, residual.shape[2], d)) if known is None else known.copy()
        slopes[:, :, moved] = np.moveaxis(residual[0] - residual[1:], 0, -1) / _DIFFERENCE
        likelihood = self.likelihood.log(residual[0])
        likelihood = np.where(np.isfinite(slopes).all(axis=(1, 2)), likelihood, -np.inf)
        slopes[np.abs(slopes) > _STEEPEST] = 0.0
        return Views(w, residual[0], slopes, likelihood + log_normal(w))


# Judgement, as Marquardt's method mostly goes to the same optima: steps of at most one standard
# deviation of the prior, whose damping falls fast and rises faster; after so many of them a point
# is taken as it is.
_MOST_STEPS, _MOST_LAST_STEPS, _LONGEST_STEP = 15, 5, 1.0
_FIRST_DAMPING, _LESS, _MORE, _FIRST_REFUSAL = 1e-2, 0.2, 8.0, 0.1
_LEAST_DAMPING, _MOST_DAMPING = 1e-8, 1e6
# Technical: a step of the tension, in sds of its prior, from which on slopes are computed anew.
_FAR = 0.03

# A log evidence is then known to 0.02; one that is a thousand times smaller counts for nothing.
_CONVERGED_GAIN, _HOPELESS = 0.02, 7.0
# Judgement: two normal peaks half a standard deviation apart are one (their overlap is 0.97).
_SAME = 0.5
# Judgement: the prior's own curvature is 1, and a posterior flatter than a third of it is no peak.
_FLATTEST = 0.3
# Technical: some hundred roundings of a double; and a log probability that no sum feels.
_ROUNDING, NEVER = 1e-13, -1e300


@dataclass(frozen=True, eq=False)
class Optimum:
    """A most probable point w (d,) on a branch, seen with slopes, and the curvature (d, d) there.

    `log_posterior` is the log of likelihood times prior density by w, the branch's own prior
    included; `log_evidence` the log of the integral that a normal distribution makes of it.
    """

    branch: Branch
    w: FloatArray
    residual: FloatArray
    slopes: FloatArray
    curvature: FloatArray
    log_posterior: float

    @property
    def covariance(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.curvature))

    @property
    def log_evidence(self) -> float:
        volume = len(self.w) * np.log(2 * np.pi) - np.linalg.slogdet(self.curvature)[1]
        return float(self.log_posterior + volume / 2)


@dataclass(frozen=True, eq=False)
class _Downhill(Rows):
    """Gradients (m, d) of the log posterior and its curvatures (m, d, d).

    `profile` (m,) is the log posterior with the linear parameters where they would go best.
    """

    gradient: FloatArray
    curvature: FloatArray
    profile: FloatArray

    def step(self, damping: FloatArray) -> FloatArray:
        """Damped steps (m, d)."""
        diagonal = np.einsum("mdd->md", self.curvature) * damping[:, None]
        damped = self.curvature + diagonal[..., None] * np.eye(self.gradient.shape[1])
        step = np.linalg.solve(damped, self.gradient[..., None])[..., 0]
        longest = np.abs(step).max(axis=1, keepdims=True)
        return np.asarray(step / np.maximum(longest / _LONGEST_STEP, 1.0))

    @property
    def gain(self) -> FloatArray:
        """What full steps promise to add to the log posterior (m,)."""
        full = np.linalg.solve(self.curvature, self.gradient[..., None])[..., 0]
        return np.asarray((full * self.gradient).sum(axis=1) / 2)


@dataclass(frozen=True, eq=False)
class _Walkers(Rows):
    """Points on their way, each on a branch of `signs` (m, d), with their damping (m,)."""

    views: Views
    downhill: _Downhill
    signs: FloatArray
    damping: FloatArray


def optima(landscape: Landscape, starts: FloatArray) -> list[Optimum]:
    """The distinct most probable points reached from `starts` z (m, d), the best first.

    On the way, the slopes by the nearly linear parameters are taken over from step to step where
    these move little; the optima are seen anew and, where that makes a difference, climbed again.
    """
    signs = np.array([_branch(landscape, z).signs for z in starts])
    found = _climbed(landscape, Branch(signs).w(starts), signs, _MOST_STEPS)
    if not found:
        return found
    signs = np.array([each.branch.signs for each in found])
    return _climbed(landscape, np.array([each.w for each in found]), signs, _MOST_LAST_STEPS)


def _climbed(landscape: Landscape, w: FloatArray, signs: FloatArray, steps: int) -> list[Optimum]:
    """The distinct optima above points w (m, d) that count, the best first."""
    views = landscape.views(w, signs)
    walkers = _Walkers(views, _downhill(landscape, views), signs, np.full(len(w), _FIRST_DAMPING))
    walkers = walkers.take(np.asarray(np.isfinite(views.log_posterior)))
    done: list[Optimum] = []
    for left in range(steps, -1, -1):
        if not len(walkers.signs):
            break
        ready = (walkers.downhill.gain < _CONVERGED_GAIN) | (walkers.damping >= _MOST_DAMPING)
        ready |= left == 0
        done += [_optimum(walkers, int(row)) for row in np.flatnonzero(ready)]
        walkers = walkers.take(~ready & _promising(walkers, done))
        if len(walkers.signs):
            walkers = _moved(landscape, walkers)
    best = _distinct(done)
    return [each for each in best if each.log_evidence > best[0].log_evidence - _HOPELESS]


def _moved(landscape: Landscape, walkers: _Walkers) -> _Walkers:
    """One step of each walker, taken back where it leads down."""
    views, signs = walkers.views, walkers.signs
    step = walkers.downhill.step(walkers.damping)
    far = np.abs(step[:, landscape.coordinates.tension]).max(initial=0.0) > _FAR
    w = _caught_up(landscape, views.w + step, signs, views.slopes)
    tried = landscape.views(w, signs, None if far else views.slopes)
    downhill = _downhill(landscape, tried)
    better = tried.log_posterior > views.log_posterior
    better = better | (downhill.profile > walkers.downhill.profile)
    more = np.maximum(walkers.damping * _MORE, _FIRST_REFUSAL)
    damping = np.where(better, walkers.damping * _LESS, more)
    return _Walkers(
        tried.where(better, views),
        downhill.where(better, walkers.downhill),
        signs,
        damping.clip(_LEAST_DAMPING, _MOST_DAMPING),
    )


def _caught_up(
    landscape: Landscape, w: FloatArray, signs: FloatArray, slopes: FloatArray
) -> FloatArray:
    """Points w (m, d) with the linear parameters where they go best, by slopes of near points.

    At the end of a step they lag behind where the ridge of the posterior is bent.
    """
    linear = landscape.coordinates.linear
    residual = landscape.residual(Branch(signs).z(w))
    known = np.asarray(np.isfinite(residual).all(axis=1))
    residual = np.where(known[:, None], residual, 0.0)
    gram = landscape.likelihood.gram(
        np.concatenate([slopes[:, :, linear], residual[..., None]], axis=2)
    )
    step, gain = _linear_step(gram, w[:, linear])
    node = (landscape.likelihood.by_node(residual) + gain).argmax(axis=1)
    step = step[np.arange(len(w)), node].clip(-_LONGEST_STEP, _LONGEST_STEP)
    moved = w.copy()
    moved[:, linear] += np.where(known[:, None], step, 0.0)
    return moved


def _linear_step(gram: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Best steps (m, nodes, l) of linear parameters at w (m, l) and what they gain (m, nodes).

    `gram` (m, nodes, l + 1, l + 1) is that of their slopes and the residual.
    """
    pull = gram[:, :, :-1, -1] - w[:, None]
    inner = gram[:, :, :-1, :-1]
    # Where a prediction jumps, slopes are so steep that the prior drowns in their rounding.
    ridge = 1 + _ROUNDING * np.trace(inner, axis1=2, axis2=3)[..., None, None]
    step = np.linalg.solve(inner + ridge * np.eye(w.shape[1]), pull[..., None])[..., 0]
    return np.asarray(step), np.asarray((pull * step).sum(axis=2) / 2)


def _branch(landscape: Landscape, z: FloatArray) -> Branch:
    return next(b for b in landscape.coordinates.branches if b.holds(z[None])[0])


def _downhill(landscape: Landscape, views: Views) -> _Downhill:
    columns = np.concatenate([views.slopes, views.residual[..., None]], axis=2)
    # What cannot be predicted pulls nowhere: no factorisation takes a NaN.
    columns = np.where(np.isfinite(columns), columns, 0.0)
    log = landscape.likelihood.by_node(views.residual)
    log = np.where(np.isfinite(log), log, NEVER)
    gram = landscape.likelihood.gram(columns)
    probability = np.exp(log - scipy.special.logsumexp(log, axis=1, keepdims=True))
    mean = np.einsum("mk,mkij->mij", probability, gram)
    pulls = gram[..., :-1, -1]
    spread = pulls - mean[:, None, :-1, -1]
    spread = np.einsum("mk,mki,mkj->mij", probability, spread, spread)
    curvature = mean[:, :-1, :-1] + np.eye(views.w.shape[1])
    return _Downhill(
        mean[:, :-1, -1] - views.w,
        _positive(curvature - spread, curvature),
        _profile(landscape, views, gram, log),
    )


def _profile(landscape: Landscape, views: Views, gram: FloatArray, log: FloatArray) -> FloatArray:
    """The log posterior (m,) with the linear parameters at their best in each node."""
    linear = landscape.coordinates.linear
    columns = np.append(linear, gram.shape[-1] - 1)
    _, gain = _linear_step(gram[:, :, columns[:, None], columns], views.w[:, linear])
    return np.asarray(scipy.special.logsumexp(log + gain, axis=1) + log_normal(views.w))


def _promising(walkers: _Walkers, done: list[Optimum]) -> BoolArray:
    """Which points may still reach something that counts and that no better one reaches too."""
    log, curvature = walkers.views.log_posterior, walkers.downhill.curvature
    w, signs = walkers.views.w, walkers.signs
    best = max([log.max(), *(each.log_posterior - each.branch.log_prior for each in done)])
    hoped = np.maximum(log + walkers.downhill.gain, walkers.downhill.profile)
    promising = np.asarray(hoped > best - _HOPELESS)
    for a in np.flatnonzero(promising):
        for b in np.flatnonzero(promising):
            if hoped[a] < hoped[b] and _near(w[a], w[b], curvature[b], signs[a], signs[b]):
                promising[a] = False
    return promising


def _near(
    w: FloatArray, other: FloatArray, curvature: FloatArray, signs: FloatArray, others: FloatArray
) -> bool:
    """Whether a point lies within a fraction of a standard deviation of another."""
    away = w - other
    return bool((signs == others).all() and away @ curvature @ away < _SAME**2)


def _optimum(walkers: _Walkers, row: int) -> Optimum:
    branch, views = Branch(walkers.signs[row]), walkers.views
    return Optimum(
        branch,
        views.w[row],
        views.residual[row],
        views.slopes[row],
        walkers.downhill.curvature[row],
        float(views.log_posterior[row]) + branch.log_prior,
    )


def _positive(curvature: FloatArray, safe: FloatArray) -> FloatArray:
    """Curvatures (m, d, d), or the `safe` ones where they are much flatter than a prior's."""
    flattest = np.linalg.eigvalsh(curvature)[:, 0]
    return np.where((flattest < _FLATTEST)[:, None, None], safe, curvature)


def _distinct(found: list[Optimum]) -> list[Optimum]:
    kept: list[Optimum] = []
    for each in sorted(found, key=lambda optimum: -optimum.log_evidence):
        if not any(
            _near(each.w, o.w, o.curvature, each.branch.signs, o.branch.signs) for o in kept
        ):
            kept.append(each)
    return kept
