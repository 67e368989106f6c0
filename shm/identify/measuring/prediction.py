"""Detect jumps, bursts and gaps in ring-downs by linear prediction.

A ring-down is a sum of decaying sines, so each sample follows from the ones before it by one linear
rule (Prony). What does not follow came in on the way from the sensor to the file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from shm.values import FloatArray

_ORDER = 128
"""Two for each mode that a channel sees, aliased ones too; 64 left sound tests of long hangers with
errors 8 times those around them."""
# judgement: four rows a coefficient from each hit; a fault shorter than a block is still seen, and
# 25 blocks about it tell what is usual
_FIT_SAMPLES = 600
_BLOCK = 16
_AROUND = 25
_RIDGE = 1e-9  # judgement: 90 dB below the signal, beneath the noise of recordings


def surprise(ring_downs: Sequence[FloatArray]) -> FloatArray:
    """Return the largest prediction error of one channel's ring-downs, each (samples,): (hits,).

    Largest error of the prediction in a block of 16 samples over the median of those of the
    blocks around it, or of those before it: what comes back slowly disturbs the blocks after it
    for long. NaN for a ring-down too short to tell.
    """
    long_enough = [part for part in ring_downs if len(part) >= 2 * _ORDER]
    if not long_enough:
        return np.full(len(ring_downs), np.nan)
    rule = prediction_rule(long_enough)
    return np.array([_worst(part, rule) for part in ring_downs])


def knocked_at(ring_downs: Sequence[FloatArray], number: int, limit: float) -> int:
    """Return the sample before which no surprise in ring-down `number` is above `limit`.

    Each ring-down is (channels, samples).
    """
    blocks = []
    for row, part in enumerate(ring_downs[number]):
        every = [ring[row] for ring in ring_downs if ring.shape[1] >= 2 * _ORDER]
        error = _relative_error(part, prediction_rule(every))
        blocks.append(int(np.argmax(error > limit)))
    return max(0, int(np.median(blocks)) - 1) * _BLOCK + _ORDER


def prediction_rule(parts: Sequence[FloatArray]) -> FloatArray:
    """Return coefficients (1 + order,) that annihilate the parts, by least squares over all."""
    rows = np.vstack([sliding_window_view(part[:_FIT_SAMPLES], _ORDER + 1) for part in parts])
    rows = rows[np.isfinite(rows).all(axis=1)]  # lost samples of a hit leave the rule to the others
    past, now = rows[:, :-1], rows[:, -1]
    square = past.T @ past
    if not square.any():  # no motion at all, which the rule of no coefficients predicts
        return np.asarray(np.eye(1, 1 + _ORDER)[0])
    square += _RIDGE * float(np.trace(square)) / _ORDER * np.eye(_ORDER)
    weights = scipy.linalg.solve(square, past.T @ now, assume_a="pos")
    return np.concatenate(([1.0], -weights[::-1]))


def _worst(part: FloatArray, rule: FloatArray) -> float:
    if len(part) < 2 * _ORDER:
        return float("nan")
    return float(np.max(_relative_error(part, rule)))


def _relative_error(part: FloatArray, rule: FloatArray) -> FloatArray:
    """Return the largest prediction error of each block over its usual size, (blocks,)."""
    error = np.abs(np.convolve(part, rule, mode="valid"))
    peaks = error[: len(error) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).max(axis=1)
    width = min(_AROUND, len(peaks))
    around = scipy.ndimage.median_filter(peaks, width)
    usual = around.copy()
    late = width // 2 + 1
    usual[late:] = np.minimum(around[late:], around[:-late])
    return np.asarray(peaks / np.maximum(usual, np.finfo(float).tiny))
