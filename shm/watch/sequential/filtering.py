"""Many Kalman filters at once, each of which may take a reading for an outlier by itself.

A reading is good with probability 1 - p. An outlier says nothing of the state; it lies anywhere, by
a multivariate t distribution ten times as wide as a good one, or as if one quantity had changed for
this test alone. The latter makes sure that no single reading speaks for a change by more than 2/p,
of whatever size it is. After each reading the two cases are merged by their moments (Harrison and
Stevens 1976).

A change is of the size of a step in nine cases of ten, else of six. Its first reading tells which,
so that the two are one filter from then on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray, IntArray
from shm.watch.sequential.measurement import Measurement

_WIDER = 10.0
_TAIL = 2.0
_SIZES = np.array([1.0, 6.0])
_LOG_SHARES = np.log([0.9, 0.1])


@dataclass(frozen=True, eq=False)
class Filters:
    """States of B filters: `mean` (B, n) and `covariance` (B, n, n).

    The last element of a state is a change of the one `quantity` (B,), whose test-to-test scatter
    has the variances `scatter` (B, q); all in units of a step.
    """

    mean: FloatArray
    covariance: FloatArray
    quantity: IntArray
    scatter: FloatArray

    def __len__(self) -> int:
        return len(self.mean)

    def taken(self, rows: IntArray) -> Filters:
        """Some of them, in the order of `rows`."""
        return Filters(
            self.mean[rows], self.covariance[rows], self.quantity[rows], self.scatter[rows]
        )

    def with_more(self, other: Filters) -> Filters:
        """These, then the others."""
        return Filters(
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.covariance, other.covariance]),
            np.concatenate([self.quantity, other.quantity]),
            np.concatenate([self.scatter, other.scatter]),
        )


@dataclass(frozen=True, eq=False)
class Updated:
    """Filters after a reading, its log predictive density (B,) and probability of an outlier."""

    filters: Filters
    log_density: FloatArray
    outlier: FloatArray


@dataclass(frozen=True, eq=False)
class _Innovation:
    """What a reading says that was not expected: `error` (B, d), `inverse` (B, d, d) of its
    covariance, whose log determinant is `log_det` (B,), `square` (B,) its Mahalanobis length
    squared, and `gain` (B, n, d) into the state; `reached` (B, n, d) covariance with the state."""

    error: FloatArray
    inverse: FloatArray
    log_det: FloatArray
    square: FloatArray
    gain: FloatArray
    reached: FloatArray


def update(
    filters: Filters,
    loadings: FloatArray,
    progress: FloatArray,
    measurement: Measurement,
    outlier_probability: float,
) -> Updated:
    """One reading into all filters.

    `loadings` (q, n - 1) say how the level of each quantity follows from the state without its last
    element, `progress` (B,) how much of the change each filter takes for done.
    """
    if not len(measurement.values):
        return Updated(filters, np.zeros(len(filters)), np.full(len(filters), outlier_probability))
    seen = _innovation(filters, loadings, progress, measurement)
    size = -(len(measurement.values) * math.log(2 * math.pi) + seen.log_det) / 2
    good = math.log1p(-outlier_probability) + size - seen.square / 2
    bad = math.log(outlier_probability) + _log_outlier(seen, size, measurement.directions)
    log_density = np.logaddexp(good, bad)
    weight = np.exp(good - log_density)
    return Updated(_moved(filters, seen, weight), log_density, 1 - weight)


def update_new(
    filters: Filters,
    loadings: FloatArray,
    progress: FloatArray,
    measurement: Measurement,
    outlier_probability: float,
) -> Updated:
    """The first reading into filters whose change begins with it and is of unknown size."""
    by_size = [
        update(_of_size(filters, size), loadings, progress, measurement, outlier_probability)
        for size in _SIZES.tolist()
    ]
    joint = _LOG_SHARES[:, None] + np.array([each.log_density for each in by_size])
    log_density = np.logaddexp.reduce(joint, axis=0)
    weights = np.exp(joint - log_density)
    means = np.array([each.filters.mean for each in by_size])
    covariances = np.array([each.filters.covariance for each in by_size])
    mean = np.einsum("sb,sbn->bn", weights, means)
    apart = means - mean
    covariance = np.einsum("sb,sbij->bij", weights, covariances)
    covariance += np.einsum("sb,sbi,sbj->bij", weights, apart, apart)
    outlier = np.einsum("sb,sb->b", weights, np.array([each.outlier for each in by_size]))
    merged = Filters(mean, covariance, filters.quantity, filters.scatter)
    return Updated(merged, log_density, outlier)


def _of_size(filters: Filters, size: float) -> Filters:
    """The same, their change not yet known, of standard deviation `size`."""
    covariance = filters.covariance.copy()
    covariance[:, :, -1] = covariance[:, -1, :] = 0
    covariance[:, -1, -1] = size**2
    return Filters(filters.mean, covariance, filters.quantity, filters.scatter)


def _innovation(
    filters: Filters, loadings: FloatArray, progress: FloatArray, measurement: Measurement
) -> _Innovation:
    rows, n, q = np.arange(len(filters)), loadings.shape[1], len(loadings)
    covariance, quantity = filters.covariance, filters.quantity
    reached = covariance[:, :, :n] @ loadings.T
    reached[rows, :, quantity] += progress[:, None] * covariance[:, :, n]
    level = loadings @ reached[:, :n]
    level[rows, quantity] += progress[:, None] * reached[:, n]
    level[:, range(q), range(q)] += filters.scatter
    if measurement.kelvin_sd > 0:
        level += measurement.kelvin_sd**2 * _coefficient_square(filters, q)
    mean = filters.mean[:, :n] @ loadings.T
    mean[rows, quantity] += progress * filters.mean[:, n]
    directions, d = measurement.directions, len(measurement.values)
    spread = np.swapaxes(level @ directions, 1, 2) @ directions
    spread[:, range(d), range(d)] += measurement.variances
    error = np.asarray(measurement.values - mean @ directions, dtype=np.float64)
    inverse = np.asarray(np.linalg.inv(spread), dtype=np.float64)
    log_det = np.asarray(np.linalg.slogdet(spread)[1], dtype=np.float64)
    reached = reached @ directions
    square: FloatArray = np.einsum("bi,bij,bj->b", error, inverse, error)
    return _Innovation(error, inverse, log_det, square, reached @ inverse, reached)


def _coefficient_square(filters: Filters, q: int) -> FloatArray:
    """Mean of the outer product of the temperature coefficients (B, q, q)."""
    mean = filters.mean[:, q : 2 * q]
    return filters.covariance[:, q : 2 * q, q : 2 * q] + mean[:, :, None] * mean[:, None, :]


def _log_outlier(seen: _Innovation, size: FloatArray, directions: FloatArray) -> FloatArray:
    """Log density (B,) of a reading that is an outlier; `size` is a normal one's at its top."""
    d, q = seen.error.shape[1], len(directions)
    constant = (
        math.lgamma((_TAIL + d) / 2)
        - math.lgamma(_TAIL / 2)
        + d / 2 * math.log(2 / _TAIL)
        - d * math.log(_WIDER)
    )
    anywhere = size + constant - (_TAIL + d) / 2 * np.log1p(seen.square / _TAIL / _WIDER**2)
    weighed = seen.inverse @ directions.T
    along = (seen.error[:, None, :] @ weighed)[:, 0]
    seen_alone = np.einsum("qd,bdq->bq", directions, weighed)
    grown = 1 + _SIZES[:, None, None] ** 2 * seen_alone
    gained = along**2 * _SIZES[:, None, None] ** 2 / grown
    lone = _LOG_SHARES[:, None, None] + (gained - np.log(grown)) / 2
    lone_mean = np.logaddexp.reduce(lone, axis=(0, 2)) - math.log(q) + size - seen.square / 2
    either: FloatArray = np.logaddexp(anywhere, lone_mean) - math.log(2)
    return either


def _moved(filters: Filters, seen: _Innovation, weight: FloatArray) -> Filters:
    """States after the reading, good with probability `weight` (B,)."""
    pull = np.einsum("bnd,bd->bn", seen.gain, seen.error)
    unsure = np.sqrt(weight * (1 - weight))[:, None] * pull
    learnt = (weight[:, None, None] * seen.gain) @ np.swapaxes(seen.reached, 1, 2)
    return Filters(
        filters.mean + weight[:, None] * pull,
        filters.covariance - learnt + unsure[:, :, None] * unsure[:, None, :],
        filters.quantity,
        filters.scatter,
    )
