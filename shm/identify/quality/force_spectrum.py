"""Check `force spectrum`: does the hammer's tip reach the upper end of the band?"""

from __future__ import annotations

import numpy as np

from shm.identify.contract import Hit
from shm.identify.measuring.hits import PULSE_SECONDS, RINGING_SAMPLES
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import hits_of
from shm.values import FloatArray, QualityCheck

_LIMIT_DB = -20.0
"""Usual in impact testing (Ewins 2000, 3.4): a tenth of the force still excites."""
_LONGEST_PULSE_S = 0.05
_TRANSFORM_S = 1.0


def check(inspection: Inspection) -> QualityCheck | None:
    """Force at the band's upper end over its largest in the band, in dB, median over the hits."""
    used = [hit for hit in hits_of(inspection) if hit.used]
    if not used:
        return None
    high = inspection.options.band_high_hz
    curves = [_spectrum_db(inspection, hit) for hit in used]
    # A zero between lobes of the spectrum is as bad as its end: the lowest value counts.
    ends = [float(np.min(db)) for _, db in curves]
    value = float(np.median(ends))
    if value >= _LIMIT_DB:
        found = f"the force reaches {high:g} Hz"
        return QualityCheck("force spectrum", "good", value, _LIMIT_DB, "dB", found)
    reach = float(np.median([f[np.argmax(db < _LIMIT_DB)] if np.any(db < _LIMIT_DB) else f[-1]
                             for f, db in curves]))  # fmt: skip
    return QualityCheck(
        "force spectrum", "warning", value, _LIMIT_DB, "dB",
        f"the force reaches {reach:.0f} Hz; modes above may be missed or uncertain",
        f"Use a harder tip, or look for modes up to {reach:.0f} Hz only.",
    )  # fmt: skip


def _spectrum_db(inspection: Inspection, hit: Hit) -> tuple[FloatArray, FloatArray]:
    """Frequencies (lines,) in the band and the pulse's level at them over its largest, in dB."""
    record, options = inspection.records[hit.record], inspection.options
    force, rate = record.force, record.sampling_rate_hz
    assert force is not None
    first = max(0, hit.start - RINGING_SAMPLES)
    stop = hit.start + int(_LONGEST_PULSE_S * rate)
    cut = force.values[first : stop + 1] - np.median(force.values[first : hit.start + int(rate)])
    fade = np.ones(len(cut))
    tail = int(PULSE_SECONDS * rate)
    fade[len(cut) - tail :] = np.linspace(1, 0, tail)
    length = max(len(cut), int(_TRANSFORM_S * rate))
    level = np.abs(np.fft.rfft(cut * fade, n=length))
    frequency = np.fft.rfftfreq(length, 1 / rate)
    lines = (frequency >= options.band_low_hz) & (frequency <= options.band_high_hz)
    top = max(float(level[lines].max(initial=0.0)), np.finfo(float).tiny)
    decibels = 20 * np.log10(np.maximum(level[lines] / top, 1e-6))
    return np.asarray(frequency[lines]), np.asarray(decibels)
