"""The baseline's misfit as least squares sees it, and changes that may explain it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from shm.gap.contract import Design, Fit
from shm.gap.problem import GapProblem
from shm.gap.residuals import identification_sd
from shm.values import FloatArray, IntArray

# Judgement: where no standard deviation is stated, the one that is estimated may be four times too
# large (1 / 4.5^2 = 0.05), and data may rightly fit so well.
_LEAST_SCALE = 0.05


@dataclass(frozen=True, eq=False)
class Misfit:
    """The baseline's misfit, with its free parameters and errors together as one covariance.

    Data that the baseline and a local cause cannot but predict alike, as those of a mode in tests
    at several temperatures, are taken together: `rows` (distinct,) are one of each kind, `value`
    and `sd` their weighted means, and the chi-square of their `scatter` about these is left over in
    any case. `deviation` (distinct,) is that of the values from the middle of the prior, to first
    order; `slopes` (distinct, p) are those of the baseline's d parameters and then, as further
    parameters z, of the errors that repeat; `weighted` is the same over `sd`, `inner` (p, p) the
    covariance of all p. `own` is d. `data` counts all data; `least_scale` is the
    least chi-square of a datum that is taken for noise.
    """

    rows: IntArray
    value: FloatArray
    sd: FloatArray
    deviation: FloatArray
    slopes: FloatArray
    weighted: FloatArray
    inner: FloatArray
    own: int
    scatter: float
    data: int
    least_scale: float

    @classmethod
    def of(cls, problem: GapProblem, before: Fit) -> Misfit:
        observations = problem.observations
        rows, kind = _distinct(observations.design, before.predicted)
        precision = identification_sd(problem, before) ** -2
        sd = np.asarray(np.bincount(kind, precision) ** -0.5)
        value = np.bincount(kind, precision * observations.value) * sd**2
        slopes = np.column_stack([before.slopes, problem.repeated.loads])[rows]
        weighted = slopes / sd[:, None]
        return cls(
            rows=rows,
            value=value,
            sd=sd,
            deviation=value - before.predicted[rows] + before.slopes[rows] @ before.z,
            slopes=slopes,
            weighted=weighted,
            inner=np.asarray(np.linalg.inv(np.eye(slopes.shape[1]) + weighted.T @ weighted)),
            own=len(before.z),
            scatter=float(precision @ (observations.value - value[kind]) ** 2),
            data=len(kind),
            least_scale=1.0 if np.isfinite(observations.sd).any() else _LEAST_SCALE,
        )

    def products(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """Products (n,) of rows (n, distinct) by the inverse covariance (Woodbury's identity)."""
        one, other = one / self.sd, other / self.sd
        left, right = one @ self.weighted, other @ self.weighted
        products = np.einsum("ij,ij->i", one, other)
        return np.asarray(products - np.einsum("ij,ij->i", left @ self.inner, right))

    def parameters(self, deviation: FloatArray) -> FloatArray:
        """The likeliest parameters z (n, p) for deviations (n, distinct)."""
        return np.asarray((deviation / self.sd) @ self.weighted @ self.inner)

    @property
    def total(self) -> float:
        """The chi-square of the baseline."""
        deviation = self.deviation[None]
        return float(self.products(deviation, deviation)[0]) + self.scatter

    def repeated(self, z: FloatArray) -> FloatArray:
        """What errors that repeat add to predictions (n, distinct) at parameters z (n, p)."""
        return np.asarray(z[:, self.own :] @ self.slopes[:, self.own :].T)

    def at(self, predicted: FloatArray, z: FloatArray) -> FloatArray:
        """The chi-square (n,) of predictions (n, distinct) at parameters z (n, p)."""
        error = (self.value - predicted) / self.sd
        return np.asarray((error**2).sum(axis=1) + (z**2).sum(axis=1)) + self.scatter

    def log_likelihood(self, chi_square: FloatArray) -> FloatArray:
        """Of causes that leave `chi_square` (n,), relative to none at all.

        What the best of them leaves counts as noise.
        """
        rest = chi_square.min() / max(self.data - 2, 1)
        return np.asarray((self.total - chi_square) / (2 * max(rest, self.least_scale)))


@dataclass(frozen=True, eq=False)
class Change:
    """What a cause does at n places: `per_size` (n, distinct).

    `deviation` (n, distinct) is that of the data, as in Misfit, from what is expected without it.
    """

    deviation: FloatArray
    per_size: FloatArray
    largest: float

    def sizes(self, misfit: Misfit) -> FloatArray:
        """The likeliest sizes (n,), from 0 to the largest, the baseline's parameters free."""
        square = misfit.products(self.per_size, self.per_size)
        along = misfit.products(self.per_size, self.deviation)
        with np.errstate(over="ignore"):  # a cause that does nothing has no size
            sizes = along / np.maximum(square, np.finfo(float).tiny)
        return np.clip(sizes, 0.0, self.largest)

    def left(self, misfit: Misfit) -> FloatArray:
        """The chi-square (n,) that the likeliest sizes leave."""
        rest = self.deviation - self.sizes(misfit)[:, None] * self.per_size
        return misfit.products(rest, rest) + misfit.scatter

    def between(self, x_m: FloatArray, fine_m: FloatArray) -> Change:
        """The same at places between those tried, `x_m` (n,)."""
        deviation, per_size = scipy.interpolate.CubicSpline(
            x_m, [self.deviation, self.per_size], axis=1
        )(fine_m)
        return Change(deviation, per_size, self.largest)


def _distinct(design: Design, predicted: FloatArray) -> tuple[IntArray, IntArray]:
    """One row of each kind of datum, and of which kind each datum (data,) is."""
    masses = [each.added_mass for each in design.conditions]
    mass = np.array([masses.index(each) for each in masses])[design.frequency_test]
    mode = np.concatenate([np.arange(design.frequencies), design.shape_mode])
    none = np.full(design.frequencies, -1)
    keys = np.stack(
        [
            mass[mode],
            design.frequency_plane[mode],
            design.frequency_order[mode],
            np.concatenate([none, design.shape_place]),
            np.concatenate([none, design.shape_component]),
            predicted.round(10),
        ]
    )
    _, rows, kind = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    return rows, kind.ravel()
