"""The coordinates z of a hypothesis, in which every prior is standard normal.

Those of the hanger as made come first, as in `shm.inference.problem.described`; behind them stand
the parameters of effects, each as the normal quantile of its share of its prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from shm.inference.problem.described import DescribedCoordinates
from shm.models.effects import Parameter
from shm.values import FloatArray, IntArray

# Numerical: quantiles beyond 1e-12 (7 standard deviations) lose their last digits; a start comes no
# nearer to the end of a prior than 1e-3, where slopes are a hundredth.
_EDGE, _INSIDE = 1e-12, 1e-3
_MOST_CUT = 0.9  # judgement: of a size's range, or an effect hardly seen would have no prior


def scale_free(parameter: Parameter) -> bool:
    """Return True for a size whose prior is even over its logarithm."""
    size = not np.isnan(parameter.zero)
    return size and (parameter.spread == "logarithmic" or bool(np.isinf(parameter.zero)))


def is_place(parameter: Parameter) -> bool:
    """Return True for a parameter that says where along the hanger."""
    return (
        bool(np.isnan(parameter.zero)) and parameter.spread == "uniform" and parameter.unit == "m"
    )


def cut(parameter: Parameter, share: float) -> Parameter:
    """Return the parameter without the `share` of its range that is nearest to no effect."""
    if not scale_free(parameter) or share <= 0:
        return parameter
    unsigned, share = replace(parameter, signed=False), min(share, _MOST_CUT)
    if parameter.zero > parameter.upper:
        return replace(parameter, upper=float(unsigned.value(np.array(1 - share))))
    return replace(parameter, lower=float(unsigned.value(np.array(share))))


class Coordinates:
    """Coordinates z (n, d): of the hanger `described`, then of the parameters of `effects`."""

    def __init__(self, described: DescribedCoordinates, effects: Sequence[Parameter]):
        self.described, self.effects = described, tuple(effects)
        self.baseline: int = described.dimension

    @property
    def dimension(self) -> int:
        return self.baseline + len(self.effects)

    @property
    def places(self) -> IntArray:
        """Return the columns of places along the hanger."""
        are_places = [is_place(each) for each in self.effects]
        return np.asarray(self.baseline + np.flatnonzero(are_places))

    def theta(self, z: FloatArray) -> FloatArray:
        """Return parameters (n, parameters) in their units, what is not seen at its middle."""
        return np.hstack([self.described.theta(z[:, : self.baseline]), self.effect_values(z)])

    def drawn(self, z: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the same with what is not seen drawn from its prior."""
        hanger = self.described.finished(z[:, : self.baseline], rng)
        return np.hstack([hanger, self.effect_values(z)])

    def effect_values(self, z: FloatArray) -> FloatArray:
        """Return the parameters (n, p) of the effects."""
        share = scipy.special.ndtr(z[:, self.baseline :]).clip(_EDGE, 1 - _EDGE)
        columns = [each.value(u) for each, u in zip(self.effects, share.T, strict=True)]
        return np.stack(columns, axis=1) if columns else np.empty((len(z), 0))

    def effect_z(self, values: FloatArray, first: int) -> FloatArray:
        """Return the coordinates (n, p) of values (n, p) of the effects from column `first` on."""
        parameters = self.effects[first - self.baseline :]
        share = np.stack(
            [each.share(v) for each, v in zip(parameters, values.T, strict=True)], axis=1
        )
        return np.asarray(scipy.special.ndtri(share.clip(_INSIDE, 1 - _INSIDE)))

    def magnitude(self, values: FloatArray) -> FloatArray:
        """Return the largest share (n,) that a size among `values` (n, p) has of its range.

        `values` are those of the last effect. 0 is the end nearest to no effect; 1 where there is
        no size whose range is scale-free.
        """
        parameters = self.effects[len(self.effects) - values.shape[1] :]
        shares = [
            _away_from_none(each, v)
            for each, v in zip(parameters, values.T, strict=True)
            if scale_free(each)
        ]
        return np.max(shares, axis=0) if shares else np.ones(len(values))


def _away_from_none(parameter: Parameter, value: FloatArray) -> FloatArray:
    share = replace(parameter, signed=False).share(np.abs(value) if parameter.signed else value)
    return np.asarray(1 - share if parameter.zero > parameter.upper else share)
