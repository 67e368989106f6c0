"""Finds hits in the accelerations alone: taps with a mallet, a rope that is cut.

A hit makes the motion several times larger from one instant to the next. Wind and traffic do not:
their swells last seconds, and where modes beat, the motion was as large a quarter of a second ago.
"""

from __future__ import annotations

import numpy as np
import scipy

from shm.identify.measuring.band import RATE_OVER_BAND, thinned
from shm.identify.measuring.hits import (
    GROUP_SECONDS,
    PULSE_SECONDS,
    RINGING_SAMPLES,
    Pulse,
    grouped,
)
from shm.values import NAN, FloatArray

_WINDOW_SECONDS = 0.04
"""Long enough for a period of some modes of the band, short beside any ring-down."""
_BEFORE_SECONDS = 0.25
"""Modes that beat fall and rise again within it, or hardly rise beyond it."""
_RISE = 6.0
"""Of the power. recordings_trial.py: wind and trucks reach 3.2 in 21 records, taps and releases 10
and more, but for weak ones in the ring-down of a strong one."""


def find_unforced(
    accelerations: FloatArray, sampling_rate_hz: float, band_hz: float
) -> list[Pulse]:
    """Find the hits in `accelerations` (channels, samples), of unknown force; may be empty.

    Impacts within half a second are one hit that ends with the last one.
    """
    power, step = _power(accelerations, sampling_rate_hz, band_hz)
    rise = _rises(power, sampling_rate_hz / step)
    width = int(_WINDOW_SECONDS * sampling_rate_hz / step)
    tops = np.flatnonzero(
        (rise == scipy.ndimage.maximum_filter1d(rise, 2 * width + 1)) & (rise > _RISE)
    )
    # The window that follows holds the blow, where the fast motion is largest.
    onsets = [(top + int(np.argmax(power[top : top + width + 2]))) * step for top in tops.tolist()]
    groups = grouped(onsets, GROUP_SECONDS * sampling_rate_hz)
    if not groups:
        return []
    margin = int(PULSE_SECONDS * sampling_rate_hz) + RINGING_SAMPLES
    over = 2 * step + int(PULSE_SECONDS * sampling_rate_hz) + RINGING_SAMPLES // 2
    samples = accelerations.shape[1]
    starts = [max(0, group[0] - 2 * step - margin) for group in groups]
    stops = [*(start - margin for start in starts[1:]), samples]
    ends = [min(group[-1] + over, samples) for group in groups]
    return [
        Pulse(start, group[0], end, stop, NAN)
        for start, group, end, stop in zip(starts, groups, ends, stops, strict=True)
        if end < stop
    ]


def _power(
    accelerations: FloatArray, sampling_rate_hz: float, band_hz: float
) -> tuple[FloatArray, int]:
    """Return the relative power of the fast motion over all channels (thinned samples,)."""
    wanted = RATE_OVER_BAND * band_hz
    step = max(1, int(sampling_rate_hz / wanted))
    slow = np.nan_to_num(thinned(accelerations, sampling_rate_hz, wanted))
    fast = np.diff(slow, axis=1, prepend=slow[:, :1])
    envelope = np.abs(scipy.signal.hilbert(fast, axis=1)) ** 2
    usual = np.median(envelope, axis=1, keepdims=True)
    moving = usual[:, 0] > 0
    if not np.any(moving):
        return np.zeros(slow.shape[1]), step
    return np.asarray(np.mean(envelope[moving] / usual[moving], axis=0)), step


def _rises(power: FloatArray, rate_hz: float) -> FloatArray:
    """Return power of the window after each sample over the largest of the windows before it."""
    window = max(2, int(_WINDOW_SECONDS * rate_hz))
    if len(power) < 2 * window:
        return np.zeros(len(power))
    mean = np.convolve(power, np.full(window, 1 / window), mode="valid")
    usual = float(np.median(power))
    after = np.concatenate((mean, np.zeros(window - 1)))
    before = np.concatenate((np.full(window, usual), mean[: len(power) - window]))
    reach = max(1, int(_BEFORE_SECONDS * rate_hz))
    largest = scipy.ndimage.maximum_filter1d(before, reach, origin=(reach - 1) // 2)
    return after / np.maximum(largest, np.finfo(float).tiny)
