"""The space that the sampler works in: there the prior is nearly standard normal.

Parameters map to z by the normal quantile of their uniform priors, so that no proposal leaves the
box. Two end springs that can be exchanged without changing any frequency are another matter. An end
gives way like 1/(k + EI p), with p the wave number of a mode, and frequencies tell, nearly, how
much both ends give together: the posterior of the two is a hook along a curve where that sum is
constant. Such a pair is folded to k_one >= k_other, where the prior is twice as dense, and has as
coordinates log k_one and the log of the stiffness that two springs alike would have to give as
much. The hook is then straight, and a normal or t distribution can follow it. Samples are unfolded
again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr, ndtri

from shm.values import FloatArray, Prior

_EDGE = 1e-9


class Coordinates:
    """Places z (n, d) of parameters theta (n, d), with pairs of springs (log10) straightened.

    `wave_stiffness_n_m_rad` is EI p of a mode in the middle of those measured.
    """

    def __init__(
        self, prior: Prior, swaps: Sequence[tuple[str, str]], wave_stiffness_n_m_rad: float
    ):
        self.prior = prior
        self._own = wave_stiffness_n_m_rad
        self._width: FloatArray = prior.upper - prior.lower
        self._pairs = [(prior.names.index(one), prior.names.index(other)) for one, other in swaps]

    def theta(self, z: FloatArray) -> FloatArray:
        """Parameters (n, d) of places (n, d); a place outside of the prior gets a near one's."""
        share = ndtr(z)
        theta = np.asarray(self.prior.lower + self._width * share)
        for one, other in self._pairs:
            weaker = self._weaker(theta[:, one], theta[:, other], other)
            theta[:, other] = weaker.clip(self.prior.lower[other], self.prior.upper[other])
        return theta

    def places(self, theta: FloatArray) -> FloatArray:
        """Places (n, d), inside the fold, of parameters (n, d)."""
        share = (theta - self.prior.lower) / self._width
        for one, other in self._pairs:
            pair = np.sort(theta[:, [one, other]], axis=1)
            share[:, one] = (pair[:, 1] - self.prior.lower[one]) / self._width[one]
            alike = np.log10(2 / self._give(pair).sum(axis=1) - self._own)
            share[:, other] = (alike - self.prior.lower[other]) / self._width[other]
        return np.asarray(ndtri(share.clip(_EDGE, 1 - _EDGE)))

    def fold(self, z: FloatArray) -> FloatArray:
        """`z` (n, d) with each point replaced by its copy inside the fold."""
        folded = z.copy()
        columns = [column for pair in self._pairs for column in pair]
        folded[:, columns] = self.places(self.theta(z))[:, columns]
        return folded

    def unfold(self, theta: FloatArray, rng: np.random.Generator) -> FloatArray:
        """`theta` with each pair exchanged or not by chance: both copies are equally likely."""
        theta = theta.copy()
        for one, other in self._pairs:
            rows = np.flatnonzero(rng.random(len(theta)) < 0.5)[:, None]
            theta[rows, [one, other]] = theta[rows, [other, one]]
        return theta

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Log density (n,) of the folded prior at `z` (n, d); -inf outside of it."""
        density: FloatArray = -0.5 * (z**2).sum(axis=1) - 0.5 * z.shape[1] * np.log(2 * np.pi)
        for one, other in self._pairs:
            stronger = self.prior.lower[one] + self._width[one] * ndtr(z[:, one])
            alike = self.prior.lower[other] + self._width[other] * ndtr(z[:, other])
            weaker = self._weaker(stronger, alike, other)
            inside = (weaker <= stronger) & (weaker >= self.prior.lower[other])
            stretch = self._log_stretch(weaker, alike)
            density = np.where(inside, density + np.log(2) + stretch, -np.inf)
        return density

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Places (n, d) from the folded prior."""
        return self.places(rng.uniform(self.prior.lower, self.prior.upper, (n, len(self._width))))

    def _weaker(self, stronger: FloatArray, alike: FloatArray, other: int) -> FloatArray:
        """log10 of the weaker spring beside the stronger one that makes the pair as `alike`."""
        give = 2 * self._give(alike) - self._give(stronger)
        stiffness = 1 / np.maximum(give, self._give(alike) / 2) - self._own
        least = 0.999 * 10 ** self.prior.lower[other]
        return np.asarray(np.log10(np.maximum(stiffness, least)))

    def _log_stretch(self, weaker: FloatArray, alike: FloatArray) -> FloatArray:
        """Log of the weaker spring's change by that of `alike`, at the same stronger one."""
        slopes = [np.log(10**k) + 2 * np.log(self._give(k)) for k in (alike, weaker)]
        return np.asarray(np.log(2) + slopes[0] - slopes[1])

    def _give(self, log10_k: FloatArray) -> FloatArray:
        """How much an end gives way."""
        return np.asarray(1 / (10**log10_k + self._own))
