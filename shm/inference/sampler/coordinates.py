"""The space of the sampler: every parameter's prior is a standard normal distribution there.

A parameter with a uniform prior has the normal quantile of its place in its range as coordinate, so
that no proposal leaves the range.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import scipy

from shm.values import FloatArray, Prior

_EDGE = 1e-9  # numerical: coordinates are finite, within 6 standard deviations

_FELT = (-0.7, 1.3)
"""log10 of how stiff a spring is that a mode feels, to EI p."""


def quantile(share: FloatArray) -> FloatArray:
    """Return standard normal quantiles of shares, kept off 0 and 1."""
    return np.asarray(scipy.special.ndtri(share.clip(_EDGE, 1 - _EDGE)))


def log_normal(z: FloatArray) -> FloatArray:
    """Return the log of the standard normal density (n,) at `z` (n, d)."""
    return np.asarray(-0.5 * (z**2).sum(axis=1) - 0.5 * z.shape[1] * np.log(2 * np.pi))


Pairs: TypeAlias = list[tuple[int, int]]
"""Columns of springs that can be exchanged."""

_NEAR, _MANY = 0.3, 0.1
"""Of the spread of two springs' difference, where points are near the fold; of all points."""


def fold_pairs(z: FloatArray, pairs: Pairs) -> FloatArray:
    """Return `z` (n, d) with the larger column of each pair first."""
    folded = z.copy()
    for one, other in pairs:
        folded[:, one] = np.maximum(z[:, one], z[:, other])
        folded[:, other] = np.minimum(z[:, one], z[:, other])
    return folded


def log_folded(z: FloatArray, pairs: Pairs) -> FloatArray:
    """Return by how much folding raises a log density (n,) at `z`; -inf outside of the fold."""
    found = np.zeros(len(z))
    for one, other in pairs:
        found = np.where(z[:, one] >= z[:, other], found + np.log(2), -np.inf)
    return found


def exchange(z: FloatArray, pairs: Pairs, rng: np.random.Generator) -> FloatArray:
    """Return `z` (n, d) with each pair of columns exchanged or not by chance."""
    exchanged = z.copy()
    for one, other in pairs:
        rows = np.flatnonzero(rng.random(len(z)) < 0.5)[:, None]
        exchanged[rows, [one, other]] = z[rows, [other, one]]
    return exchanged


def split_pairs(z: FloatArray, pairs: Pairs) -> tuple[Pairs, Pairs]:
    """Return the pairs of which few points `z` (n, d) are near the fold, and the others."""
    far: Pairs = []
    near: Pairs = []
    for one, other in pairs:
        apart = z[:, one] - z[:, other]
        close = np.mean(apart < _NEAR * np.sqrt(np.mean(apart**2)))
        (near if close > _MANY else far).append((one, other))
    return far, near


class Coordinates:
    """Coordinates z (n, d) of parameters theta (n, d) with uniform priors.

    `swaps` are pairs of springs (log10) that can be exchanged without changing any frequency: only
    one of the two ways round is sampled, the first spring the stiffer, its prior twice as dense.
    `wave_stiffness_n_m_rad` is EI p of a mode in the middle of those measured.
    """

    def __init__(
        self, prior: Prior, swaps: Sequence[tuple[str, str]], wave_stiffness_n_m_rad: float
    ):
        self.prior = prior
        self.dimension = len(prior.names)
        self._wave_stiffness = wave_stiffness_n_m_rad
        self._width: FloatArray = prior.upper - prior.lower
        self._pairs = [(prior.names.index(one), prior.names.index(other)) for one, other in swaps]
        self._folded = self._pairs

    def theta(self, z: FloatArray) -> FloatArray:
        """Return parameters (n, d) of coordinates (n, d)."""
        return np.asarray(self.prior.lower + self._width * scipy.special.ndtr(z))

    def places(self, theta: FloatArray) -> FloatArray:
        """Return coordinates (n, d) of parameters (n, d)."""
        return quantile((theta - self.prior.lower) / self._width)

    def fold(self, z: FloatArray) -> FloatArray:
        """Return `z` (n, d) with the stiffer spring of each pair first."""
        return fold_pairs(z, self._folded)

    def connect(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Fold no pair whose posterior, that of points `z` (n, d), goes on beyond the fold.

        Returns the points with these pairs exchanged or not by chance.
        """
        self._folded, open_ = split_pairs(z, self._folded)
        return exchange(z, open_, rng)

    def finished(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return parameters (n, d) at `z`, each pair of springs exchanged or not by chance."""
        return exchange(self.theta(z), self._pairs, rng)

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Return the log density (n,) of the folded prior at `z` (n, d); -inf outside of it."""
        return np.asarray(log_normal(z) + log_folded(z, self._folded))

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draw coordinates (n, d) from the folded prior."""
        return self.fold(rng.standard_normal((n, self.dimension)))

    def draw_felt(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draw the same with the springs of each pair as stiff as the bar, within a few times.

        There a frequency tells how stiff they are. Of springs that are much stiffer or softer it
        tells nothing, nor which way to go.
        """
        theta = self.theta(self.draw_prior(n, rng))
        columns = [column for pair in self._pairs for column in pair]
        felt = np.log10(self._wave_stiffness) + rng.uniform(*_FELT, (n, len(columns)))
        theta[:, columns] = felt.clip(self.prior.lower[columns], self.prior.upper[columns])
        return self.fold(self.places(theta))
