"""The records of a test one after the other on one axis of time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.identify import Hit
from shm.report.contents import TestSheet
from shm.report.sheet.thinning import envelope_places
from shm.values import Channel, FloatArray, Recording

_BINS = 700
_GAP = 0.015
"""Between two records, as a share of their whole length."""


def offsets_s(records: Sequence[Recording]) -> list[float]:
    """Where each record begins on the common axis, in s."""
    whole = sum(record.duration_s for record in records)
    gap = _GAP * whole if len(records) > 1 else 0.0
    ends = np.cumsum([record.duration_s + gap for record in records])
    return [0.0, *ends[:-1].tolist()]


def borders_s(records: Sequence[Recording]) -> list[float]:
    """The middle of the gap between each two records on the common axis, in s."""
    starts = offsets_s(records)
    ends = [start + record.duration_s for start, record in zip(starts, records, strict=True)]
    return [(end + start) / 2 for end, start in zip(ends[:-1], starts[1:], strict=True)]


def hit_time_s(sheet: TestSheet, hit: Hit) -> float:
    """When a hit fell on the common axis, in s."""
    return offsets_s(sheet.recordings)[hit.record] + hit.start_s


def located_hits(sheet: TestSheet) -> list[tuple[int, Hit]]:
    """The hits whose records are at hand, each with its number from 1."""
    numbered = enumerate(sheet.hits, 1)
    return [(number, hit) for number, hit in numbered if hit.record < len(sheet.recordings)]


def channel_of(record: Recording, row: int | None) -> Channel | None:
    """The force (`row` None) or the acceleration of that row; None where it has none."""
    if row is None:
        return record.force
    return record.accelerations[row] if row < len(record.accelerations) else None


def thinned(records: Sequence[Recording], row: int | None) -> tuple[FloatArray, FloatArray]:
    """Time in s and values of one channel over all records, thinned by their envelope; both (m,).

    NaN where samples are, and between the records, so that a line drawn through them breaks.
    """
    whole = sum(record.duration_s for record in records)
    times, values = [], []
    for offset, record in zip(offsets_s(records), records, strict=True):
        channel = channel_of(record, row)
        if channel is not None and len(channel.values):
            bins = max(8, round(_BINS * record.duration_s / whole))
            places = envelope_places(channel.values, bins)
            times += [offset + places / record.sampling_rate_hz, np.array([np.nan])]
            values += [channel.values[places], np.array([np.nan])]
    return np.concatenate(times), np.concatenate(values)


def unknown_times_s(records: Sequence[Recording], row: int | None) -> FloatArray:
    """The middle of each bin with samples that are not a number, on the common axis, in s."""
    found: list[float] = []
    for offset, record in zip(offsets_s(records), records, strict=True):
        channel = channel_of(record, row)
        if channel is not None:
            bad = np.flatnonzero(np.isnan(channel.values))
            width = max(1, record.samples * len(records) // _BINS)
            found += (offset + np.unique(bad // width) * width / record.sampling_rate_hz).tolist()
    return np.array(found)
