"""Draws and evidence of one hypothesis by importance sampling about its peaks.

Parameters in which the data are nearly linear are integrated out in closed form at each draw, so
that only the others are sampled: from t distributions fitted to what is known of the posterior,
with a share of the prior so that no weight is unbounded (Hesterberg 1995; Cappe et al. 2008). All
draws count, each against the mixture of all proposals (Cornuet et al. 2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.hypotheses.contract import Fit, Method
from shm.gap.hypotheses.target import SETTLED, Target
from shm.inference.sampler.chain import run_chain
from shm.inference.sampler.coordinates import log_normal
from shm.inference.sampler.density import Peak, laplace
from shm.inference.sampler.linear import Linear
from shm.inference.sampler.mixture import (
    Drawn,
    Normal,
    Pool,
    TMixture,
    normalised,
    systematic,
    tempered,
)
from shm.values import ENOUGH_EFFECTIVE, BoolArray, FloatArray, IntArray

# Numerical, in standard deviations of a prior: no linear parameter goes farther.
_FARTHEST_LINEAR = 12.0

MOST_ROUNDS = 60
"""Rounds of draws after which importance sampling gives up."""


@dataclass(frozen=True)
class SamplingOptions:
    """Hold the numbers of the sampler, all of them numerical: weights correct for each.

    A `round` of draws comes from a mixture of at most `parts` t distributions, fitted to a
    `population` drawn again, `draws_a_part` at least; with shares of the `prior` (more of it
    `prior_at_first`) and of the `first` mixture, which has peaks at several `widths`, those within
    `far_below` of the best log density (peaks `lobes_apart` standard deviations away are other
    lobes), and `without` of it where the posterior without the last effects is, by
    `clusters_without` parts. Linear parameters are followed `most_settled` times at most.
    """

    round: int = 150
    parts: int = 8
    population: int = 600
    draws_a_part: int = 4
    prior_at_first: float = 0.3
    prior: float = 0.1
    first: float = 0.2
    widths: tuple[float, ...] = (1.0, 2.0)
    far_below: float = 10.0
    lobes_apart: float = 8.0
    without: float = 0.4
    clusters_without: int = 3
    most_settled: int = 4


_HOW = SamplingOptions()


@dataclass(frozen=True, eq=False)
class _Draws(Drawn):
    """Points z (n, d) with linear parameters at their best, by the likeliest error `node` (n,)."""

    node: IntArray


class _Collapsed:
    """A target with its linear parameters integrated out, near peaks, the best first.

    Peaks far below the best one do not count: they have no share of the posterior.
    """

    def __init__(self, target: Target, peaks: Sequence[Peak]):
        peaks = _choose_near_best(peaks)
        self.target, self.dimension = target, len(target.other)
        self.residual, self.slopes = (each[0] for each in target.look(peaks[0].z[None]))
        self.linear = Linear(target.likelihood, self.slopes[:, target.linear])
        self._peaks = np.array([peak.z for peak in peaks])
        self._normals = [_normal_of(peak, target.other) for peak in peaks]
        # How the linear parameters follow the others, at each peak.
        self._follow = np.array(
            [
                np.linalg.solve(
                    peak.covariance[np.ix_(target.other, target.other)],
                    peak.covariance[np.ix_(target.other, target.linear)],
                )
                for peak in peaks
            ]
        )

    def along(self, w: FloatArray) -> FloatArray:
        """Return points (n, d) with others w (n, o), linear parameters as at the nearest peak."""
        target = self.target
        near = _find_nearest(self._normals, w)
        z: FloatArray = self._peaks[near]
        away = (w - z[:, target.other])[:, None]
        moved = z[:, target.linear] + (away @ self._follow[near])[:, 0]
        z[:, target.other] = w
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
        far = np.flatnonzero((np.abs(step) > SETTLED).any(axis=1))
        for _ in range(_HOW.most_settled):
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
            far = far[(change > SETTLED).any(axis=1)]
        z[:, columns] = moved
        return _Draws(z, node), np.asarray(log + log_normal(w))

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


class _Proposal:
    """A mixture of t distributions with a share of the prior."""

    def __init__(self, mixture: TMixture, of_prior: float):
        self.mixture, self.of_prior = mixture, of_prior

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Return draws (n, o)."""
        w = self.mixture.draw(n, rng)
        prior: BoolArray = rng.random(n) < self.of_prior
        w[prior] = rng.standard_normal((int(prior.sum()), w.shape[1]))
        return w

    def log_density(self, w: FloatArray) -> FloatArray:
        log_mixture = np.log1p(-self.of_prior) + self.mixture.log_density(w)
        return np.asarray(np.logaddexp(log_mixture, np.log(self.of_prior) + log_normal(w)))


class Lobes:
    """Hold the parts of a posterior that lie apart, each with its peak, the best first.

    A place and its mirror image are two. They are alike but for size and shape, so that draws of
    the best one, and its share, tell those of the others by normal distributions on the peaks.
    """

    def __init__(self, target: Target, peaks: Sequence[Peak]):
        self.peaks: list[Peak] = []
        self._normals: list[Normal] = []
        for peak in _choose_near_best(peaks):
            normal = _normal_of(peak, target.other)
            if all(_measure_distance(normal, each) > _HOW.lobes_apart for each in self._normals):
                self.peaks.append(peak)
                self._normals.append(normal)
        self._log = np.array([peak.log_evidence for peak in self.peaks])

    @property
    def log_beyond(self) -> float:
        """Return the log of the whole evidence over that of the best lobe."""
        return float(scipy.special.logsumexp(self._log - self._log[0]))

    def nearest(self, w: FloatArray) -> IntArray:
        """Return the lobe (n,) that others w (n, o) are nearest to, from 0."""
        return _find_nearest(self._normals, w)

    def spread(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return draws z (n, d) of the best lobe with their share of them moved to each other."""
        moved, of = z.copy(), rng.choice(len(self.peaks), len(z), p=normalised(self._log))
        best = self.peaks[0]
        for index, peak in enumerate(self.peaks[1:], start=1):
            here, there = (np.linalg.cholesky(each.covariance) for each in (best, peak))
            white = np.linalg.solve(here, (z[of == index] - best.z).T)
            moved[of == index] = peak.z + (there @ white).T
        return moved


def _normal_of(peak: Peak, columns: IntArray) -> Normal:
    """Return the normal distribution on a peak, of some of its columns."""
    return Normal(peak.z[columns], peak.covariance[np.ix_(columns, columns)])


def _find_nearest(normals: Sequence[Normal], w: FloatArray) -> IntArray:
    """Return the index (n,) of the centre nearest to w (n, o), in standard deviations of each."""
    square = [(normal.whiten(w) ** 2).sum(axis=1) for normal in normals]
    return np.asarray(np.argmin(square, axis=0))


def _measure_distance(one: Normal, other: Normal) -> float:
    """Return the distance of two centres in standard deviations, the shorter of both views."""
    return min(
        float(np.linalg.norm(one.whiten(other.mean))), float(np.linalg.norm(other.whiten(one.mean)))
    )


class Sampling:
    """Importance sampling of a hypothesis about `peaks`, the best first, that can be gone on with.

    It is looked for also where a fit `without` its last effects has its draws. Of lobes that lie
    apart the best one is sampled.
    """

    def __init__(
        self,
        target: Target,
        peaks: Sequence[Peak],
        rng: np.random.Generator,
        without: Fit | None = None,
    ):
        self.target, self.peaks, self.rng = target, tuple(peaks), rng
        self._lobes = Lobes(target, peaks)
        about = self._lobes.nearest(np.array([peak.z[target.other] for peak in peaks])) == 0
        near = [peak for peak, is_near in zip(peaks, about, strict=True) if is_near]
        self._collapsed = _Collapsed(target, near)
        self._pool: Pool[_Proposal, _Draws] = Pool(
            lambda proposal, batch: proposal.log_density(batch.z[:, target.other])
        )
        self._rounds = 0
        if len(target.other):
            self._first = _parts(target, near, without, rng)
            self._proposal = _Proposal(self._first, _HOW.prior_at_first)

    @property
    def effective(self) -> float:
        """Return Kish's effective number of draws."""
        if not len(self.target.other):
            return np.inf
        return self._pool.weighted.effective_sample_size if self._rounds else 0.0

    @property
    def log_evidence(self) -> tuple[float, float]:
        """Return the log evidence and its standard error."""
        if len(self.target.other):
            found = self._pool.weighted
            return found.log_evidence + self._lobes.log_beyond, found.log_evidence_sd
        return float(self._collapsed.settle(np.empty((1, 0)))[1][0]), 0.0

    def run(self, enough: float, most_rounds: int) -> None:
        """Draw until `enough` draws are effective, for so many rounds in all at most."""
        while self.effective < enough and self._rounds < most_rounds:
            self._draw()

    def _draw(self) -> None:
        other = self.target.other
        w = self._proposal.draw(_HOW.round, self.rng)
        batch, log = self._collapsed.settle(w)
        log = np.where(self._lobes.nearest(w) == 0, log, -np.inf)
        self._pool.add(self._proposal, batch, log)
        self._rounds += 1
        weights = tempered(self._pool.log_weights, 6 * len(other), 0.7, 1e-3)
        known = self._pool.batch.z[:, other]
        likely = known[systematic(weights, _HOW.population, self.rng)]
        clusters = self._first
        if len(np.unique(likely, axis=0)) > _HOW.draws_a_part * _HOW.parts:
            clusters = TMixture.of(likely, _HOW.parts, self.rng)
        refitted = clusters.refitted(known, weights)
        self._proposal = _Proposal(refitted.mixed(self._first, _HOW.first), _HOW.prior)

    def fit(self, draws: int) -> Fit:
        """Return the fit with so many equal draws."""
        if not len(self.target.other):
            point, _ = self._collapsed.settle(np.empty((1, 0)))
            chosen = point.take(np.zeros(draws, dtype=np.int64))
        else:
            chosen = self._pool.weighted.resampled(draws, self.rng)
        found = self.rng.permutation(self._collapsed.scatter(chosen, self.rng))
        if len(self._lobes.peaks) > 1:
            found = self._lobes.spread(found, self.rng)
        return _fit(self._collapsed, self.peaks, found, self.log_evidence, self.effective)

    def fit_by_chain(self, draws: int) -> Fit:
        """Return the same by emcee, from where importance sampling has come."""
        known = self.fit(draws)
        chain, count, _ = run_chain(self._collapsed, known.draws[:, self.target.other], self.rng)
        chosen = self._collapsed.settle(chain[self.rng.choice(len(chain), draws)])[0]
        found = self._collapsed.scatter(chosen, self.rng)
        return _fit(
            self._collapsed,
            self.peaks,
            found,
            (known.log_evidence, known.log_evidence_sd),
            count,
            "emcee",
        )


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


def approximate(target: Target, peaks: Sequence[Peak], draws: int, rng: np.random.Generator) -> Fit:
    """Return the fit of a hypothesis by normal distributions on its peaks (Laplace's method)."""
    log = np.array([peak.log_evidence for peak in peaks])
    counts = rng.multinomial(draws, normalised(log))
    found = np.vstack(
        [
            rng.multivariate_normal(p.z, p.covariance, n, check_valid="ignore")  # rounding
            for p, n in zip(peaks, counts, strict=True)
        ]
    )
    nan = float("nan")
    return _fit(_Collapsed(target, peaks), peaks, found, (laplace(peaks), nan), nan, "normal")


def _choose_near_best(peaks: Sequence[Peak]) -> list[Peak]:
    """Return the peaks that have a share of the posterior."""
    return [each for each in peaks if each.log > peaks[0].log - _HOW.far_below]


def _parts(
    target: Target, peaks: Sequence[Peak], without: Fit | None, rng: np.random.Generator
) -> TMixture:
    """Return t distributions on the peaks, and where the posterior is without the last effects.

    Of an effect that these data hardly show all small sizes are as likely.
    """
    other = target.other
    near = _choose_near_best(peaks)
    parts = [
        Normal(each.z[other], width**2 * each.covariance[np.ix_(other, other)])
        for each in near
        for width in _HOW.widths
    ]
    shares = scipy.special.softmax([each.log_evidence for each in near for _ in _HOW.widths])
    first = TMixture(parts, np.maximum(shares, 0.02))
    if without is None:
        return first
    known = without.draws[:, other[other < without.draws.shape[1]]]
    free = len(other) - known.shape[1]
    if (
        not known.shape[1]
        or len(np.unique(known, axis=0)) < _HOW.draws_a_part * _HOW.clusters_without
    ):
        return first
    wide = TMixture.of(known, _HOW.clusters_without, rng)
    extended = [
        Normal(
            np.append(part.mean, np.zeros(free)),
            scipy.linalg.block_diag(part.covariance, np.eye(free)),
        )
        for part in wide.parts
    ]
    return first.mixed(TMixture(extended, wide.shares), _HOW.without)


def _fit(
    collapsed: _Collapsed,
    peaks: Sequence[Peak],
    draws: FloatArray,
    log_evidence: tuple[float, float],
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
        log_evidence=log_evidence[0],
        log_evidence_sd=log_evidence[1],
        method=method,
        peaks=tuple(peaks),
        effective=min(count, float(len(draws))),
    )
