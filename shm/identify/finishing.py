"""What a finding must still pass once an identifier has made it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.identify.contract import Dropped, Finding, FoundMode, Measurement
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

_LINES_AROUND = 4


def without_window(found: Finding, measurement: Measurement) -> Finding:
    """The finding with the damping of an exponential window taken off its damping ratios."""
    rate = 1 / measurement.decay_time_constant_s
    modes = tuple(
        replace(m, damping_ratio=m.damping_ratio - rate / (2 * math.pi * m.frequency_hz))
        for m in found.modes
    )
    return replace(found, modes=modes)


def coherent_only(found: Finding, measurement: Measurement, options: IdentifyOptions) -> Finding:
    """The finding without modes at which the measured coherence is low.

    Only for decays made from frequency responses: after hits, coherence also falls where a hit came
    before the last had rung down, which free decays do not mind.
    """
    response = measurement.frequency_response
    if measurement.hits or response is None or response.coherence is None:
        return found
    frequency_hz, coherence = response.frequency_hz, response.coherence
    good = [
        _coherence(mode, frequency_hz, coherence) >= options.min_coherence for mode in found.modes
    ]
    reason = f"coherence below {options.min_coherence:g}"
    dropped = tuple(
        Dropped(f"mode at {mode.frequency_hz:.4g} Hz", 1, reason)
        for mode, ok in zip(found.modes, good, strict=True)
        if not ok
    )
    modes = tuple(mode for mode, ok in zip(found.modes, good, strict=True) if ok)
    return replace(found, modes=modes, dropped=found.dropped + dropped)


def _coherence(mode: FoundMode, frequency_hz: FloatArray, coherence: FloatArray) -> float:
    """Median coherence over the points and the lines around a mode."""
    line = int(np.argmin(np.abs(frequency_hz - mode.frequency_hz)))
    near = coherence[:, max(0, line - _LINES_AROUND) : line + _LINES_AROUND + 1]
    return float(np.median(near))
