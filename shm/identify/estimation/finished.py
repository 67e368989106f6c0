"""What a finding must still pass once an identifier has made it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.identify.contract import Dropped, Finding, FoundMode, Measurement
from shm.identify.estimation.amplitude_dependence import with_amplitude_dependence
from shm.identify.measuring.recorded_window import recorded_window_rate
from shm.identify.options import IdentifyOptions
from shm.values import FloatArray

_LINES_AROUND = 4  # judgement: nine lines have a median that one bad line does not move


def finished(found: Finding, measurement: Measurement, options: IdentifyOptions) -> Finding:
    """The finding without the window's damping and incoherent modes, with how frequencies depend on
    the amplitude."""
    found = coherent_only(without_window(found, measurement), measurement, options)
    return _unsure_of_damping(with_amplitude_dependence(found, measurement), measurement)


def _unsure_of_damping(found: Finding, measurement: Measurement) -> Finding:
    """The finding with what an analyser's window may add to its damping as an uncertainty."""
    rate = recorded_window_rate(measurement)
    modes = tuple(
        replace(m, damping_sd=math.hypot(m.damping_sd, rate / (2 * math.pi * m.frequency_hz)))
        for m in found.modes
    )
    return replace(found, modes=modes) if rate else found


def without_window(found: Finding, measurement: Measurement) -> Finding:
    """The finding with the damping of an exponential window taken off its damping ratios."""
    rate = 1 / measurement.decay_time_constant_s
    modes, doubtful = (
        tuple(
            replace(m, damping_ratio=m.damping_ratio - rate / (2 * math.pi * m.frequency_hz))
            for m in each
        )
        for each in (found.modes, found.doubtful)
    )
    return replace(found, modes=modes, doubtful=doubtful)


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
