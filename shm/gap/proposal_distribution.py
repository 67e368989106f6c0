"""Proposals on all choices of signs: t distributions on each, with a share of the prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.contract import Peak
from shm.gap.coordinates import Branch, Straight
from shm.inference.coordinates import log_normal
from shm.inference.mixture import (
    Normal,
    Rows,
    TMixture,
    effective,
    normalised,
    systematic,
    tempered,
)
from shm.values import FloatArray, IntArray

# Technical, all of them: importance weights correct whatever is drawn from, so they cost effective
# draws and time, and which draws come, but no bias. Defensive shares (Hesterberg 1995): in vain are
# one draw in twenty from the prior, one in ten from the fit's peaks, and a fiftieth on a sign.
_FROM_PRIOR, _FROM_FIRST, _LEAST_SHARE = 0.05, 0.1, 0.02
# A part is drawn wider than its points, as too narrow a proposal has unbounded weights.
_INFLATION = 1.3
# Points a parameter from which a covariance, and from fewer of unequal weight a cluster, is known.
_FEWEST_TO_FIT, _TO_CLUSTER = 12, 6
# One point with a tenth of the weight is a peak that no part covers.
_HEAVY = 0.1
# More clusters than a posterior of this kind has peaks; time grows with clusters x population.
_CLUSTERS, _POPULATION, _JITTER, _FROM_WHOLE = 6, 400, 0.2, 0.2
_FROM_NARROW, _REFITS = 0.5, 3
"""Steps after which a cluster is as narrow as its points: of narrow peaks far apart the spread and
what it borrows from the whole are much wider. The wide ones stay, for what is not found yet."""


@dataclass(frozen=True, eq=False)
class Points(Rows):
    """Points w (n, p), each on the branch of index `branch` (n,), straightened to y (n, p).

    `log_volume` (n,) is the log of |dy/dw|.
    """

    branch: IntArray
    w: FloatArray
    y: FloatArray
    log_volume: FloatArray


class Proposal:
    """A mixture of branches: `shares` (branches,), the t distributions of each or None.

    These are of straightened points. A part is drawn from the `first` ones, those of a fit's peaks,
    so that no peak is lost before it is found to matter.
    """

    def __init__(
        self,
        shares: FloatArray,
        mixtures: Sequence[TMixture | None],
        dimension: int,
        straight: Straight,
        first: Sequence[TMixture | None] | None = None,
    ):
        shares = np.maximum(shares, _LEAST_SHARE)
        self._shares: FloatArray = shares / shares.sum()
        self._core, self._first = tuple(mixtures), tuple(mixtures if first is None else first)
        self._mixtures = [
            core if core is None or begun is None else core.mixed(begun, _FROM_FIRST)
            for core, begun in zip(self._core, self._first, strict=True)
        ]
        self._dimension = dimension
        self._straight = straight

    @classmethod
    def about(
        cls,
        peaks: Sequence[Peak],
        branches: Sequence[Branch],
        columns: IntArray,
        straight: Straight,
    ) -> Proposal:
        """About the peaks of a fit, of whose parameters those of `columns` are drawn."""
        mixtures, log_shares = [], []
        for branch in branches:
            own = [each for each in peaks if np.array_equal(each.signs[columns], branch.signs)]
            log = np.array([each.log_evidence for each in own])
            log_shares.append(scipy.special.logsumexp(log) if own else -np.inf)
            parts = [part for each in own for part in _about(each, columns, straight)]
            log = np.repeat(log, len(parts) // max(len(own), 1))
            mixtures.append(TMixture(parts, normalised(log)) if own else None)
        return cls(normalised(np.array(log_shares)), mixtures, len(columns), straight)

    def draw(self, count: int, rng: np.random.Generator) -> Points:
        """Points from this proposal."""
        branch = rng.choice(len(self._shares), count, p=self._shares)
        w = rng.standard_normal((count, self._dimension))
        y = self._straight.y(w)
        own = rng.random(count) >= _FROM_PRIOR
        for k, mixture in enumerate(self._mixtures):
            rows = np.flatnonzero((branch == k) & own)
            if mixture is not None and len(rows):
                y[rows] = mixture.draw(len(rows), rng)
                w[rows] = self._straight.w(y[rows])
        return Points(branch, w, y, self._straight.log_volume(w, y))

    def log_density(self, points: Points) -> FloatArray:
        """Log density (n,) by branch and w."""
        prior = log_normal(points.w)
        density = prior.copy()
        for k, mixture in enumerate(self._mixtures):
            rows = np.flatnonzero(points.branch == k)
            if mixture is not None and len(rows):
                own = np.log(1 - _FROM_PRIOR) + mixture.log_density(points.y[rows])
                own += points.log_volume[rows]
                density[rows] = np.logaddexp(own, np.log(_FROM_PRIOR) + prior[rows])
        return np.asarray(np.log(self._shares)[points.branch] + density)

    def refitted(
        self, points: Points, log_weight: FloatArray, rng: np.random.Generator
    ) -> Proposal:
        """Moved towards weighted points: where these are many, new parts on their clusters."""
        fewest = min(_FEWEST_TO_FIT * self._dimension, len(log_weight) / 2)
        weights = tempered(log_weight, fewest)
        shares, mixtures = [], []
        for k, mixture in enumerate(self._core):
            rows = np.flatnonzero(points.branch == k)
            shares.append(float(np.exp(_total(log_weight[rows]) - _total(log_weight))))
            mixtures.append(_refitted(mixture, points.y[rows], weights[rows], rng))
        return Proposal(np.array(shares), mixtures, self._dimension, self._straight, self._first)


def _about(peak: Peak, columns: IntArray, straight: Straight) -> list[Normal]:
    """Normal distributions of straightened points about a peak."""
    w, slopes = peak.w[columns], straight.slopes(peak.w[columns])
    covariance = slopes @ peak.covariance[np.ix_(columns, columns)] @ slopes.T
    centre = straight.y(w[None])[0]
    return [Normal(centre, np.outer(k, k) * covariance) for k in straight.widths(len(w))]


def _total(log_weight: FloatArray) -> float:
    return float(scipy.special.logsumexp(log_weight)) if len(log_weight) else -np.inf


def _refitted(
    mixture: TMixture | None, w: FloatArray, weights: FloatArray, rng: np.random.Generator
) -> TMixture | None:
    """Parts on the clusters of weighted points, or one step of expectation maximisation."""
    if weights.sum() <= 0 or not w.shape[1]:  # all of it is integrated out
        return mixture
    share = weights / weights.sum()
    if effective(share) >= _TO_CLUSTER * w.shape[1]:
        population = w[systematic(share, _POPULATION, rng)]
        # Equal copies of a point would make a cluster of no extent.
        whole = Normal.of(population)
        spread = _JITTER * rng.standard_normal(population.shape) @ whole.factor.T
        wide = narrow = TMixture.of(population + spread, _CLUSTERS, rng)
        for _ in range(_REFITS):
            narrow = narrow.refitted(w, share)
        return wide.mixed(narrow, _FROM_NARROW).joined([whole], _FROM_WHOLE)
    if mixture is None:
        mixture = TMixture([Normal(np.zeros(w.shape[1]), np.eye(w.shape[1]))], np.ones(1))
    log = [
        np.log(share) + TMixture([part], np.ones(1)).log_density(w)
        for part, share in zip(mixture.parts, mixture.shares, strict=True)
    ]
    owned = weights * np.exp(log - scipy.special.logsumexp(log, axis=0))
    kept = owned.sum(axis=1) > _LEAST_SHARE * weights.sum()
    parts = [_moved(part, w, own) for part, own in zip(mixture.parts, owned, strict=True)]
    chosen = [part for part, keep in zip(parts, kept, strict=True) if keep] or parts
    shares = owned.sum(axis=1)[kept] if kept.any() else owned.sum(axis=1)
    # A point that weighs much stands for a peak that no part covers.
    heavy = [
        Normal(w[row], mixture.parts[0].covariance) for row in np.flatnonzero(weights > _HEAVY)
    ]
    return TMixture([*chosen, *heavy], np.append(shares, weights[weights > _HEAVY]))


def _moved(part: Normal, w: FloatArray, owned: FloatArray) -> Normal:
    """A part moved to its points; where they are few, it keeps much of what it was."""
    total = owned.sum()
    if total <= 0:
        return part
    share = owned / total
    mean = share @ w
    kept = (w.shape[1] + 2) / (effective(share) + w.shape[1] + 2)
    own = (share[:, None] * (w - mean)).T @ (w - mean)
    centre = (1 - kept) * mean + kept * part.mean
    return Normal(centre, _INFLATION * ((1 - kept) * own + kept * part.covariance))
