"""Many Kalman filters at once, each of which may take a reading for an outlier by itself.

A reading is good with probability 1 - p. An outlier says nothing of the state; it lies anywhere, by
a multivariate t distribution ten times as wide as a good one, or as if what may change had done so
for this test alone. The latter makes sure that no single reading speaks for a change by more than
2/p, of whatever size it is. After each reading the two cases are merged by their moments (Harrison
and Stevens 1976).

A change is of the size of a step in nine cases of ten, else of six. Its first reading tells which,
so that the two are one filter from then on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shm.values import FloatArray, IntArray
from shm.watch.sequential.design import Direction, Measurement

# Judgement: how an outlier lies (heavy tails: 2 degrees of freedom), and of what size a change is;
# see above. What may not be missed, a step of the size of the threshold, is the first.
_WIDER = 10.0
_TAIL = 2.0
_SIZES = np.array([1.0, 6.0])
_LOG_SHARES = np.log([0.9, 0.1])


@dataclass(frozen=True, eq=False)
class Filters:
    """States of B filters: `mean` (B, n) and `covariance` (B, n, n).

    The last q elements of a state are a change of each quantity, whose test-to-test scatter has the
    variances `scatter` (B, q); all in units of a step.
    """

    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray

    def __len__(self) -> int:
        return len(self.mean)

    def taken(self, rows: IntArray) -> Filters:
        """Some of them, in the order of `rows`."""
        return Filters(self.mean[rows], self.covariance[rows], self.scatter[rows])

    def with_more(self, other: Filters) -> Filters:
        """These, then the others."""
        return Filters(
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.covariance, other.covariance]),
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


@dataclass(frozen=True, eq=False)
class Sight:
    """How a reading sees the states of filters.

    `loadings` (q, n - q) say how the level of each quantity follows from the state without the
    change. Of the changes that may be, `directions`, each may be an outlier's, too.
    """

    loadings: FloatArray
    measurement: Measurement
    outlier_probability: float
    directions: tuple[Direction, ...]


def update(filters: Filters, progress: FloatArray, sight: Sight) -> Updated:
    """One reading into all filters; `progress` (B,) is how much of the change each has for done."""
    measurement, outlier_probability = sight.measurement, sight.outlier_probability
    if not len(measurement.values):
        return Updated(filters, np.zeros(len(filters)), np.full(len(filters), outlier_probability))
    seen = _innovation(filters, progress, sight)
    size = -(len(measurement.values) * math.log(2 * math.pi) + seen.log_det) / 2
    good = math.log1p(-outlier_probability) + size - seen.square / 2
    bad = math.log(outlier_probability) + _log_outlier(seen, size, sight)
    log_density = np.logaddexp(good, bad)
    weight = np.exp(good - log_density)
    return Updated(_moved(filters, seen, weight), log_density, 1 - weight)


def update_new(filters: Filters, prior: FloatArray, progress: FloatArray, sight: Sight) -> Updated:
    """The first reading into filters whose change begins with it.

    Its covariance is `prior` (B, q, q) by an unknown size.
    """
    by_size = [
        update(_of_size(filters, size**2 * prior), progress, sight) for size in _SIZES.tolist()
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
    return Updated(Filters(mean, covariance, filters.scatter), log_density, outlier)


def _of_size(filters: Filters, change: FloatArray) -> Filters:
    """The same, their change not yet known, of covariance `change` (B, q, q)."""
    known = filters.mean.shape[1] - change.shape[1]
    covariance = filters.covariance.copy()
    covariance[:, :, known:] = covariance[:, known:, :] = 0
    covariance[:, known:, known:] = change
    return Filters(filters.mean, covariance, filters.scatter)


def _innovation(filters: Filters, progress: FloatArray, sight: Sight) -> _Innovation:
    loadings, measurement = sight.loadings, sight.measurement
    q, known = loadings.shape
    done, covariance = progress[:, None, None], filters.covariance
    reached = covariance[:, :, :known] @ loadings.T + done * covariance[:, :, known:]
    level = loadings @ reached[:, :known] + done * reached[:, known:]
    level[:, range(q), range(q)] += filters.scatter
    if measurement.kelvin_sd > 0:
        level += measurement.kelvin_sd**2 * _per_kelvin_square(filters, measurement)
    mean = filters.mean[:, :known] @ loadings.T + progress[:, None] * filters.mean[:, known:]
    directions, d = measurement.directions, len(measurement.values)
    spread = np.swapaxes(level @ directions, 1, 2) @ directions
    spread[:, range(d), range(d)] += measurement.variances
    error = np.asarray(measurement.values - mean @ directions, dtype=np.float64)
    inverse = np.asarray(np.linalg.inv(spread), dtype=np.float64)
    log_det = np.asarray(np.linalg.slogdet(spread)[1], dtype=np.float64)
    reached = reached @ directions
    square: FloatArray = np.einsum("bi,bij,bj->b", error, inverse, error)
    return _Innovation(error, inverse, log_det, square, reached @ inverse, reached)


def _per_kelvin_square(filters: Filters, measurement: Measurement) -> FloatArray:
    """Mean of the outer product of what a kelvin does to the quantities (B, q, q)."""
    q = len(measurement.per_kelvin)
    mean = filters.mean[:, q : 2 * q] + measurement.per_kelvin
    return filters.covariance[:, q : 2 * q, q : 2 * q] + mean[:, :, None] * mean[:, None, :]


def _log_outlier(seen: _Innovation, size: FloatArray, sight: Sight) -> FloatArray:
    """Log density (B,) of a reading that is an outlier; `size` is a normal one's at its top."""
    d = seen.error.shape[1]
    constant = (
        math.lgamma((_TAIL + d) / 2)
        - math.lgamma(_TAIL / 2)
        + d / 2 * math.log(2 / _TAIL)
        - d * math.log(_WIDER)
    )
    anywhere = size + constant - (_TAIL + d) / 2 * np.log1p(seen.square / _TAIL / _WIDER**2)
    weighed = seen.inverse @ sight.measurement.directions.T
    along = (seen.error[:, None, :] @ weighed)[:, 0]
    lone = _log_lone(along, sight.measurement.directions @ weighed, sight.directions)
    either: FloatArray = np.logaddexp(anywhere, lone + size - seen.square / 2) - math.log(2)
    return either


def _log_lone(
    along: FloatArray, information: FloatArray, directions: Sequence[Direction]
) -> FloatArray:
    """Log of how much more likely (B,) a reading is if one of `directions` was its alone.

    `information` (B, q, q) is the reading's of all quantities, `along` (B, q) that by what was not
    expected.
    """
    factors = []
    for direction in directions:
        pull, precision = along @ direction.root, direction.root.T @ information @ direction.root
        factors += [
            share + _log_factor(size * pull, size**2 * precision)
            for size, share in zip(_SIZES, _LOG_SHARES, strict=True)
        ]
    mean: FloatArray = np.logaddexp.reduce(factors, axis=0) - math.log(len(directions))
    return mean


def _log_factor(pull: FloatArray, precision: FloatArray) -> FloatArray:
    """Log of exp(v' (I + M)^-1 v / 2) / sqrt(det(I + M)) with v `pull` (B, r), M `precision`.

    One latent variable after another, which is faster than inverses of many small matrices.
    """
    found = np.zeros(len(pull))
    for k in range(pull.shape[1]):
        grown = 1 + precision[:, k, k]
        found += (pull[:, k] ** 2 / grown - np.log(grown)) / 2
        column = precision[:, k]
        pull = pull - column * (pull[:, k] / grown)[:, None]
        precision = precision - column[:, :, None] * (column / grown[:, None])[:, None]
    return found


def _moved(filters: Filters, seen: _Innovation, weight: FloatArray) -> Filters:
    """States after the reading, good with probability `weight` (B,)."""
    pull = np.einsum("bnd,bd->bn", seen.gain, seen.error)
    unsure = np.sqrt(weight * (1 - weight))[:, None] * pull
    learnt = (weight[:, None, None] * seen.gain) @ np.swapaxes(seen.reached, 1, 2)
    return Filters(
        filters.mean + weight[:, None] * pull,
        filters.covariance - learnt + unsure[:, :, None] * unsure[:, None, :],
        filters.scatter,
    )
