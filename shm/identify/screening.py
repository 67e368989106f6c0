"""Which hits and channels of a set-up can be used: nothing bad gets through to an identifier.

A double hit, a ring-down cut off or with a not-a-number sample, a dead channel: each is left out
and counted with its reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import NotIdentifiable
from shm.identify.bandlimit import least_seconds
from shm.identify.contract import Dropped, Hit
from shm.identify.hits import HitRecord, find_pulses
from shm.identify.options import IdentifyOptions
from shm.values import Channel, FloatArray, Recording

_LEAST_SHARE_OF_LONGEST = 0.25


@dataclass(frozen=True, eq=False)
class Screening:
    """All `hits`; the ring-downs of the `used` ones, with the accelerations of `rows` alone."""

    hits: tuple[Hit, ...]
    used: tuple[HitRecord, ...]
    rows: tuple[int, ...]
    dropped: tuple[Dropped, ...]


def screened(records: Sequence[Recording], options: IdentifyOptions) -> Screening:
    """What can be used of records of one set-up; raises NotIdentifiable where nothing can."""
    hits, ring_downs = _hits(records)
    rows, dropped = _usable_channels(records, ring_downs)
    ring_downs = [replace(r, accelerations=r.accelerations[rows]) for r in ring_downs]
    reasons = _reasons(ring_downs, records[0].sampling_rate_hz, options)
    used = [ring_down for ring_down, reason in zip(ring_downs, reasons, strict=True) if not reason]
    if not used or not rows:
        raise _nothing_left(records, reasons, dropped)
    judged = [
        replace(hit, used=not reason, reason=reason)
        for hit, reason in zip(hits, reasons, strict=True)
    ]
    return Screening(tuple(judged), tuple(used), tuple(rows), dropped + _counted(reasons))


def _hits(records: Sequence[Recording]) -> tuple[list[Hit], list[HitRecord]]:
    """Each hit of each record, as a row of the result and with its signals."""
    hits, ring_downs = [], []
    for index, record in enumerate(records):
        force = record.force
        assert force is not None
        accelerations = np.array([channel.values for channel in record.accelerations])
        for pulse in find_pulses(force.values, record.sampling_rate_hz):
            start_s = pulse.start / record.sampling_rate_hz
            hits.append(Hit(index, pulse.start, start_s, pulse.peak_force_n))
            ring_downs.append(HitRecord(force.values, accelerations, pulse))
    return hits, ring_downs


def _usable_channels(
    records: Sequence[Recording], ring_downs: Sequence[HitRecord]
) -> tuple[list[int], tuple[Dropped, ...]]:
    """Rows of the accelerations that can be used, and those that cannot with the reason."""
    channels = records[0].accelerations
    some_plane = any(channel.plane for channel in channels)
    rows, dropped = [], []
    for row, channel in enumerate(channels):
        reason = _channel_fault(channel, row, ring_downs, some_plane)
        if reason:
            dropped.append(Dropped(f"channel {channel.name}", 1, reason))
        else:
            rows.append(row)
    return rows, tuple(dropped)


def _channel_fault(
    channel: Channel, row: int, ring_downs: Sequence[HitRecord], some_plane: bool
) -> str:
    cuts = [_cut(ring_down)[row] for ring_down in ring_downs]
    bad = [not np.all(np.isfinite(cut)) for cut in cuts]
    if 2 * sum(bad) > len(cuts):
        return "not-a-number samples after more than half of the hits"
    if cuts and all(np.ptp(cut) == 0 for cut, is_bad in zip(cuts, bad, strict=True) if not is_bad):
        return "its value never changes: dead sensor or cable"
    if some_plane and channel.plane is None:
        return "its plane is not stated, those of others are"
    return ""


def _cut(ring_down: HitRecord) -> FloatArray:
    """Accelerations from the hit to the end of its ring-down, (channels, samples)."""
    return ring_down.accelerations[:, ring_down.pulse.start : ring_down.pulse.stop]


def _reasons(
    ring_downs: Sequence[HitRecord], sampling_rate_hz: float, options: IdentifyOptions
) -> list[str]:
    """Why each hit cannot be used; empty where it can."""
    longest = max((r.pulse.stop - r.pulse.end for r in ring_downs), default=0)
    return [_hit_fault(r, longest, sampling_rate_hz, options) for r in ring_downs]


def _hit_fault(
    ring_down: HitRecord, longest: int, sampling_rate_hz: float, options: IdentifyOptions
) -> str:
    pulse = ring_down.pulse
    force = ring_down.force[pulse.start : pulse.stop]
    if not (np.all(np.isfinite(force)) and np.all(np.isfinite(_cut(ring_down)))):
        return "not-a-number samples"
    if pulse.second_peak > 0:
        return "double hit"
    least = max(
        least_seconds(options.band_high_hz) * sampling_rate_hz, _LEAST_SHARE_OF_LONGEST * longest
    )
    if pulse.stop - pulse.end < least:
        return "ring-down cut off"
    return ""


def _counted(reasons: Sequence[str]) -> tuple[Dropped, ...]:
    counts = Counter(reason for reason in reasons if reason)
    return tuple(Dropped("hits", count, reason) for reason, count in counts.items())


def _nothing_left(
    records: Sequence[Recording], reasons: Sequence[str], dropped: Sequence[Dropped]
) -> NotIdentifiable:
    if not reasons:
        what = "no hammer hit stands out of the force signal."
    elif all(reasons):
        what = f"no hit can be used: {_listed(_counted(reasons))}."
    else:
        what = f"no acceleration channel can be used: {_listed(dropped)}."
    return NotIdentifiable(
        what,
        file=records[0].source,
        channel=records[0].force.name if records[0].force and not reasons else "",
        remedy="Check hammer and sensor cables, and measure again.",
    )


def _listed(dropped: Sequence[Dropped]) -> str:
    return ", ".join(f"{entry.count} {entry.what} ({entry.reason})" for entry in dropped)
