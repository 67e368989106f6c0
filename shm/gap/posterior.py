"""The posterior and the evidence of one hypothesis.

Levenberg and Marquardt's steps lead from several starts to the peaks; importance sampling about
them gives draws and evidence. Parameters in which the data are nearly linear are integrated out in
closed form at each draw, so that only the others are sampled: from t distributions about the peaks,
refitted to their own draws, with a share of the prior so that no weight is unbounded (Hesterberg
1995; Cappe et al. 2008). Where too few draws are effective, emcee goes on from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from shm.gap.contract import Fit, Hypothesis, Method, Peak
from shm.gap.likelihood import Likelihood
from shm.gap.linear import Linear
from shm.inference.chain import run_chain
from shm.inference.coordinates import log_normal
from shm.inference.mixture import (
    Normal,
    Pool,
    Rows,
    TMixture,
    normalised,
    systematic,
    tempered,
)
from shm.values import ENOUGH_EFFECTIVE, BoolArray, FloatArray, IntArray

# Numerical: a climb's steps, and the gain in log posterior that is none; forward differences in
# standard deviations of a prior; a slope beyond is a cliff, where two modes change places.
_STEPS, _NO_GAIN, _MOST_DAMPING = 25, 0.02, 1e5
_DIFFERENCE, _STEEPEST, _FARTHEST, _FARTHEST_LINEAR = 1e-4, 1e3, 4.5, 12.0
# Numerical: standard deviations of a peak within which two are one; log density behind the best
# from which on a peak is not drawn about.
_SAME, _FAR_BELOW = 0.3, 10.0
# Numerical: draws and their proposals. Weights correct for all of them.
_ROUND, MOST_ROUNDS, _AT_FIRST, _FROM_PRIOR, _FROM_FIRST = 150, 30, 0.3, 0.1, 0.2
_WIDTHS, _WIDE_EVERY, _CANDIDATES = (1.0, 2.0), 4, 3000
_LEAST_WEIGHT, _RIDGE = 1e-2, 1e-6
_CLUSTERS, _FROM_WITHOUT, _PARTS, _POPULATION, _DRAWS_A_PART = 3, 0.4, 8, 600, 4
_SETTLED, _MOST_SETTLED = (
    0.3,
    4,
)  # of a prior's standard deviation: over less the slopes of linear parameters hold


class Problem(Protocol):
    """What hypotheses predict of one set of data."""

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
        self.farthest: FloatArray = np.full(self.dimension, _FARTHEST)
        self.farthest[self.linear] = _FARTHEST_LINEAR

    def residual(self, z: FloatArray) -> FloatArray:
        """Return measured less predicted (n, data) at z (n, d)."""
        with np.errstate(all="ignore"):
            return np.asarray(self.problem.value - self.problem.predict(self.hypothesis, z))

    def log(self, z: FloatArray) -> FloatArray:
        """Return the log of likelihood times prior (n,) at z (n, d)."""
        return np.asarray(self.likelihood.log(self.residual(z)) + log_normal(z))

    def view(self, z: FloatArray, known: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Return the residual (data,) and the prediction's slopes (data, d) at z (d,).

        Of `known` slopes near z those by the linear parameters are taken over.
        """
        moved = np.arange(self.dimension) if known is None else self.other
        step = np.where(z > 0, -_DIFFERENCE, _DIFFERENCE)
        residual = self.residual(np.vstack([z, z + np.diag(step)[moved]]))
        slopes = np.zeros((len(residual[0]), self.dimension)) if known is None else known.copy()
        found = (residual[0] - residual[1:]).T / step[moved]
        slopes[:, moved] = np.where(np.abs(found) < _STEEPEST, found, 0.0)
        return residual[0], slopes

    def climb(self, z: FloatArray, hopeless: float = -np.inf) -> Peak:
        """Return the peak above z (d,); gives up where it cannot reach the log posterior
        `hopeless`.
        """
        log, damping = float(self.log(z[None])[0]), 1e-2
        residual, slopes = self.view(z)
        hessian, gradient = self._curvature(z, residual, slopes)
        for taken in range(_STEPS):
            step = np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
            step = step / max(1.0, np.abs(step).max())
            tried = np.clip(z + step, -self.farthest, self.farthest)
            gain = float(self.log(tried[None])[0]) - log
            if gain > 0:
                far = np.abs(tried - z)[self.linear].max(initial=0.0) > _SETTLED
                z, log, damping = tried, log + gain, damping / 5
                residual, slopes = self.view(z, None if far else slopes)
                hessian, gradient = self._curvature(z, residual, slopes)
            else:
                damping *= 6
            hoped = float(gradient @ np.linalg.solve(hessian, gradient))
            if 0 <= gain < _NO_GAIN or damping > _MOST_DAMPING or hoped < _NO_GAIN:
                break
            if taken > 3 and log + 2 * hoped < hopeless:
                break
        return Peak(z, log, np.asarray(np.linalg.inv(hessian), dtype=np.float64))

    def _curvature(
        self, z: FloatArray, residual: FloatArray, slopes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return Gauss and Newton's Hessian (d, d) and the gradient (d,) of the log posterior."""
        if not np.isfinite(residual).all():
            return np.eye(len(z)), -z
        share = scipy.special.softmax(self.likelihood.by_node(residual[None])[0])
        gram = self.likelihood.gram(np.column_stack([slopes, residual])[None])[0]
        mean = np.tensordot(share, gram, axes=1)
        return mean[:-1, :-1] + np.eye(len(z)), mean[:-1, -1] - z


def find_peaks(target: Target, starts: FloatArray, hopeless: float = -np.inf) -> list[Peak]:
    """Return the distinct peaks above `starts` z (m, d), the highest first.

    `hopeless` is the log posterior from which on a peak counts.
    """
    found: list[Peak] = []
    for z in starts:
        peak = target.climb(z, hopeless)
        if np.isfinite(peak.log) and not any(_same(peak, each) for each in found):
            found.append(peak)
    return sorted(found, key=lambda peak: -peak.log)


def _same(one: Peak, other: Peak) -> bool:
    away = np.abs(one.z - other.z) / np.sqrt(np.diag(other.covariance))
    return bool((away < _SAME).all())


@dataclass(frozen=True, eq=False)
class _Draws(Rows):
    """Points z (n, d), their linear parameters at their best, by the likeliest error `node` (n,).

    `residual` (n, data) is that with the linear parameters as they go along with the others.
    """

    z: FloatArray
    node: IntArray
    residual: FloatArray


class _Collapsed:
    """A target with its linear parameters integrated out, near one peak."""

    def __init__(self, target: Target, peak: Peak):
        self.target, self.dimension = target, len(target.other)
        self.residual, self.slopes = target.view(peak.z)
        self.linear = Linear(target.likelihood, self.slopes[:, target.linear])
        own = np.ix_(target.other, target.other)
        across = peak.covariance[np.ix_(target.linear, target.other)]
        self._follow = np.linalg.solve(peak.covariance[own], across.T).T
        self._peak = peak.z

    def along(self, w: FloatArray) -> FloatArray:
        """Return points (n, d) with others w (n, o) and the linear parameters as at the peak."""
        target = self.target
        z = np.tile(self._peak, (len(w), 1))
        z[:, target.other] = w
        moved = z[:, target.linear] + (w - self._peak[target.other]) @ self._follow.T
        z[:, target.linear] = moved.clip(-_FARTHEST_LINEAR, _FARTHEST_LINEAR)
        return z

    def settle(self, w: FloatArray) -> tuple[_Draws, FloatArray]:
        """Return points with other parameters w (n, o), and the log of their target density (n,).

        Where the linear parameters go far, the model is solved again there.
        """
        columns, z = self.target.linear, self.along(w)
        start = z[:, columns].copy()
        residual = self.target.residual(z)
        log, step, node = self.linear.marginal(residual, start)
        moved = start + step
        far = np.flatnonzero((np.abs(step) > _SETTLED).any(axis=1))
        for _ in range(_MOST_SETTLED):
            if not len(far):
                break
            there = z[far].copy()
            there[:, columns] = moved[far]
            # As if the slopes held from the start on, so that all points are alike.
            back = (moved[far] - start[far]) @ self.slopes[:, columns].T
            residual[far] = self.target.residual(there) + back
            log[far], step, node[far] = self.linear.marginal(residual[far], start[far])
            change = np.abs(start[far] + step - moved[far])
            moved[far] = start[far] + step
            far = far[(change > _SETTLED).any(axis=1)]
        z[:, columns] = moved
        return _Draws(z, node, residual), np.asarray(log + log_normal(w))

    def log_target(self, w: FloatArray, residual: FloatArray) -> FloatArray:
        """Return the log of the target density (n,) by residuals that are known already."""
        z = self.along(w)
        return self.linear.marginal(residual, z[:, self.target.linear])[0] + log_normal(w)

    def scatter(self, draws: _Draws, rng: np.random.Generator) -> FloatArray:
        """Return the points (n, d) with their linear parameters drawn about their best."""
        z = draws.z.copy()
        factor = np.linalg.cholesky(self.linear.covariance)[draws.node]
        normal = rng.standard_normal((len(z), len(self.target.linear), 1))
        z[:, self.target.linear] += (factor @ normal)[..., 0]
        return z

    # ------------------------------------------------ what emcee asks for

    def evaluate(self, w: FloatArray) -> FloatArray:
        return w

    def log_posterior(self, w: FloatArray) -> FloatArray:
        found = self.settle(w)[1]
        return np.where(np.isfinite(found), found, -np.inf)


class _Proposal(Protocol):
    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Return draws (n, o)."""

    def log_density(self, w: FloatArray) -> FloatArray:
        """Return the log density (n,) at w (n, o)."""


class _Wide:
    """A mixture of t distributions with a share of the prior."""

    def __init__(self, mixture: TMixture, of_prior: float):
        self.mixture, self.of_prior = mixture, of_prior

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        w = self.mixture.draw(n, rng)
        prior: BoolArray = rng.random(n) < self.of_prior
        w[prior] = rng.standard_normal((int(prior.sum()), w.shape[1]))
        return w

    def log_density(self, w: FloatArray) -> FloatArray:
        own = np.log1p(-self.of_prior) + self.mixture.log_density(w)
        return np.asarray(np.logaddexp(own, np.log(self.of_prior) + log_normal(w)))


class _Surrogate:
    """The posterior by a quadratic fit of the residuals at points already solved.

    Draws of a `wide` proposal are weighed by it and drawn again: so it costs no solution of the
    model. What the fit is off by, weights of exact solutions correct.
    """

    def __init__(self, collapsed: _Collapsed, known: _Draws, weights: FloatArray, wide: _Wide):
        self._collapsed, self._wide = collapsed, wide
        other = collapsed.target.other
        w, weights = known.z[:, other], weights + _LEAST_WEIGHT / len(weights)
        self._centre = np.average(w, axis=0, weights=weights)
        self._scale = np.sqrt(np.average((w - self._centre) ** 2, axis=0, weights=weights)) + 1e-6
        usable = np.isfinite(known.residual).all(axis=1)
        root = np.sqrt(weights[usable])[:, None]
        columns = root * self._features(w[usable])
        gram = columns.T @ columns
        ridge = _RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
        self._fit = np.linalg.solve(gram + ridge, columns.T @ (root * known.residual[usable]))
        self._log_total = 0.0

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        w = self._wide.draw(_CANDIDATES, rng)
        log = self._log(w) - self._wide.log_density(w)
        self._log_total = float(scipy.special.logsumexp(log) - np.log(len(w)))
        return np.asarray(w[systematic(normalised(log), n, rng)])

    def log_density(self, w: FloatArray) -> FloatArray:
        return np.asarray(self._log(w) - self._log_total)

    def _log(self, w: FloatArray) -> FloatArray:
        return self._collapsed.log_target(w, self._features(w) @ self._fit)

    def _features(self, w: FloatArray) -> FloatArray:
        """Return one, the places and their products (n, features)."""
        u = (w - self._centre) / self._scale
        one, other = np.triu_indices(u.shape[1])
        return np.hstack([np.ones((len(u), 1)), u, u[:, one] * u[:, other]])


class Sampling:
    """Importance sampling of a hypothesis about `peaks`, the best first, that can be gone on with.

    It is looked for also where a fit `without` its last effects has its draws.
    """

    def __init__(
        self,
        target: Target,
        peaks: Sequence[Peak],
        rng: np.random.Generator,
        without: Fit | None = None,
    ):
        self.target, self.peaks, self.rng = target, tuple(peaks), rng
        self._collapsed = _Collapsed(target, peaks[0])
        self._pool: Pool[_Proposal, _Draws] = Pool(
            lambda proposal, batch: proposal.log_density(batch.z[:, target.other])
        )
        self._rounds = 0
        if len(target.other):
            self._first = _parts(target, peaks, without, rng)
            self._proposal: _Proposal = _Wide(self._first, _AT_FIRST)

    @property
    def effective(self) -> float:
        """Return Kish's effective number of draws."""
        if not len(self.target.other):
            return np.inf
        return self._pool.effective if self._rounds else 0.0

    @property
    def log_evidence(self) -> float:
        """Return the log evidence."""
        if len(self.target.other):
            return self._pool.log_evidence
        return float(self._collapsed.settle(np.empty((1, 0)))[1][0])

    def run(self, enough: float, most_rounds: int) -> None:
        """Draw until `enough` draws are effective, for so many rounds in all at most."""
        while self.effective < enough and self._rounds < most_rounds:
            self._draw()

    def _draw(self) -> None:
        other = self.target.other
        batch, log = self._collapsed.settle(self._proposal.draw(_ROUND, self.rng))
        self._pool.add(self._proposal, _ROUND, batch, log)
        self._rounds += 1
        weights = tempered(self._pool.log_weights, 6 * len(other), 0.7, 1e-3)
        known = self._pool.batch.z[:, other]
        likely = known[systematic(weights, _POPULATION, self.rng)]
        clusters = self._first
        if len(np.unique(likely, axis=0)) > _DRAWS_A_PART * _PARTS:
            clusters = TMixture.of(likely, _PARTS, self.rng)
        refitted = clusters.refitted(known, weights)
        self._proposal = wide = _Wide(refitted.mixed(self._first, _FROM_FIRST), _FROM_PRIOR)
        if self._rounds % _WIDE_EVERY > 1:
            self._proposal = _Surrogate(self._collapsed, self._pool.batch, weights, wide)

    def fit(self, draws: int) -> Fit:
        """Return the fit with so many equal draws."""
        if not len(self.target.other):
            point, _ = self._collapsed.settle(np.empty((1, 0)))
            chosen = point.take(np.zeros(draws, dtype=np.int64))
        else:
            rows = systematic(normalised(self._pool.log_weights), draws, self.rng)
            chosen = self._pool.batch.take(rows)
        found = self.rng.permutation(self._collapsed.scatter(chosen, self.rng))
        return _fit(self._collapsed, self.peaks, found, self.log_evidence, self.effective)

    def fit_by_chain(self, draws: int) -> Fit:
        """Return the same by emcee, from where importance sampling has come."""
        known = self.fit(draws)
        chain, count, _ = run_chain(self._collapsed, known.draws[:, self.target.other], self.rng)
        chosen = self._collapsed.settle(chain[self.rng.choice(len(chain), draws)])[0]
        found = self._collapsed.scatter(chosen, self.rng)
        return _fit(self._collapsed, self.peaks, found, known.log_evidence, count, "emcee")


def sample(
    target: Target,
    peaks: Sequence[Peak],
    draws: int,
    rng: np.random.Generator,
    enough: float = ENOUGH_EFFECTIVE,
) -> Fit:
    """Return the fit of a hypothesis about `peaks`, the best first, with `enough` effective draws.

    Where importance sampling does not come to that, emcee goes on.
    """
    sampling = Sampling(target, peaks, rng)
    sampling.run(enough, MOST_ROUNDS)
    return sampling.fit(draws) if sampling.effective >= enough else sampling.fit_by_chain(draws)


def laplace(peaks: Sequence[Peak]) -> float:
    """Return the log evidence by normal distributions on the peaks."""
    return float(scipy.special.logsumexp([peak.log_evidence for peak in peaks]))


def approximate(
    target: Target, peaks: Sequence[Peak], draws: int, rng: np.random.Generator, beyond: float
) -> Fit:
    """Return the fit of a hypothesis by normal distributions on its peaks (Laplace's method).

    `beyond` is added to the log evidence: the difference to sampling of a like posterior.
    """
    log = np.array([peak.log_evidence for peak in peaks])
    counts = rng.multinomial(draws, normalised(log))
    found = np.vstack(
        [rng.multivariate_normal(p.z, p.covariance, n) for p, n in zip(peaks, counts, strict=True)]
    )
    log_evidence = laplace(peaks) + beyond
    nan = float("nan")
    return _fit(_Collapsed(target, peaks[0]), peaks, found, log_evidence, nan, "normal")


def _parts(
    target: Target, peaks: Sequence[Peak], without: Fit | None, rng: np.random.Generator
) -> TMixture:
    """Return t distributions on the peaks, and where the posterior is without the last effects.

    Of an effect that these data hardly show all small sizes are as likely.
    """
    other = target.other
    near = [each for each in peaks if each.log > peaks[0].log - _FAR_BELOW]
    parts = [
        Normal(each.z[other], width**2 * each.covariance[np.ix_(other, other)])
        for each in near
        for width in _WIDTHS
    ]
    shares = scipy.special.softmax([each.log_evidence for each in near for _ in _WIDTHS])
    first = TMixture(parts, np.maximum(shares, 0.02))
    if without is None:
        return first
    known = without.draws[:, other[other < without.draws.shape[1]]]
    free = len(other) - known.shape[1]
    if not known.shape[1] or len(np.unique(known, axis=0)) < _DRAWS_A_PART * _CLUSTERS:
        return first
    wide = TMixture.of(known, _CLUSTERS, rng)
    extended = [
        Normal(
            np.append(part.mean, np.zeros(free)),
            scipy.linalg.block_diag(part.covariance, np.eye(free)),
        )
        for part in wide.parts
    ]
    return first.mixed(TMixture(extended, wide.shares), _FROM_WITHOUT)


def _fit(
    collapsed: _Collapsed,
    peaks: Sequence[Peak],
    draws: FloatArray,
    log_evidence: float,
    count: float,
    method: Method = "sampled",
) -> Fit:
    target, best, residual = collapsed.target, peaks[0], collapsed.residual
    error = target.likelihood.nodes[int(target.likelihood.by_node(residual[None])[0].argmax())]
    return Fit(
        hypothesis=target.hypothesis,
        z=best.z,
        covariance=best.covariance,
        predicted=target.problem.value - residual,
        slopes=collapsed.slopes,
        noise=error.covariance,
        model_error=error.model_error,
        draws=draws,
        log_fit=float(target.likelihood.log(residual[None])[0]),
        log_evidence=log_evidence,
        log_evidence_sd=count**-0.5 if count > 0 else np.nan,
        method=method,
        peaks=tuple(peaks),
        effective=min(count, float(len(draws))),
    )
