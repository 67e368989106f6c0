"""Check `clipping`: force or accelerations beyond what sensor and logger can record."""

from __future__ import annotations

import numpy as np

from shm.identify.contract import Hit
from shm.identify.measuring.faults import clipped, same_peaks
from shm.identify.measuring.hits import PULSE_SECONDS
from shm.identify.measuring.signal_faults import CLIPPED
from shm.identify.quality.inspection import Inspection
from shm.identify.quality.wording import channels_for, hits_for, hits_of, listed, places
from shm.values import Channel, QualityCheck

_PULSES = 5.0
"""So many times 6 ms hold the pulse of the softest tip."""


def check(inspection: Inspection) -> QualityCheck | None:
    """How many hits have a clipped signal.

    A clipped ring-down is left out. A clipped pulse is used: frequencies and damping come from
    after it; the frequency responses are off by what was cut.
    """
    if not hits_of(inspection):
        return None
    dropped = hits_for(inspection, (CLIPPED,))
    channels = channels_for(inspection, (CLIPPED,))
    pulses = _clipped_pulses(inspection)
    told = [
        *([f"left out: {listed([places(inspection, dropped)])}"] if dropped else []),
        *([f"left out: {listed(channels)}"] if channels else []),
        *(f"{name} is clipped in the pulse of {places(inspection, h)}" for name, h in pulses),
    ]
    if not told:
        return QualityCheck("clipping", "good", 0.0, 0.0, "", "no signal is clipped")
    struck = {(hit.record, hit.start) for _, hits in pulses for hit in hits}
    struck |= {(hit.record, hit.start) for hit in dropped}
    return QualityCheck(
        "clipping", "warning", float(max(len(struck), len(channels))), 0.0, "", "; ".join(told),
        "Set larger ranges of hammer and sensors in the logger, or hit more softly.",
    )  # fmt: skip


def _clipped_pulses(inspection: Inspection) -> list[tuple[str, list[Hit]]]:
    """Channels by name with the hits in whose pulses they are clipped."""
    found: dict[str, list[Hit]] = {}
    for measurement in inspection.measurements:
        hits = [hit for hit in measurement.hits if not hit.reason]
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
