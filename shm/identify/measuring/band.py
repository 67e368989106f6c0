"""Low-pass signals to the band and thin them; the exponentials in them stay what they are."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from shm.values import FloatArray

RATE_OVER_BAND = 2.56  # of any analyser: 1/2.56 of the rate is flat behind its anti-alias filter
_HALF_LENGTH = 16
"""Of the filter, in samples of its output: what folds into the band is 90 dB down."""
_KAISER_BETA = 9.0  # 0.1102 (90.4 dB - 8.7): J. F. Kaiser (1974)
LEAST_SAMPLES = 64  # judgement: 25 periods of the highest mode; fewer have no order to stabilise


def least_seconds(band_high_hz: float) -> float:
    """Return the shortest signal that leaves enough samples for an identification."""
    return (LEAST_SAMPLES + 4 * _HALF_LENGTH) / (RATE_OVER_BAND * band_high_hz)


def filter_reach(sampling_rate_hz: float, band_high_hz: float) -> tuple[int, Fraction]:
    """Return the reach of the filter of `band_limited` to either side, and the thinning.

    Models count their lags in samples: at a rate left twice as high as the band asks, they see half
    as long, and the modes of a long hanger's two planes are one to them.
    """
    eighths = int(8 * sampling_rate_hz // (RATE_OVER_BAND * band_high_hz))
    factor = Fraction(max(8, eighths), 8)
    return (math.ceil(_HALF_LENGTH * factor) if factor > 1 else 0), factor


def band_limited(
    signals: FloatArray, sampling_rate_hz: float, band_high_hz: float
) -> tuple[FloatArray, float]:
    """Return signals (channels, samples) at the lowest eighth of their rate that has the band.

    Only outputs for which the filter is completely inside the signal are used: there a finite
    filter turns a sum of exponentials into the same exponentials, so poles come out unchanged.
    """
    reach, factor = filter_reach(sampling_rate_hz, band_high_hz)
    if factor == 1:
        return signals, sampling_rate_hz
    rate_hz = sampling_rate_hz / float(factor)
    if signals.shape[-1] <= 2 * reach:
        return signals[..., :0], rate_hz
    parts = sliding_window_view(signals, 2 * reach + 1, axis=-1)
    limited = np.empty((*signals.shape[:-1], math.ceil(parts.shape[-2] / factor)))
    phases, step = factor.denominator, factor.numerator  # each phase falls on samples of the signal
    for phase in range(phases):
        begin, late = divmod(phase * step, phases)
        at = (np.arange(-reach, reach + 1.0) - late / phases) / float(factor)
        taps = np.sinc(at) * _kaiser(at) / float(factor)
        limited[..., phase::phases] = parts[..., begin::step, :] @ taps
    return limited, rate_hz


def _kaiser(at: FloatArray) -> FloatArray:
    """Return the window at places in samples of the output."""
    inside = np.maximum(1 - (at / _HALF_LENGTH) ** 2, 0.0)
    window = np.i0(_KAISER_BETA * np.sqrt(inside)) / np.i0(_KAISER_BETA)
    return np.where(np.abs(at) <= _HALF_LENGTH, window, 0.0)


def thinned(signals: FloatArray, sampling_rate_hz: float, wanted_rate_hz: float) -> FloatArray:
    """Return means of neighbouring samples, (channels, fewer samples), at the wanted rate or more.

    What folds back stays a sum of decaying sines, which is all that counts here.
    """
    factor = max(1, int(sampling_rate_hz / wanted_rate_hz))
    samples = signals.shape[1] // factor * factor
    parts = signals[:, :samples].reshape(len(signals), -1, factor)
    return np.asarray(parts.mean(axis=2))
