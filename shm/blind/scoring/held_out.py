"""How well an answer predicts what it did not see, beside the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.values import NAN, FloatArray, Residual, TrueFrequency

_TO_NORMAL = 1.4826
"""From the median of absolute errors to their standard deviation, were they normal."""


def held_out_ratio(where: Sequence[Residual], truth: Sequence[TrueFrequency]) -> float:
    """Root mean square error of held-out predictions of the true frequencies, after over before.

    1 where no cause was claimed: nothing has shrunk. NaN where nothing was held out, and where the
    baseline predicts better than was measured (by the median error, which blunders leave alone).
    """
    true_hz = {(each.test, each.plane, each.order): each.frequency_hz for each in truth}
    held = [
        (residual, true_hz[place])
        for residual in where
        if (place := (residual.test, residual.plane, residual.order)) in true_hz
        and math.isfinite(residual.held_out_before_percent)
    ]
    if not held:
        return NAN
    measured = np.array([residual.measured_hz / hz for residual, hz in held])
    before = _error(measured, [residual.held_out_before_percent for residual, _ in held])
    after = _error(measured, [residual.held_out_after_percent for residual, _ in held])
    if _rms(before) <= _TO_NORMAL * float(np.median(np.abs(measured - 1))):
        return NAN
    both = np.isfinite(after)
    return _rms(after[both]) / _rms(before[both]) if both.any() else 1.0


def _error(measured: FloatArray, percent: Sequence[float]) -> FloatArray:
    """Of predictions, as fractions of the truth, from measured over truth and over predicted."""
    return np.asarray(measured / (1 + np.array(percent) / 100) - 1)


def _rms(error: FloatArray) -> float:
    return float(np.sqrt(np.mean(error**2)))
