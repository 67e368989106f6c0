"""What a score is: which cases it is asked of, what enters, and the bounds that it must keep.

Calibration asks whether what is said with a probability of 0.7 is right in 70 of 100 cases. The 90
% intervals are a bootstrap over the cases (Efron and Tibshirani 1993, 13.3).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
import scipy

from shm.values import MIX, NAN, Bin, CaseScore, FloatArray, MarkName, PlantedKind, Richness, Score

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


Asks = Callable[[CaseScore], bool]
Value = Callable[[CaseScore], float]

LEAST_PROBABILITY = 1e-4
"""No probability counts for less in the log score: a pair that was not tried has none."""
# Judgement, to the harm of who does not answer: a tension that is all wrong, next to no error that
# he could have shrunk, and a misfit that has grown tenfold.
_FAILED_PERCENT, _UNKNOWN_PERCENT, _FAILED_RATIO = 100.0, 0.01, 10.0


@dataclass(frozen=True)
class Bounds:
    """From where to where a score is right; infinite: no bound."""

    lower: float = -math.inf
    upper: float = math.inf


def at_least(lower: float) -> Bounds:
    return Bounds(lower=lower)


def at_most(upper: float) -> Bounds:
    return Bounds(upper=upper)


def every(bounds: Bounds) -> dict[Richness, Bounds]:
    """The same bounds at every richness."""
    return dict.fromkeys(get_args(Richness), bounds)


@dataclass(frozen=True)
class Question:
    """One score of the cases that `asks` lets through and whose planted size is above `above`.

    Cases without any effect have no size and are not held back by it. `samples` makes figures of
    the cases, `estimate` the score of the figures. `overall` bounds it over all cases, `each` by
    richness. `better` is the sign of what is better, and 0 where the way of a case is no matter.
    """

    name: MarkName
    asks: Asks
    samples: Callable[[Sequence[CaseScore]], Samples]
    estimate: Estimator
    overall: Bounds = Bounds()
    each: Mapping[Richness, Bounds] = field(default_factory=dict)
    better: Literal[-1, 0, 1] = 0
    above: float = 0.0
    round: Literal["first", "left out"] = "first"

    def of(self, cases: Sequence[CaseScore]) -> list[CaseScore]:
        """The cases that it is asked of."""
        large = [case for case in cases if case.kind == "none" or case.size > self.above]
        return [case for case in large if self.asks(case)]


def figures(*values: Value) -> Callable[[Sequence[CaseScore]], Samples]:
    """One array for each of `values`."""
    return lambda cases: tuple(
        np.array([float(value(case)) for case in cases], dtype=float) for value in values
    )


def mixed(value: Value) -> Callable[[Sequence[CaseScore]], Samples]:
    """Weights that restore the mix of kinds, and values; nothing where a kind is missing."""

    def samples(cases: Sequence[CaseScore]) -> Samples:
        counts = {kind: sum(case.kind == kind for case in cases) for kind in MIX}
        if not all(counts.values()):
            return np.zeros(0), np.zeros(0)
        weight = [MIX[case.kind] / counts[case.kind] for case in cases]
        return np.array(weight), np.array([value(case) for case in cases])

    return samples


def everything(case: CaseScore) -> bool:
    return True


def planted(case: CaseScore) -> bool:
    return case.kind != "none"


def known(case: CaseScore) -> bool:
    """Whether what was planted is in the catalogue."""
    return case.kind in ("one", "two")


def of_kind(kind: PlantedKind) -> Asks:
    return lambda case: case.kind == kind


def log_score(case: CaseScore) -> float:
    """In natural logarithms (Good 1952), 0 the best."""
    return -math.log(max(case.truth_probability, LEAST_PROBABILITY))


def leading(case: CaseScore) -> float:
    """The leading probability; a failure counts as a sure answer that is wrong."""
    return 1.0 if case.failure else case.leading_probability


def before_percent(case: CaseScore) -> float:
    """The error of the baseline's tension; next to none where it is unknown: no flattery."""
    error = case.tension_error_before
    return 100 * abs(error) if math.isfinite(error) else _UNKNOWN_PERCENT


def after_percent(case: CaseScore) -> float:
    """The error of the answer's tension; 100 where there is none."""
    error = case.tension_error_after
    return 100 * abs(error) if math.isfinite(error) else _FAILED_PERCENT


def held_out(case: CaseScore) -> float:
    """The ratio of held-out errors; ten times worse where the answer failed."""
    return _FAILED_RATIO if case.failure else case.held_out_ratio


# Judgement: a share of 15 errs by up to 0.13 (1 sd); ten bins are what a reliability curve shows.
_IN_A_BIN, _MOST_BINS = 15, 10
# Technical: 5 % quantiles of 1000 draws err by 0.7 %, a share of 200 by 3.5 %.
_TRIALS, _PERFECT_TRIALS, _RESAMPLES_A_TRIAL = 1000, 200, 200


def bins_of(cases: int) -> int:
    """How many bins: at least 15 cases in each, ten at most."""
    return max(1, min(_MOST_BINS, cases // _IN_A_BIN))


def calibration_error(probability: FloatArray, right: FloatArray, axis: int = -1) -> FloatArray:
    """Expected calibration error over bins of as many cases each, of samples (..., cases).

    The mean over the bins of how far the mean probability lies from the share that is right
    (Naeini, Cooper and Hauskrecht 2015; equal counts: Nguyen and O'Connor 2015).
    """
    probability, right = (np.moveaxis(each, axis, -1) for each in (probability, right))
    order = np.argsort(probability, axis=-1, kind="stable")
    excess = np.take_along_axis(probability - right, order, axis=-1)
    parts = np.array_split(excess, bins_of(excess.shape[-1]), axis=-1)
    off = np.stack([np.abs(part.sum(axis=-1)) for part in parts])
    return np.asarray(off.sum(axis=0) / excess.shape[-1])


counted = resampled(calibration_error)


def corrected(samples: Samples, rng: np.random.Generator) -> Estimate:
    """The calibration error of leading probabilities and whether they were right, less its bias.

    Few cases scatter about a perfect diagonal too, and all scatter counts as error: by the mean of
    the bootstrap the counted error lies too high (Efron and Tibshirani 1993, 10.2; of this error
    Kumar, Liang and Ma 2019). Nothing lies below 0.
    """
    found = counted(samples, rng)
    draws = np.maximum(0.0, 2 * found.score.value - found.draws)
    if len(draws) < 2:
        return found
    value = _less_bias(found.score.value, found.draws)
    low, high = (float(end) for end in np.quantile(draws, ENDS))
    return Estimate(replace(found.score, value=value, low=low, high=high), draws)


def _less_bias(value: float, draws: FloatArray) -> float:
    return max(0.0, 2 * value - float(draws.mean()))


def by_chance(samples: Samples, rng: np.random.Generator) -> Estimate:
    """What would be counted, on average and in 90 of 100 trials, were each probability just so."""
    probability = samples[0]
    if len(probability) == 0:
        return Estimate(Score(NAN), np.array([NAN]))
    right = rng.random((_TRIALS, len(probability))) < probability
    draws = calibration_error(np.broadcast_to(probability, right.shape), right.astype(float))
    low, high = (float(end) for end in np.quantile(draws, ENDS))
    return Estimate(Score(float(draws.mean()), low, high, len(probability)), draws)


def missed_if_perfect(most: float) -> Estimator:
    """In what share of trials a corrected error above `most` were found of perfect forecasts.

    Were each probability just so, as many cases would still scatter so far.
    """

    def estimate(samples: Samples, rng: np.random.Generator) -> Estimate:
        probability = samples[0]
        cases = len(probability)
        if cases < 2:
            return Estimate(Score(NAN), np.array([NAN]))
        errors = [_error_if_perfect(probability, rng) for _ in range(_PERFECT_TRIALS)]
        found = share((np.array([error > most for error in errors], dtype=float),), rng)
        return Estimate(replace(found.score, cases=cases), found.draws)

    return estimate


def _error_if_perfect(probability: FloatArray, rng: np.random.Generator) -> float:
    """The corrected error of one trial in which each probability is just so."""
    right = (rng.random(len(probability)) < probability).astype(float)
    rows = rng.integers(len(probability), size=(_RESAMPLES_A_TRIAL, len(probability)))
    draws = calibration_error(probability[rows], right[rows])
    return _less_bias(float(calibration_error(probability, right)), draws)


def reliability(samples: Samples, rng: np.random.Generator) -> tuple[Bin, ...]:
    """The share right by leading probability, in the bins over which the error is counted."""
    probability, right = samples
    order = np.argsort(probability, kind="stable")
    return tuple(
        Bin(
            float(probability[part[0]]),
            float(probability[part[-1]]),
            float(probability[part].mean()),
            share((right[part],), rng).score,
        )
        for part in np.array_split(order, bins_of(len(order)))
        if len(part)
    )
