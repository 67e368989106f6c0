"""The coordinates z of a hypothesis, in which every prior is standard normal.

A uniform or logarithmic prior becomes normal by its quantiles. A parameter that may have either
sign jumps from its smallest negative to its smallest positive value at z = 0. A fit therefore
keeps to one branch of signs and works in coordinates w, in which the parameter's magnitude has a
normal prior; each branch has the prior probability 1/2 a signed parameter.

Coordinates in which the posterior of end springs is straight, for what is drawn of them.

A mode feels of the two ends of its plane, nearly, how much both give way together, a spring k like
1/(k + EI p) with p the wave number (see `shm.inference.coordinates`). So precise frequencies leave
of two springs a bent, thin ridge, and two springs alike lie on it where it has no slope to follow.
Such a pair has as coordinates here the w of two springs alike that would give as much, and the
difference of the two w. Nothing is folded: effects tell the ends apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy

from shm.models.effects import Parameter
from shm.values import FloatArray, IntArray, Scatter

DEVIATIONS = 4  # of section, density, length and modulus: the fields of `Scatter`
TENSION = "theta_F"
# Technical: quantiles beyond 1e-12 (7 standard deviations) lose their last digits; a start comes no
# nearer to the end of a prior than 1e-3 (3 standard deviations), where slopes are a hundredth.
_EDGE, _INSIDE = 1e-12, 1e-3
# Judgement: a tenth of a size's range stays, or an effect that is hardly seen would have no prior.
_MOST_CUT = 0.9
_FARTHEST = 7.0
"""Beyond this w, of a probability of 1e-12, springs no longer differ in the last digit."""
_HALVINGS = 40  # of 14 at most: to 1e-11, the rounding of `_FARTHEST`
_WIDENED, _NARROWED = 3.0, (0.3, 1.0)
"""From posteriors of a hanger of 8 and 6 modes: 3 to 4 times as wide, 0.2 to 0.5 as long."""


def scale_free(parameter: Parameter) -> bool:
    """Whether a parameter is a size whose prior is even over its logarithm."""
    size = not np.isnan(parameter.zero)
    return size and (parameter.spread == "logarithmic" or bool(np.isinf(parameter.zero)))


def is_place(parameter: Parameter) -> bool:
    """Whether a parameter says where along the hanger."""
    return (
        bool(np.isnan(parameter.zero)) and parameter.spread == "uniform" and parameter.unit == "m"
    )


def cut(parameter: Parameter, share: float) -> Parameter:
    """The parameter without the `share` of its range that is nearest to no effect."""
    if not scale_free(parameter) or share <= 0:
        return parameter
    unsigned, share = replace(parameter, signed=False), min(share, _MOST_CUT)
    if parameter.zero > parameter.upper:
        return replace(parameter, upper=float(unsigned.value(np.array(1 - share))))
    return replace(parameter, lower=float(unsigned.value(np.array(share))))


@dataclass(frozen=True, eq=False)
class Branch:
    """One choice of signs: `signs` (d,) are -1 or 1 for signed parameters and 0 for others."""

    signs: FloatArray

    @property
    def log_prior(self) -> float:
        return float(-np.log(2) * np.count_nonzero(self.signs))

    def z(self, w: FloatArray) -> FloatArray:
        """Coordinates z (n, d) of branch coordinates w (n, d)."""
        magnitude = -scipy.special.ndtri((scipy.special.ndtr(-w) / 2).clip(_EDGE, 0.5))
        return np.where(self.signs == 0, w, self.signs * magnitude)

    def w(self, z: FloatArray) -> FloatArray:
        """The inverse of `z`, for points of this branch."""
        magnitude = -scipy.special.ndtri(
            (2 * scipy.special.ndtr(-np.abs(z))).clip(_EDGE, 1 - _EDGE)
        )
        return np.where(self.signs == 0, z, magnitude)

    def stretch(self, w: FloatArray) -> FloatArray:
        """dz/dw (d,) at one point w (d,)."""
        away = np.abs(self.z(w))
        return np.where(self.signs == 0, 1.0, self.signs * np.exp((away**2 - w**2) / 2) / 2)

    def part(self, columns: IntArray) -> Branch:
        """The same choice for some of the parameters alone."""
        return Branch(self.signs[columns])

    def holds(self, z: FloatArray) -> FloatArray:
        """Which of points (n, d) lie on this branch, (n,)."""
        positive = np.where(z >= 0, 1.0, -1.0)
        return np.asarray(((self.signs == 0) | (self.signs == positive)).all(axis=1))


class Coordinates:
    """Parameters theta (n, d) of z (n, d): a baseline's, the bar's deviations, then effects'."""

    def __init__(self, parameters: Sequence[Parameter], baseline: int, scatter: Scatter):
        self.parameters = tuple(parameters)
        self._made = slice(baseline, baseline + DEVIATIONS)
        self._scatter = np.array(
            [scatter.section, scatter.density, scatter.swinging_length, scatter.modulus]
        )
        self.names = tuple(parameter.name for parameter in parameters)

    @property
    def linear(self) -> IntArray:
        """The columns in which logarithms of frequencies are nearly linear: tension, deviations."""
        return np.append(self.tension, np.arange(self._made.start, self._made.stop))

    @property
    def tension(self) -> IntArray:
        """The column of the tension, if it is a parameter."""
        own = self.names[: self._made.start]
        return np.array([k for k, name in enumerate(own) if name == TENSION], dtype=np.int64)

    @property
    def other(self) -> IntArray:
        """The other columns."""
        return np.setdiff1d(np.arange(self.dimension), self.linear)

    @property
    def dimension(self) -> int:
        return len(self.parameters)

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Every choice of signs."""
        options = [(-1.0, 1.0) if each.signed else (0.0,) for each in self.parameters]
        return tuple(Branch(np.array(signs)) for signs in product(*options))

    def theta(self, z: FloatArray) -> FloatArray:
        """Parameters (n, d) in their units at z (n, d)."""
        share = scipy.special.ndtr(z).clip(_EDGE, 1 - _EDGE)
        columns = [
            each.value(column) for each, column in zip(self.parameters, share.T, strict=True)
        ]
        theta = np.stack(columns, axis=1)
        theta[:, self._made] = self._scatter * z[:, self._made]
        return theta

    def z(self, theta: FloatArray) -> FloatArray:
        """The inverse of `theta`; what lies outside of a prior comes to its nearest end."""
        share = [each.share(column) for each, column in zip(self.parameters, theta.T, strict=True)]
        z = np.asarray(scipy.special.ndtri(np.stack(share, axis=1).clip(_INSIDE, 1 - _INSIDE)))
        z[:, self._made] = theta[:, self._made] / self._scatter
        return z

    def magnitude(self, theta: FloatArray, first: int) -> FloatArray:
        """The largest share (n,), from 0 to 1, that a size from column `first` on has of its range.

        0 is the end nearest to no effect; 1 where there is no size whose range is scale-free.
        """
        shares = [
            _away_from_none(each, theta[:, column])
            for column, each in enumerate(self.parameters)
            if column >= first and scale_free(each)
        ]
        return np.max(shares, axis=0) if shares else np.ones(len(theta))

    def grown(self, theta: FloatArray, first: int, factor: FloatArray) -> FloatArray:
        """Sets (n, d) with the sizes from column `first` on made larger by factors (n,)."""
        grown = theta.copy()
        for column in range(first, self.dimension):
            each = self.parameters[column]
            if scale_free(each):
                grown[:, column] = _grown(each, theta[:, column], factor)
        return grown


def _grown(parameter: Parameter, value: FloatArray, factor: FloatArray) -> FloatArray:
    if parameter.spread == "uniform":
        return np.asarray(value - np.sign(parameter.zero) * np.log10(factor))
    return np.asarray(value / factor if np.isinf(parameter.zero) else value * factor)


def _away_from_none(parameter: Parameter, value: FloatArray) -> FloatArray:
    share = replace(parameter, signed=False).share(np.abs(value) if parameter.signed else value)
    return np.asarray(1 - share if parameter.zero > parameter.upper else share)


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
        stiffness = self.lower + (self.upper - self.lower) * scipy.special.ndtr(w)
        return np.asarray(1 / (1 + np.exp(np.log(10) * (stiffness - self.own))))

    def log_slope(self, w: FloatArray) -> FloatArray:
        """Log of how fast that falls with w, but for a constant."""
        give = self.give(w)
        return np.asarray(np.log(give) + np.log1p(-give) - w**2 / 2)

    def alike(self, give: FloatArray) -> FloatArray:
        """The w of a spring that gives so much."""
        stiffness = self.own + np.log(1 / give - 1) / np.log(10)
        share = (stiffness - self.lower) / (self.upper - self.lower)
        ends = scipy.special.ndtr([-_FARTHEST, _FARTHEST])
        return np.asarray(scipy.special.ndtri(share.clip(*ends)))


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
