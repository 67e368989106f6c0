"""Frequencies that state no standard deviation and were rounded: to which step, and what that adds.

A step is the same number of Hz for all modes, so that low ones are much less exact than high ones.
Frequencies rounded to one number, as of both planes, err alike: they are one datum and not two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.gap.contract import Observations
from shm.values import FloatArray, ModalTest, Mode

# Six digits are more than anybody rounds to; a number of full precision is a multiple, to so much
# of it, by chance of one in 500.
_FINEST_HZ, _TO = 1e-6, 1e-3
_COARSEST_HZ = 1.0  # judgement: what is coarser was not rounded; a step is a part of this
_FEWEST = 3  # distinct ones: chance makes the step of three twice as coarse in 1 of 8


def step_hz(test: ModalTest) -> float:
    """What all frequencies of a test without a standard deviation are multiples of; 0 for none."""
    finest = {mode.frequency_hz / _FINEST_HZ for mode in test.modes if _is_bare(mode)}
    if len(finest) < _FEWEST or any(abs(each - round(each)) > _TO for each in finest):
        return 0.0
    return _FINEST_HZ * math.gcd(*map(round, finest), round(_COARSEST_HZ / _FINEST_HZ))


def rounding_sds(tests: Sequence[ModalTest]) -> FloatArray:
    """Of the logarithm of each frequency (F,) in the tests' order: step / sqrt(12) over it."""
    return np.array(
        [
            step / math.sqrt(12) / mode.frequency_hz if _is_bare(mode) else 0.0
            for test in tests
            for step in [step_hz(test)]
            for mode in test.modes
        ]
    )


def rounding_covariance(observations: Observations) -> FloatArray:
    """Covariance (F, F) that rounding adds.

    The mean of k equal numbers errs as one of them does, and what was equal before rounding to
    within a step apart may differ by as much as two that were rounded independently.
    """
    count = observations.design.frequencies
    if observations.rounding is None:
        return np.zeros((count, count))
    value, sd = observations.value[:count], observations.rounding
    equal = np.equal.outer(value, value)
    shared = equal * (1 - 1 / equal.sum(axis=1))
    return np.asarray(np.outer(sd, sd) * (np.eye(count) + shared))


def told_of_rounding(tests: Sequence[ModalTest]) -> str:
    """The coarsest rounding, in words."""
    steps = [(step_hz(test), test) for test in tests]
    step, test = max(steps, key=lambda pair: pair[0])
    if not step:
        return ""
    lowest = min(mode.frequency_hz for mode in test.modes if _is_bare(mode))
    return (
        f"The frequencies of test {test.id} are rounded to {step:g} Hz: errors of "
        f"{100 * step / math.sqrt(12) / lowest:.2g} % of the lowest are expected from that alone. "
        "Give them with more digits."
    )


def _is_bare(mode: Mode) -> bool:
    return not mode.frequency_sd_hz > 0
