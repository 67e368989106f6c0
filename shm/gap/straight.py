"""Coordinates in which the posterior of end springs is straight, for what is drawn of them.

A mode feels of the two ends of its plane, nearly, how much both give way together, a spring k like
1/(k + EI p) with p the wave number (see `shm.inference.coordinates`). So precise frequencies leave
of two springs a bent, thin ridge, and two springs alike lie on it where it has no slope to follow.
Such a pair has as coordinates here the w of two springs alike that would give as much, and the
difference of the two w. Nothing is folded: effects tell the ends apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from shm.values import FloatArray

_LOG_10 = float(np.log(10))
_FARTHEST = 7.0
"""Beyond this w, of a probability of 1e-12, springs no longer differ in the last digit."""

_HALVINGS = 40

_WIDENED, _NARROWED = 3.0, (0.3, 1.0)
"""From posteriors of a hanger of 8 and 6 modes: 3 to 4 times as wide, 0.2 to 0.5 as long."""


@dataclass(frozen=True)
class Pair:
    """Columns of two springs with uniform priors of log10 from `lower` to `upper`.

    `own` is log10 of EI p.
    """

    one: int
    other: int
    lower: float
    upper: float
    own: float

    def give(self, w: FloatArray) -> FloatArray:
        """How much an end gives way, from 0 to 1."""
        stiffness = self.lower + (self.upper - self.lower) * ndtr(w)
        return np.asarray(1 / (1 + np.exp(_LOG_10 * (stiffness - self.own))))

    def log_slope(self, w: FloatArray) -> FloatArray:
        """Log of how fast that falls with w, but for a constant."""
        give = self.give(w)
        return np.asarray(np.log(give) + np.log1p(-give) - w**2 / 2)

    def alike(self, give: FloatArray) -> FloatArray:
        """The w of a spring that gives so much."""
        stiffness = self.own + np.log(1 / give - 1) / _LOG_10
        share = (stiffness - self.lower) / (self.upper - self.lower)
        return ndtri(share.clip(ndtr(-_FARTHEST), ndtr(_FARTHEST)))


class Straight:
    """The map between w (n, d) and straightened y (n, d), pair by pair."""

    def __init__(self, pairs: Sequence[Pair]):
        self._pairs = tuple(pairs)

    def y(self, w: FloatArray) -> FloatArray:
        """Straightened."""
        y = w.copy()
        for pair in self._pairs:
            both = w[:, [pair.one, pair.other]].clip(-_FARTHEST, _FARTHEST)
            y[:, pair.one] = pair.alike(pair.give(both).mean(axis=1))
            y[:, pair.other] = w[:, pair.one] - w[:, pair.other]
        return y

    def w(self, y: FloatArray) -> FloatArray:
        """The inverse of `y`; the middle of each pair by halving."""
        w = y.copy()
        for pair in self._pairs:
            give, half = pair.give(y[:, pair.one]), y[:, pair.other] / 2
            low, high = y[:, pair.one] - np.abs(half), y[:, pair.one] + np.abs(half)
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                stiff = pair.give(middle + half) + pair.give(middle - half) < 2 * give
                low, high = np.where(stiff, low, middle), np.where(stiff, middle, high)
            w[:, pair.one], w[:, pair.other] = middle + half, middle - half
        return w

    def log_volume(self, w: FloatArray, y: FloatArray) -> FloatArray:
        """Log of |dy/dw| (n,)."""
        total = np.zeros(len(w))
        for pair in self._pairs:
            one, other = pair.log_slope(w[:, pair.one]), pair.log_slope(w[:, pair.other])
            total += np.logaddexp(one, other) - np.log(2) - pair.log_slope(y[:, pair.one])
        return total

    def slopes(self, w: FloatArray) -> FloatArray:
        """dy/dw (d, d) at one point w (d,)."""
        slopes, y = np.eye(len(w)), self.y(w[None])[0]
        for pair in self._pairs:
            columns = [pair.one, pair.other]
            own = pair.log_slope(w[columns]) - pair.log_slope(y[pair.one])
            slopes[pair.one, columns] = np.exp(own) / 2
            slopes[pair.other, columns] = 1.0, -1.0
        return slopes

    def widths(self, dimension: int) -> list[FloatArray]:
        """By how much (dimension,) a fit's normal distribution is to be widened to draw from.

        Along what both ends give it is too thin, for it takes the errors at their likeliest size;
        along the difference it may be too long, for where two springs are alike it sees no slope.
        """
        plain = np.ones(dimension)
        if not self._pairs:
            return [plain]
        found = []
        for narrowed in _NARROWED:
            width = plain.copy()
            width[[pair.one for pair in self._pairs]] = _WIDENED
            width[[pair.other for pair in self._pairs]] = narrowed
            found.append(width)
        return found
