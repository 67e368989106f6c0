"""The posterior of a fit by importance sampling, where a normal distribution is too plain.

Only what is not nearly linear is drawn, end springs in straightened coordinates, from t
distributions put on the fit's peaks and refitted to their own weighted draws (Cappe et al. 2008,
population Monte Carlo), with a share of the prior so that no weight is unbounded (Hesterberg 1995).
Tension and the bar's deviations are integrated out at each draw. The answer rests on fresh draws,
since a proposal lies high on the very draws it was refitted to. Where too few draws are effective
it goes on, and a fit says how many are.

The linear parameters of a hypothesis integrated out at given values of the others.

Tension and the bar's deviations move the logarithms of frequencies nearly in proportion, so that
at given other parameters their posterior is normal, whatever shape the others' posterior has
(Rue, Martino and Chopin 2009 integrate nested normal approximations in this way).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy

from shm.gap.contract import Fit
from shm.gap.coordinates import Branch, Straight
from shm.gap.detectability import LONGEST_STEP
from shm.gap.fit import fitted
from shm.gap.optimiser import NEVER, Landscape
from shm.gap.problem import GapProblem
from shm.gap.proposal_distribution import Points, Proposal
from shm.inference.coordinates import log_normal
from shm.inference.mixture import Pool, Rows, normalised, systematic
from shm.values import ENOUGH_EFFECTIVE, FloatArray, IntArray

# Technical, effective draws against time: a first look and refits of a few hundred points, ten to
# twenty rounds at the most. Where they do not suffice, the answer says how many were effective.
_FIRST, _TRIAL, _FINAL = 450, 150, 300
_MOST, _FEW = 6000, 3600
_HOPEFUL = 0.1
"""Effective share of the fresh draws from which on more of them are worth while."""

_INSTEAD = 2.0
"""Times as many effective draws, where they are not all fresh: the evidence is then 0.2 too low."""

_TO_FIT = 50.0
"""Effective draws, per parameter drawn, to which a proposal is fitted well enough to rest on."""

# Judgement: the scatter of weights misses what was never drawn, so an evidence's error is told a
# quarter larger; and seven times as probable a draw shows that the fit missed its peak.
_UNSEEN, _MUCH_BETTER = 1.25, 2.0


@dataclass(frozen=True, eq=False)
class _Draws(Rows):
    """Draws with their linear parameters settled."""

    points: Points
    settled: Settled


_Pool: TypeAlias = Pool[Proposal, _Draws]


def sampled(
    problem: GapProblem, fit: Fit, rng: np.random.Generator, draws: int, thorough: bool = True
) -> Fit:
    """The same fit with `draws` equal draws and an evidence with its standard error, by sampling.

    A `thorough` sampler goes on where too few of its draws are effective.
    Where a draw is much more probable than the fit's `z`, the fit is made anew from there.
    """
    sampler = _Sampler(problem, fit)
    final = sampler.run(rng, _MOST if thorough else _FEW)
    points, settled = final.batch.points, final.batch.settled
    best = int((settled.log_marginal + log_normal(points.w)).argmax())
    if settled.log_marginal[best] > sampler.log_marginal_of_fit + _MUCH_BETTER:
        fit = fitted(problem, fit.hypothesis, rng, np.stack([settled.z[best], fit.z]))
    rows = systematic(normalised(final.log_weights), draws, rng)
    share = 1 / final.effective - 1 / final.draws
    return replace(
        fit,
        draws=rng.permutation(sampler.scattered(settled.take(rows), rng)),
        log_evidence=final.log_evidence,
        log_evidence_sd=float(_UNSEEN * np.sqrt(max(share, 0.0))),
        method="sampled",
        effective=final.effective,
    )


class _Sampler:
    """Draws of what is not linear, on all choices of signs."""

    def __init__(self, problem: GapProblem, fit: Fit):
        self._landscape = Landscape(problem, fit.hypothesis)
        coordinates = self._landscape.coordinates
        self._linear, self._other = coordinates.linear, coordinates.other
        self._branches: Sequence[Branch] = [
            branch.part(self._other) for branch in coordinates.branches
        ]
        self._straight = problem.straight(coordinates)
        self._conditional = Conditional(self._landscape, fit, self._straight)
        self._fit = fit

    @property
    def log_marginal_of_fit(self) -> float:
        """The log likelihood at the fit's other parameters, the linear ones integrated out."""
        return float(self._conditional.settled(self._fit.z[None, self._other]).log_marginal[0])

    def run(self, rng: np.random.Generator, most: int) -> _Pool:
        """Draws of which `ENOUGH_EFFECTIVE` are effective, or as many as `most` draws have.

        The proposal is refitted to all draws so far. The answer rests on fresh draws; where too few
        of these are effective they join the others, and the proposal is refitted again, unless so
        many are effective together that it does not matter what they were fitted to.
        """
        proposal = Proposal.about(self._fit.peaks, self._branches, self._other, self._straight)
        pool, final = _empty(), _empty()
        to_fit = _TO_FIT * max(len(self._other), 1)
        while pool.draws + final.draws < most:
            if pool.draws and pool.effective >= to_fit:
                self._draw(final, proposal, _FINAL, rng)
                if final.effective >= ENOUGH_EFFECTIVE:
                    return final
                if final.effective >= _HOPEFUL * final.draws:
                    continue
                pool.absorb(final)
                final = _empty()
                if pool.effective >= _INSTEAD * ENOUGH_EFFECTIVE:
                    break
            else:
                self._draw(pool, proposal, _TRIAL if pool.draws else _FIRST, rng)
            proposal = proposal.refitted(pool.batch.points, pool.log_weights, rng)
        if final.draws:
            pool.absorb(final)
        return pool

    def scattered(self, settled: Settled, rng: np.random.Generator) -> FloatArray:
        """Draws z (n, d) with the linear parameters drawn from their own posterior."""
        z = settled.z.copy()
        factor = np.linalg.cholesky(settled.covariance)
        noise = rng.standard_normal((len(z), len(self._linear), 1))
        z[:, self._linear] += (factor @ noise)[..., 0]
        return z

    def _draw(self, pool: _Pool, proposal: Proposal, count: int, rng: np.random.Generator) -> None:
        points = proposal.draw(count, rng)
        z = np.empty_like(points.w)
        for k, branch in enumerate(self._branches):
            z[points.branch == k] = branch.z(points.w[points.branch == k])
        settled = self._conditional.settled(z)
        log_prior = log_normal(points.w) + self._branches[0].log_prior
        pool.add(proposal, count, _Draws(points, settled), settled.log_marginal + log_prior)


def _empty() -> _Pool:
    return Pool(lambda proposal, draws: proposal.log_density(draws.points))


# Technical: what is nearly linear settles in a few steps, the last of them, of a gain below 0.2 in
# log likelihood, without another look.
_STEPS, _SETTLED_GAIN = 3, 0.2


@dataclass(frozen=True, eq=False)
class Settled(Rows):
    """Points z (n, d) with their linear parameters at the best that the others allow.

    `log_marginal` (n,) is the log likelihood with the linear ones integrated out over their
    priors, `covariance` (n, l, l) their posterior's.
    """

    z: FloatArray
    log_marginal: FloatArray
    covariance: FloatArray


class Conditional:
    """Settles the linear parameters with the slopes that they have at a fit."""

    def __init__(self, landscape: Landscape, fit: Fit, straight: Straight):
        self._landscape = landscape
        self._linear = landscape.coordinates.linear
        self._fit = fit
        slopes = fit.slopes[:, self._linear]
        self._weighed = landscape.likelihood.weighed(slopes)
        inner = self._weighed.products(slopes.T) + np.eye(len(self._linear))
        rest = landscape.coordinates.other
        self._straight, self._middle = straight, straight.y(fit.z[None, rest])[0]
        bent = straight.slopes(fit.z[rest])
        own = bent @ fit.covariance[np.ix_(rest, rest)] @ bent.T
        shared = bent @ fit.covariance[np.ix_(rest, self._linear)]
        self._pull = np.linalg.solve(own, shared)
        self._covariance: FloatArray = np.linalg.inv(inner).astype(np.float64)
        self._height = landscape.likelihood.log_height - np.linalg.slogdet(inner)[1] / 2

    def settled(self, other: FloatArray) -> Settled:
        """Of the other parameters (n, d - l), in order."""
        z = self._started(other)
        now = self._view(z)
        for _ in range(_STEPS):
            moving = np.flatnonzero(now.gain > _SETTLED_GAIN)
            if not len(moving):
                break
            tried = z[moving]
            tried[:, self._linear] += now.step[moving]
            there = self._view(tried)
            better = there.log_here > now.log_here[moving]
            z[moving[better]] = tried[better]
            chosen = np.arange(len(z))
            chosen[moving[better]] = len(z) + np.flatnonzero(better)
            now = now.joined(there).take(chosen)
            now.gain[moving[~better]] = 0.0
        z[:, self._linear] += now.step
        return Settled(z, now.log_marginal, self._covariance[now.node])

    def _started(self, other: FloatArray) -> FloatArray:
        """Points with the linear parameters where the fit's normal distribution has them."""
        rest = self._landscape.coordinates.other
        z = np.empty((len(other), len(self._fit.z)))
        z[:, rest] = other
        away = (self._straight.y(other) - self._middle) @ self._pull
        z[:, self._linear] = self._fit.z[self._linear] + away.clip(-LONGEST_STEP, LONGEST_STEP)
        return z

    def _view(self, z: FloatArray) -> _View:
        residual = self._landscape.residual(z)
        squares = self._landscape.likelihood.by_node(residual).T
        finite = np.asarray(np.isfinite(squares).all(axis=0))
        linear = z[:, self._linear]
        pull = self._weighed.products(np.where(finite[:, None], residual, 0.0)) - linear
        step = pull @ self._covariance
        gain = (pull * step).sum(axis=2) / 2
        volume = self._height - self._landscape.likelihood.log_height
        log = squares + volume[:, None] - (linear**2).sum(axis=1) / 2 + gain
        log = np.where(finite, log, NEVER)
        node, rows = log.argmax(axis=0), np.arange(len(z))
        chosen = step[node, rows].clip(-LONGEST_STEP, LONGEST_STEP)
        return _View(
            np.asarray(scipy.special.logsumexp(log, axis=0)),
            np.where(finite, gain[node, rows], 0.0),
            chosen,
            node,
        )


@dataclass(frozen=True, eq=False)
class _View(Rows):
    """Seen from points: the log marginal, the gain of a full step, the step, the likeliest node."""

    log_marginal: FloatArray
    gain: FloatArray
    step: FloatArray
    node: IntArray

    @property
    def log_here(self) -> FloatArray:
        """Log posterior of the linear parameters where they are, but for a constant."""
        return self.log_marginal - self.gain
