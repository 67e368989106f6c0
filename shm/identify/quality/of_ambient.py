"""Check records without hits: unsteady, or drowned in noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from shm.identify.contract import Measurement
from shm.identify.measuring.ambient import LOUD, loudness
from shm.identify.quality.table import Inspection, Reading, Row
from shm.values import NAN, FloatArray, Recording

_UNSTEADY, _STRETCH_S = 2.5, 5.0
"""Loudest stretch over the median: in 36 records of steady wind up to 2.0, in 11 of 12 with trucks
above 3.5 (tests/worlds/recordings.py)."""
_LEAST_DB = 10.0
"""judgement: below, a mode's peak is hardly told from the chance of twenty spectra, 1 to 3 dB."""
_AROUND = 0.15  # of a frequency, to either side: where the floor beside a peak is looked for
_FLOOR = 0.2  # quantile of the spectrum there; neighbouring modes fill less than the rest
_SAME = 0.02  # judgement: half-power width of 1 % damping


def _stationarity(inspection: Inspection) -> Reading | None:
    """Return how much the loudest stretch is louder than the median, and what was set apart."""
    records = _ambient(inspection)
    value = max((_unrest(record) for record in records), default=NAN)
    if not records or np.isnan(value):
        return None
    apart = sum(d.count for m in inspection.measurements for d in m.dropped if d.reason == LOUD)
    more = f"; {apart} parts are set apart: {LOUD}" if apart else ""
    return Reading(value, {"more": more}, "warning" if apart else None)


def _signal_to_noise(inspection: Inspection) -> Reading | None:
    """Return the median height of the modes' peaks over the spectrum beside them, in dB."""
    if not _ambient(inspection) or inspection.finding is None or not inspection.finding.modes:
        return None
    spectra = [_spectrum(m) for m in inspection.measurements]
    heights = [
        max(_height_db(f, power, mode.frequency_hz) for f, power in spectra)
        for mode in inspection.finding.modes
    ]
    return Reading(float(np.median(heights)))


ROWS = (
    Row(
        "stationarity", _stationarity, _UNSTEADY, "",
        f"the loudest {_STRETCH_S:g} s move {{value:.1f}} times as much as the median{{more}}",
        f"the loudest {_STRETCH_S:g} s move {{value:.1f}} times as much as the median{{more}}",
        "Measure in steady wind without traffic, or longer.",
    ),
    Row(
        "peak height", _signal_to_noise, _LEAST_DB, "dB",
        "the modes' peaks stand {value:.0f} dB above the spectrum beside them",
        "the modes' peaks stand {value:.0f} dB above the spectrum beside them",
        "Measure in more wind, with quieter sensors, or hit the hanger.",
        is_least=True,
    ),
)  # fmt: skip


def _ambient(inspection: Inspection) -> Sequence[Recording]:
    """Return the records of a test without hits; empty for one with hits."""
    hit = any(m.hits or m.frequency_response is not None for m in inspection.measurements)
    return () if hit else inspection.records


def _unrest(record: Recording) -> float:
    """Return loudest over median stretch of a record; NaN where all have gaps."""
    signals = np.array([channel.values for channel in record.accelerations])
    count = int(_STRETCH_S * record.sampling_rate_hz)
    starts = range(0, signals.shape[1] - count + 1, count)
    level = np.array([loudness(signals[:, first : first + count]) for first in starts])
    known = level[np.isfinite(level)]
    return float(np.max(known) / np.median(known)) if len(known) else NAN


def _spectrum(measurement: Measurement) -> tuple[FloatArray, FloatArray]:
    """Return lines in Hz, and the power of all channels on them, equally weighted."""
    samples = min(part.shape[1] for part in measurement.decays)
    size = np.sqrt(np.mean([np.mean(p**2, axis=1) for p in measurement.decays], axis=0))
    weight = 1 / np.where(size > 0, size, 1.0)[:, np.newaxis]
    spectra = [
        scipy.signal.welch(part * weight, measurement.sampling_rate_hz, nperseg=samples)
        for part in measurement.decays
    ]
    power = np.mean([density.sum(axis=0) for _, density in spectra], axis=0)
    return np.asarray(spectra[0][0]), np.asarray(power)


def _height_db(frequency_hz: FloatArray, power: FloatArray, at_hz: float) -> float:
    """Return the height in dB of the peak at a frequency over the spectrum around it."""
    around = np.abs(frequency_hz / at_hz - 1) < _AROUND
    near = np.abs(frequency_hz - at_hz) <= max(1.5 * frequency_hz[1], _SAME / 2 * at_hz)
    floor = float(np.quantile(power[around], _FLOOR)) if around.any() else 0.0
    top = float(np.max(power[near], initial=0.0))
    return 10 * float(np.log10(top / floor)) if floor > 0 and top > 0 else NAN
