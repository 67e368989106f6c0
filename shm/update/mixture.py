"""Normal and t distributions that stand for a population of points, to propose others from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.special import gammaln, logsumexp

from shm.values import FloatArray

_DEGREES_OF_FREEDOM = 4.0
_REGULAR = 1e-12


class Normal:
    """Centre and Cholesky factor of a covariance (d, d)."""

    def __init__(self, mean: FloatArray, covariance: FloatArray):
        self.mean = mean
        self.covariance = covariance + _REGULAR * np.eye(len(mean))
        self.factor = np.linalg.cholesky(self.covariance)
        self._inverse_factor = np.linalg.inv(self.factor)

    @classmethod
    def of(cls, z: FloatArray, weights: FloatArray | None = None) -> Normal:
        """The normal of a population (n, d) with optional weights (n,)."""
        return cls(np.average(z, axis=0, weights=weights), np.cov(z.T, aweights=weights))

    def whiten(self, z: FloatArray) -> FloatArray:
        """`z` (n, d) relative to the centre, in standard deviations."""
        return np.asarray((z - self.mean) @ self._inverse_factor.T)

    def colour(self, y: FloatArray) -> FloatArray:
        """The inverse of `whiten`."""
        return np.asarray(self.mean + y @ self.factor.T)

    def draw_t(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draws (n, d) of the t distribution of this centre and shape."""
        scale = np.sqrt(rng.chisquare(_DEGREES_OF_FREEDOM, n) / _DEGREES_OF_FREEDOM)
        return self.colour(rng.standard_normal((n, len(self.mean))) / scale[:, None])

    def log_t(self, z: FloatArray) -> FloatArray:
        """Log density (n,) of that t distribution at `z` (n, d)."""
        nu, d = _DEGREES_OF_FREEDOM, len(self.mean)
        square = (self.whiten(z) ** 2).sum(axis=1)
        constant = gammaln((nu + d) / 2) - gammaln(nu / 2) - d / 2 * np.log(nu * np.pi)
        log_volume = np.log(np.diag(self.factor)).sum()
        return np.asarray(constant - log_volume - (nu + d) / 2 * np.log1p(square / nu))


class TMixture:
    """A mixture of t distributions with given shares."""

    def __init__(self, parts: Sequence[Normal], shares: FloatArray):
        self.parts = parts
        self.shares = shares / shares.sum()

    @classmethod
    def of(cls, population: FloatArray, clusters: int, rng: np.random.Generator) -> TMixture:
        """One t on each cluster of a population (n, d)."""
        whole = Normal.of(population)
        label = kmeans2(whole.whiten(population), clusters, minit="++", rng=rng)[1]
        members = [population[label == k] for k in range(clusters) if np.sum(label == k) > 2]
        shares = np.array([len(cluster) for cluster in members], dtype=float)
        return cls([_shrunk(cluster, whole) for cluster in members], shares)

    def joined(self, parts: Sequence[Normal], share: float) -> TMixture:
        """This mixture with `parts` added, which get `share` of it in equal measure."""
        added = np.full(len(parts), share / len(parts))
        return TMixture([*self.parts, *parts], np.append((1 - share) * self.shares, added))

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Draws (n, d) in random order."""
        counts = rng.multinomial(n, self.shares)
        drawn = [p.draw_t(k, rng) for p, k in zip(self.parts, counts, strict=True)]
        return rng.permutation(np.vstack(drawn))

    def log_density(self, z: FloatArray) -> FloatArray:
        """Log density (n,) at `z` (n, d)."""
        parts = [np.log(s) + p.log_t(z) for s, p in zip(self.shares, self.parts, strict=True)]
        return np.asarray(logsumexp(parts, axis=0))


def _shrunk(cluster: FloatArray, whole: Normal) -> Normal:
    """The normal of a cluster; a small one borrows covariance from the whole."""
    n, d = cluster.shape
    borrowed = (d + 2) / (n + d + 2)
    covariance = (1 - borrowed) * np.cov(cluster.T) + borrowed * whole.covariance
    return Normal(cluster.mean(axis=0), covariance)
