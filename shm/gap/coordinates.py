"""The coordinates z of a hypothesis, in which every prior is standard normal.

A uniform or logarithmic prior becomes normal by its quantiles. A parameter that may have either
sign jumps from its smallest negative to its smallest positive value at z = 0. A fit therefore
keeps to one branch of signs and works in coordinates w, in which the parameter's magnitude has a
normal prior; each branch has the prior probability 1/2 a signed parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import ndtr, ndtri

from shm.models.effects import Parameter
from shm.values import FloatArray, IntArray, Scatter

DEVIATIONS = 4
TENSION = "theta_F"
_EDGE = 1e-12
_INSIDE = 1e-3
_MOST_CUT = 0.9


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
        magnitude = -ndtri((ndtr(-w) / 2).clip(_EDGE, 0.5))
        return np.where(self.signs == 0, w, self.signs * magnitude)

    def w(self, z: FloatArray) -> FloatArray:
        """The inverse of `z`, for points of this branch."""
        magnitude = -ndtri((2 * ndtr(-np.abs(z))).clip(_EDGE, 1 - _EDGE))
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
            [scatter.section, scatter.density, scatter.length, scatter.modulus]
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
        share = ndtr(z).clip(_EDGE, 1 - _EDGE)
        columns = [
            each.value(column) for each, column in zip(self.parameters, share.T, strict=True)
        ]
        theta = np.stack(columns, axis=1)
        theta[:, self._made] = self._scatter * z[:, self._made]
        return theta

    def z(self, theta: FloatArray) -> FloatArray:
        """The inverse of `theta`; what lies outside of a prior comes to its nearest end."""
        share = [each.share(column) for each, column in zip(self.parameters, theta.T, strict=True)]
        z = np.asarray(ndtri(np.stack(share, axis=1).clip(_INSIDE, 1 - _INSIDE)))
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
