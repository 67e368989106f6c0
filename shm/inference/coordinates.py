"""The space that the sampler works in: there the prior is nearly standard normal.

Parameters map to z by the normal quantile of their uniform priors, so that no proposal leaves the
box. Two end springs that can be exchanged without changing any frequency are another matter. An end
gives way like 1/(k + EI p), with p the wave number of a mode, and frequencies tell, nearly, how
much both ends give together: the posterior of the two is a hook along a curve where that sum is
constant. Such a pair is folded to k_one >= k_other, where the prior is twice as dense, and has as
coordinates log k_one and a mean of two logs: mostly of the stiffness that two springs alike would
have to give as much, a little of k_other. The first straightens the hook, so that a normal or t
distribution can follow it; the second keeps apart what is soft and hardly felt. Samples are
unfolded again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from shm.values import FloatArray, Prior

_EDGE = 1e-9  # z is finite: within 6 standard deviations

# Judgement: enough that Newton's slope never vanishes where the weaker spring is not felt, and
# little enough that the hook stays straight. It moves proposals only; weights correct for it.
_SHARE = 0.1

# Newton doubles the digits: over 7 decades of both springs four steps leave 1e-4, five 4e-9.
_STEPS = 5
_FELT = (-0.7, 1.3)
"""log10 of how stiff a spring is that a mode feels, to EI p."""
_LOG_10 = np.log(10)  # the exponential is much quicker than a power of ten


def quantile(share: FloatArray) -> FloatArray:
    """Standard normal z of shares of a prior's range, kept off its ends."""
    return np.asarray(scipy.special.ndtri(share.clip(_EDGE, 1 - _EDGE)))


def log_normal(z: FloatArray) -> FloatArray:
    """Log of the standard normal density (n,) at `z` (n, d)."""
    return np.asarray(-0.5 * (z**2).sum(axis=1) - 0.5 * z.shape[1] * np.log(2 * np.pi))


class Coordinates:
    """Places z (n, d) of parameters theta (n, d), with pairs of springs (log10) straightened.

    `wave_stiffness_n_m_rad` is EI p of a mode in the middle of those measured.
    """

    def __init__(
        self, prior: Prior, swaps: Sequence[tuple[str, str]], wave_stiffness_n_m_rad: float
    ):
        self.prior = prior
        self.dimension = len(prior.names)
        self._own = wave_stiffness_n_m_rad
        self._width: FloatArray = prior.upper - prior.lower
        self._pairs = [(prior.names.index(one), prior.names.index(other)) for one, other in swaps]

    def theta(self, z: FloatArray) -> FloatArray:
        """Parameters (n, d) of places (n, d); a place outside of the prior gets a near one's."""
        share = scipy.special.ndtr(z)
        theta = np.asarray(self.prior.lower + self._width * share)
        for one, other in self._pairs:
            weaker = self._weaker(theta[:, one], theta[:, other])
            theta[:, other] = weaker.clip(self.prior.lower[other], self.prior.upper[other])
        return theta

    def places(self, theta: FloatArray) -> FloatArray:
        """Places (n, d), inside the fold, of parameters (n, d)."""
        share = (theta - self.prior.lower) / self._width
        for one, other in self._pairs:
            pair = np.sort(theta[:, [one, other]], axis=1)
            share[:, one] = (pair[:, 1] - self.prior.lower[one]) / self._width[one]
            mixed, _ = self._mixed(pair[:, 1], pair[:, 0])
            share[:, other] = (mixed - self.prior.lower[other]) / self._width[other]
        return quantile(share)

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

    def finished(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Draws of the parameters (n, d) at `z` (n, d), unfolded."""
        return self.unfold(self.theta(z), rng)

    def log_prior(self, z: FloatArray) -> FloatArray:
        """Log density (n,) of the folded prior at `z` (n, d); -inf outside of it."""
        density = log_normal(z)
        for one, other in self._pairs:
            stronger = self.prior.lower[one] + self._width[one] * scipy.special.ndtr(z[:, one])
            mixed = self.prior.lower[other] + self._width[other] * scipy.special.ndtr(z[:, other])
            weaker = self._weaker(stronger, mixed)
            inside = (weaker <= stronger) & (weaker >= self.prior.lower[other])
            stretch = -np.log(self._mixed(stronger, weaker)[1])
            density = np.where(inside, density + np.log(2) + stretch, -np.inf)
        return density

    def draw_prior(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Places (n, d) from the folded prior."""
        return self.places(rng.uniform(self.prior.lower, self.prior.upper, (n, len(self._width))))

    def draw_felt(self, n: int, rng: np.random.Generator) -> FloatArray:
        """The same with the springs of each pair as stiff as the bar, within a few times.

        There a frequency tells how stiff they are. Of springs that are much stiffer or softer it
        tells nothing, nor which way to go.
        """
        theta = rng.uniform(self.prior.lower, self.prior.upper, (n, len(self._width)))
        columns = [column for pair in self._pairs for column in pair]
        felt = np.log10(self._own) + rng.uniform(*_FELT, (n, len(columns)))
        theta[:, columns] = felt.clip(self.prior.lower[columns], self.prior.upper[columns])
        return self.places(theta)

    def _weaker(self, stronger: FloatArray, mixed: FloatArray) -> FloatArray:
        """log10 of the weaker spring, by Newton's steps."""
        weaker = mixed.copy()
        for _ in range(_STEPS):
            found, slope = self._mixed(stronger, weaker)
            weaker = weaker - (found - mixed) / slope
        return weaker

    def _mixed(self, stronger: FloatArray, weaker: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The weaker spring's coordinate before it becomes a quantile, and its slope.

        From log10 of both springs; the slope is by that of the weaker one.
        """
        stiffness = np.exp(_LOG_10 * weaker)
        give = 1 / (stiffness + self._own)
        both = give + 1 / (np.exp(_LOG_10 * stronger) + self._own)
        alike = 2 / both - self._own
        mixed = (1 - _SHARE) / _LOG_10 * np.log(alike) + _SHARE * weaker
        slope = (1 - _SHARE) * 2 * stiffness * (give / both) ** 2 / alike + _SHARE
        return mixed, slope
