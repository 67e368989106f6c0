"""Low-passes and thins ring-downs to the band; the exponentials in them stay what they are."""

from __future__ import annotations

import numpy as np
from scipy.signal import firwin, upfirdn

from shm.values import FloatArray

RATE_OVER_BAND = 2.56
_HALF_LENGTH = 16
"""Of the filter, in samples of its output: what folds into the band is 90 dB down."""
_KAISER_BETA = 9.0
_LEAST_SAMPLES = 64


def least_seconds(band_high_hz: float) -> float:
    """The shortest signal that leaves enough samples for an identification."""
    return (_LEAST_SAMPLES + 4 * _HALF_LENGTH) / (RATE_OVER_BAND * band_high_hz)


def filter_reach(sampling_rate_hz: float, band_high_hz: float) -> tuple[int, int]:
    """How many samples the filter of `band_limited` reaches to either side, and the thinning."""
    factor = max(1, int(sampling_rate_hz // (RATE_OVER_BAND * band_high_hz)))
    return (_HALF_LENGTH * factor if factor > 1 else 0), factor


def band_limited(
    signals: FloatArray, sampling_rate_hz: float, band_high_hz: float
) -> tuple[FloatArray, float]:
    """Signals (channels, samples) at the lowest whole fraction of their rate that holds the band.

    Only outputs for which the filter lies wholly inside the signal are kept: there a finite filter
    turns a sum of exponentials into the same exponentials, so poles come out unchanged.
    """
    reach, factor = filter_reach(sampling_rate_hz, band_high_hz)
    if factor < 2:
        return signals, sampling_rate_hz
    taps = firwin(2 * reach + 1, 1 / factor, window=("kaiser", _KAISER_BETA))
    filtered = np.asarray(upfirdn(taps, signals, down=factor, axis=-1))
    last = (signals.shape[-1] - 1) // factor
    return filtered[..., 2 * _HALF_LENGTH : last + 1], sampling_rate_hz / factor
