"""Check the signals: clipped, jumping, silent, doubled or noisy channels, missing samples."""

from __future__ import annotations

import numpy as np

from shm.identify.contract import Hit, Measurement
from shm.identify.measuring.hits import PULSE_SECONDS, RINGING_SAMPLES
from shm.identify.measuring.signal_faults import (
    CABLE,
    CLIPPED,
    COPY,
    DEAD,
    FROZEN,
    HITS_NOT_SHOWN,
    NOT_A_NUMBER,
    SILENT,
    WANDERS,
    clipped,
    same_peaks,
)
from shm.identify.quality.table import (
    Inspection,
    Reading,
    Row,
    channels_for,
    fault_reading,
    hits_for,
    hits_of,
    places,
)
from shm.values import NAN, Channel, FloatArray, Recording
from shm.values.rounding import listed

_PULSES = 5.0
"""So many times 6 ms hold the pulse of the softest tip."""
_REFUSED_DB = 6.0
"""Two half-second stretches of one noise differ by 1.2 dB (a band of 100 Hz has 50 independent
values in each); the best of 16 channels, over the quietest of several stretches, by up to 4."""
_WARNING_DB = 20.0  # from there the benchmark counts a mode as one to be found
_STILL_DB = 1.0  # judgement: where the noise is not seen before a hit, so little is none at all
_MOST_DB = 200.0
"""More than any converter resolves: what stands higher is computed, not measured."""
# judgement: lines of 2 Hz, so that the lowest mode is seen; a fifth still tells loud from quiet
_STRETCH_S = 0.5
_LEAST_STRETCH_S, _LEAST_SAMPLES = 0.1, 32


def _units(inspection: Inspection) -> Reading | None:
    """Return how many channels have a unit that nothing states; None where all state theirs."""
    channels = [channel for record in inspection.records for channel in record.channels]
    silent = sorted({channel.name for channel in channels if not channel.states_unit})
    return Reading(len(silent), {"channels": listed(silent)}) if silent else None


def _clipping(inspection: Inspection) -> Reading | None:
    """Return how many hits have a clipped signal.

    A ring-down that is clipped at first is used from where it is not. A clipped pulse is used:
    frequencies and damping come from after it; the frequency responses are off by what was cut.
    """
    if not hits_of(inspection):
        return None
    dropped = hits_for(inspection, (CLIPPED,))
    channels = channels_for(inspection, (CLIPPED,))
    late = [hit for hit in hits_of(inspection) if hit.cut.startswith(CLIPPED)]
    clipped_channels = sorted({hit.cut.removeprefix(f"{CLIPPED}: ") for hit in late})
    pulses = _clipped_pulses(inspection)
    texts = [
        *([f"left out: {listed([places(inspection, dropped)])}"] if dropped else []),
        *([f"left out: {listed(channels)}"] if channels else []),
        *(
            [
                f"{' and '.join(clipped_channels)} clipped: {places(inspection, late)} used from "
                "after that, frequency responses are not right"
            ]
            if late
            else []
        ),
        *(f"{name} is clipped in the pulse of {places(inspection, h)}" for name, h in pulses),
    ]
    hits_affected = {(hit.record, hit.start) for _, hits in pulses for hit in hits}
    hits_affected |= {(hit.record, hit.start) for hit in (*dropped, *late)}
    return Reading(max(len(hits_affected), len(channels)), {"faults": "; ".join(texts)})


def _clipped_pulses(inspection: Inspection) -> list[tuple[str, list[Hit]]]:
    """Return channels by name with the hits in whose pulses they are clipped."""
    found: dict[str, list[Hit]] = {}
    for measurement in inspection.measurements:
        hits = [hit for hit in measurement.hits if hit.used and not hit.cut]
        if not hits:
            continue
        first = inspection.records[hits[0].record]
        for row, channel in enumerate(first.channels):
            for hit, bad in zip(hits, _clipped_hits(inspection, hits, row, channel), strict=True):
                if bad:
                    found.setdefault(channel.name, []).append(hit)
    return list(found.items())


def _clipped_hits(
    inspection: Inspection, hits: list[Hit], row: int, channel: Channel
) -> list[bool]:
    parts = []
    for hit in hits:
        record = inspection.records[hit.record]
        stop = hit.start + int(_PULSES * PULSE_SECONDS * record.sampling_rate_hz) + 1
        parts.append(record.channels[row].values[hit.start : stop])
    found = clipped(parts, channel.full_scale)
    if channel.quantity == "force" and not np.isfinite(channel.full_scale):
        found |= same_peaks(parts) | same_peaks([-part for part in parts])
    return [bool(bad) for bad in found]


def _cable(inspection: Inspection) -> Reading | None:
    return fault_reading(inspection, (CABLE, COPY, DEAD, SILENT, WANDERS, HITS_NOT_SHOWN))


def _drop_outs(inspection: Inspection) -> Reading | None:
    return fault_reading(inspection, (NOT_A_NUMBER, FROZEN))


def _noise(inspection: Inspection) -> Reading | None:
    """Return the vibration right after a hit over the quietest of what is recorded without one.

    In dB, in the band, of the channel that shows it best, median over the used hits. Quiet is the
    time before the first hit of a record or the end of a ring-down.
    """
    if not hits_of(inspection):
        return None
    results = [_ratios_db(m, inspection) for m in inspection.measurements]
    value = max((db for db, _ in results), default=NAN)
    seen_before = any(before for _, before in results)
    if value >= _WARNING_DB:
        return Reading(value)
    if value < (_REFUSED_DB if seen_before else _STILL_DB):
        return Reading(
            value, {}, "refused", _REFUSED_DB,
            "after a hit the sensors show hardly more than the noise before it",
            "Check that the sensors are fixed to this hanger, connected and set to the right "
            "range; hit harder, and when no machine runs.",
        )  # fmt: skip
    if not seen_before:
        return Reading(
            NAN, verdict="unknown",
            found="nothing is recorded before the hits, and they still ring at the end",
            remedy="Record half a second before the first hit.",
        )  # fmt: skip
    return Reading(value)


UNITS = Row(
    "units", _units, 0.0, "", "",
    "neither file nor sidecar states the unit of {channels}: N and m/s2 were assumed",
    "State the unit of each channel in the file's sidecar, or once for this logger by "
    "`shm import FILE`.",
)  # fmt: skip
CLIPPING = Row(
    "clipping", _clipping, 0.0, "", "no signal is clipped", "{faults}",
    "Set larger ranges of hammer and sensors in the logger, or hit more softly.",
)  # fmt: skip
CABLES = Row(
    "cable", _cable, 0.0, "", "no channel jumps, wanders or is silent", "{faults}",
    "Reseat the connectors of these channels, tie the cables down, exchange a cable that stays "
    "bad, and repeat these hits; if all channels are named, check the logger's clock.",
)  # fmt: skip
DROP_OUTS = Row(
    "drop-outs", _drop_outs, 0.0, "", "no sample is missing", "{faults}",
    "Check the logger's memory card or radio link and its load, and repeat these hits.",
)  # fmt: skip
NOISE = Row(
    "noise", _noise, _WARNING_DB, "dB",
    "the ring-down begins {value:.0f} dB above the noise",
    "the ring-down begins {value:.0f} dB above the noise",
    "Hit harder, or measure when wind and traffic are low; fix loose sensors.",
    is_least=True,
)  # fmt: skip


def _ratios_db(measurement: Measurement, inspection: Inspection) -> tuple[float, bool]:
    """Return the signal to noise of a set-up's best channel, and whether noise was measured.

    Noise is measured in the time before a hit.
    """
    after, quiet, before = [], [], False
    by_record: dict[int, list[int]] = {}
    for hit in measurement.hits:
        by_record.setdefault(hit.record, []).append(hit.start)
    used = {(hit.record, hit.start) for hit in measurement.hits if hit.used}
    for number, starts in by_record.items():
        record = inspection.records[number]
        gap = RINGING_SAMPLES + int(0.01 * record.sampling_rate_hz)
        ends = [*(start - gap for start in starts[1:]), record.samples]
        for start, end in zip(starts, ends, strict=True):
            half = start + (end - start) // 2
            quiet.append(_power(record, half, end, inspection, last=True))
            if (number, start) in used:
                after.append(_power(record, start + gap, half, inspection))
        lead = _power(record, 0, starts[0] - gap, inspection, last=True)
        before = before or lead is not None
        quiet.append(lead)
    loud = [power for power in after if power is not None]
    still = [power for power in quiet if power is not None]
    if not loud or not still:
        return NAN, before
    signal = np.median(loud, axis=0)
    known = np.isfinite(signal) & np.isfinite(still).any(axis=0)
    if not known.any():
        return NAN, before
    signal, quietest = signal[known], np.nanmin(np.array(still)[:, known], axis=0)
    noise = np.maximum(quietest, signal * 10 ** (-_MOST_DB / 10))
    ratio = signal / np.maximum(noise, np.finfo(float).tiny)
    return float(10 * np.log10(max(float(np.max(ratio)), 1e-30))), before


def _power(
    record: Recording, first: int, stop: int, inspection: Inspection, *, last: bool = False
) -> FloatArray | None:
    """Return the mean square in the band of the first or last 0.5 s of a stretch, (channels,).

    A tone is no noise: it is told by itself, and hides no mode but one at its frequency.
    """
    rate, options = record.sampling_rate_hz, inspection.options
    length = min(stop - first, int(_STRETCH_S * rate))
    if length < max(_LEAST_STRETCH_S * rate, _LEAST_SAMPLES):
        return None
    begin = stop - length if last else first
    cut = np.array([c.values[begin : begin + length] for c in record.accelerations])
    window = np.hanning(length)
    spectrum = np.fft.rfft((cut - cut.mean(axis=1, keepdims=True)) * window, axis=1)
    frequency = np.fft.rfftfreq(length, 1 / rate)
    lines = (frequency >= options.band_low_hz) & (frequency <= options.band_high_hz)
    for tone in inspection.tones:
        lines &= np.abs(frequency - tone.frequency_hz) > 2 * rate / length  # half a line of Hann's
    return np.asarray(np.sum(np.abs(spectrum[:, lines]) ** 2, axis=1) / np.sum(window**2) / length)
