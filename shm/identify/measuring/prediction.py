"""What no ring-down can do: jumps, bursts and gaps that its past does not foretell.

A ring-down is a sum of decaying sines, so each sample follows from the ones before it by one linear
rule (Prony). What does not follow came in on the way from the sensor to the file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import solve
from scipy.ndimage import median_filter
from scipy.signal import oaconvolve

from shm.values import FloatArray

_ORDER = 128
"""Two for each mode that a channel sees, aliased ones too; 64 left sound tests of long hangers with
errors 8 times those around them."""
_FIT_SAMPLES = 600
_BLOCK = 16
_AROUND = 25
_RIDGE = 1e-9


def thinned(signals: FloatArray, sampling_rate_hz: float, wanted_rate_hz: float) -> FloatArray:
    """Means of neighbouring samples, (channels, fewer samples), at no less than the wanted rate.

    What folds back stays a sum of decaying sines, which is all that counts here.
    """
    factor = max(1, int(sampling_rate_hz / wanted_rate_hz))
    samples = signals.shape[1] // factor * factor
    parts = signals[:, :samples].reshape(len(signals), -1, factor)
    return np.asarray(parts.mean(axis=2))


def surprise(ring_downs: Sequence[FloatArray]) -> FloatArray:
    """How far one channel's ring-downs, each (samples,), leave their rule at worst, (hits,).

    Largest error of the prediction in a block of 16 samples over the median of those of the blocks
    around it, or of those before it: what comes back slowly disturbs the blocks after it for long.
    NaN for a ring-down too short to tell.
    """
    long_enough = [part for part in ring_downs if len(part) >= 2 * _ORDER]
    if not long_enough:
        return np.full(len(ring_downs), np.nan)
    rule = _rule(long_enough)
    return np.array([_worst(part, rule) for part in ring_downs])


def _rule(parts: Sequence[FloatArray]) -> FloatArray:
    """Coefficients (1 + order,) that annihilate the parts, by least squares over all of them."""
    rows = np.vstack([sliding_window_view(part[:_FIT_SAMPLES], _ORDER + 1) for part in parts])
    past, now = rows[:, :-1], rows[:, -1]
    square = past.T @ past
    square += _RIDGE * float(np.trace(square)) / _ORDER * np.eye(_ORDER)
    weights = solve(square, past.T @ now, assume_a="pos")
    return np.concatenate(([1.0], -weights[::-1]))


def _worst(part: FloatArray, rule: FloatArray) -> float:
    if len(part) < 2 * _ORDER:
        return float("nan")
    error = np.abs(oaconvolve(part, rule, mode="valid"))
    peaks = error[: len(error) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).max(axis=1)
    width = min(_AROUND, len(peaks))
    around = median_filter(peaks, width)
    usual = around.copy()
    late = width // 2 + 1
    usual[late:] = np.minimum(around[late:], around[:-late])
    return float(np.max(peaks / np.maximum(usual, np.finfo(float).tiny)))
