"""Scores with their 90 % intervals: bootstrap over the cases (Efron and Tibshirani 1993, 13.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from shm.values import NAN, FloatArray, Score

Samples = tuple[FloatArray, ...]
"""Figures of the same cases, each (cases,)."""

CONFIDENCE = 0.9  # as all intervals of ours
ENDS = (1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2
_RESAMPLES = 1000  # technical: 5 % quantiles of 1000 draws err by 0.7 %


@dataclass(frozen=True, eq=False)
class Estimate:
    """A score and the values (draws,) that other cases of the same kind might have given."""

    score: Score
    draws: FloatArray


Estimator = Callable[[Samples, np.random.Generator], Estimate]


def resampled(statistic: Callable[..., FloatArray]) -> Estimator:
    """Estimates a statistic of samples whose last axis are the cases; it takes `axis`.

    One case has no interval, none has no value.
    """

    def estimate(samples: Samples, rng: np.random.Generator) -> Estimate:
        cases = len(samples[0])
        value = float(statistic(*samples, axis=-1)) if cases else NAN
        if cases < 2:
            return Estimate(Score(value, cases=cases), np.array([value]))
        found = scipy.stats.bootstrap(
            samples,
            statistic,
            n_resamples=_RESAMPLES,
            paired=True,
            vectorized=True,
            confidence_level=CONFIDENCE,
            method="percentile",
            rng=rng,
        )
        low, high = (float(end) for end in found.confidence_interval)
        return Estimate(Score(value, low, high, cases), found.bootstrap_distribution)

    return estimate


def _median_ratio(after: FloatArray, before: FloatArray, axis: int = -1) -> FloatArray:
    return np.asarray(np.median(after, axis=axis) / np.median(before, axis=axis))


def _weighed_sum(weight: FloatArray, values: FloatArray, axis: int = -1) -> FloatArray:
    """Of weights that sum to 1 over the cases; of a resample they do so only about."""
    return np.asarray((weight * values).sum(axis=axis) / weight.sum(axis=axis))


median = resampled(np.median)
ratio_of_medians = resampled(_median_ratio)
weighed_mean = resampled(_weighed_sum)
_mean = resampled(np.mean)


def share(samples: Samples, rng: np.random.Generator) -> Estimate:
    """The share of ones.

    Where all cases agree a bootstrap has no width; Jeffreys' interval stands there instead.
    """
    (flags,) = samples
    found = _mean(samples, rng)
    if len(flags) == 0 or np.ptp(flags) > 0:
        return found
    hits = float(flags.sum())
    low, high = (
        float(scipy.stats.beta.ppf(end, hits + 0.5, len(flags) - hits + 0.5)) for end in ENDS
    )
    ends = (low, 1.0) if hits else (0.0, high)
    return Estimate(Score(found.score.value, *ends, len(flags)), found.draws)


def difference(one: Estimate, other: Estimate) -> Score:
    """One score less another of other cases; its cases are those of the smaller."""
    draws = min(len(one.draws), len(other.draws))
    low, high = np.quantile(one.draws[:draws] - other.draws[:draws], ENDS)
    cases = min(one.score.cases, other.score.cases)
    return Score(one.score.value - other.score.value, float(low), float(high), cases)
