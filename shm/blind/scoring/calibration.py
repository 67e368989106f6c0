"""Whether what is said with a probability of 0.7 is right in 70 of 100 cases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shm.blind.scoring.estimates import ENDS, Estimate, Estimator, Samples, resampled, share
from shm.values import NAN, Bin, FloatArray, Score

# Judgement: a share of 15 errs by up to 0.13 (1 sd); ten bins are what a reliability curve shows.
_IN_A_BIN, _MOST_BINS = 15, 10
# Technical: 5 % quantiles of 1000 draws err by 0.7 %, a share of 200 by 3.5 %.
_TRIALS, _PERFECT_TRIALS, _RESAMPLES = 1000, 200, 200


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
    rows = rng.integers(len(probability), size=(_RESAMPLES, len(probability)))
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
