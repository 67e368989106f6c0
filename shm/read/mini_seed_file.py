"""miniSEED of seismic recorders, versions 2 and 3: channels by their SEED id, gaps as NaN.

A channel `XX_HGR3_00_HN1` is network, station, location and code, without those that are empty. Its
samples are counts, or numbers without a unit: what they are worth stands in a sidecar, `unit` with
`calibration`. The sampling rate and the time are the file's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read.base import Format, at_once
from shm.read.extras import import_extra
from shm.read.header import Entry
from shm.read.limits import guarded, refuse_large, refuse_many_samples
from shm.read.table import Column, Table
from shm.values import NAN, FloatArray

_NAME = "miniSEED"
_COUNTS = "counts"
_MOST_CHANNELS = 64  # judgement: four times what is read of a recording
_SAME_RATE = 1e-6  # technical: version 2 holds rates as single precision
_NS = 1e-9


@dataclass(frozen=True, eq=False)
class _Trace:
    """Samples without a gap; `start_ns` since 1970."""

    name: str
    start_ns: int
    sampling_rate_hz: float
    values: np.ndarray


def recognises(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a record of version 3, or of 2.

    A record of version 2 begins with its number as text, and its quality.
    """
    is_2 = head[:6].strip(b" \0").isdigit() and head[6:7] in b"DRQM" and head[7:8] in b" \0"
    return head[:3] == b"MS\x03" or (len(head) > 48 and is_2)


def open_tables(path: Path) -> tuple[Table, ...]:
    """Return the channels of a file on one grid of times; raises BadInput where it is damaged."""
    traces = _traces(path)
    rates = [trace.sampling_rate_hz for trace in traces]
    rate, start_ns = rates[0], min(trace.start_ns for trace in traces)
    if max(rates) - min(rates) > _SAME_RATE * rate:
        listed = ", ".join(f"{each:g}" for each in sorted(set(rates)))
        raise BadInput(
            f"the channels have different sampling rates ({listed}).",
            file=path,
            remedy="Export all channels of one recording with one rate.",
        )
    begins = [round((trace.start_ns - start_ns) * _NS * rate) for trace in traces]
    samples = max(b + len(trace.values) for b, trace in zip(begins, traces, strict=True))
    refuse_many_samples(samples, path)
    names = sorted({trace.name for trace in traces})
    refuse_large((samples, len(names)), 8, "", path)
    rows = {name: np.full(samples, NAN) for name in names}
    for begin, trace in zip(begins, traces, strict=True):
        _fill(rows[trace.name][begin : begin + len(trace.values)], trace.values)
    whole = {trace.name for trace in traces if trace.values.dtype.kind == "i"}
    columns = tuple(Column(n, samples, rows[n].copy, _COUNTS if n in whole else "") for n in names)
    start = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=start_ns // 1000)
    entries = {"time": Entry(start.isoformat(), path), "sampling_rate_hz": Entry(rate, path)}
    return (Table(path, columns, entries, (_NAME, *names)),)


def _fill(row: FloatArray, values: np.ndarray) -> None:
    """Fill a row with values where it has none, so that overlaps keep the earlier trace."""
    is_free = np.isnan(row)
    row[is_free] = values[is_free]


def _traces(path: Path) -> list[_Trace]:
    """Return all traces by time; nothing is unpacked before its size is known."""
    library = import_extra("pymseed", path)
    with guarded(path):
        counts: dict[str, int] = {}
        for record in library.MS3Record.from_file(str(path)):  # also finds a file that is cut off
            counts[record.sourceid] = counts.get(record.sourceid, 0) + record.samplecnt
    if not any(counts.values()) or len(counts) > _MOST_CHANNELS:
        raise BadInput(
            f"{len(counts)} channels hold {sum(counts.values())} samples.",
            file=path,
            remedy=f"Export 1 to {_MOST_CHANNELS} channels of one recording.",
        )
    refuse_many_samples(max(counts.values()), path)
    refuse_large((max(counts.values()), len(counts)), 8, "", path)
    with guarded(path), library.MS3TraceList.from_file(str(path), unpack_data=True) as traces:
        found = [
            _Trace(
                _name(library, each.sourceid),
                int(segment.starttime),
                float(segment.samprate),
                np.array(segment.np_datasamples),
            )
            for each in traces
            for segment in each
            if segment.sampletype in ("i", "f", "d") and segment.samprate > 0
        ]
    if not found:
        raise BadInput(
            "no channel holds numbers.", file=path, remedy="Export the channels of the sensors."
        )
    return sorted(found, key=lambda trace: trace.start_ns)


def _name(library: Any, source_id: str) -> str:
    try:
        parts: Sequence[str] = library.sourceid2nslc(source_id)
    except (ValueError, library.PymseedError):  # an id that no network has given out
        parts = [source_id.removeprefix("FDSN:")]
    return "_".join(part for part in parts if part).replace(".", "_").replace(":", "_")


FORMAT = Format(
    _NAME,
    (".mseed", ".miniseed", ".msd"),
    recognises,
    at_once(open_tables),
    library="pymseed",
)
