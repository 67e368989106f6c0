"""miniSEED of seismic recorders, versions 2 and 3: channels by their SEED id, gaps as NaN.

A channel `XX_HGR3_00_HN1` is network, station, location and code, without those that are empty. Its
samples are counts, or numbers without a unit: what they are worth stands in a sidecar, `unit` with
`calibration`. The sampling rate and the time are the file's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from shm.errors import BadInput
from shm.read import logger_text
from shm.read.base import Format, LoggerColumn, LoggerTable, Peek
from shm.read.limits import guarded, refuse_large, refuse_many_samples
from shm.read.logger_words import hanger_numbered
from shm.read.sidecar import sidecar_path
from shm.values import NAN, FloatArray, Recording

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
    """Whether the first bytes of a file are those of a record of version 3, or of 2: its number as
    text, and its quality.
    """
    is_2 = head[:6].strip(b" \0").isdigit() and head[6:7] in b"DRQM" and head[7:8] in b" \0"
    return head[:3] == b"MS\x03" or (len(head) > 48 and is_2)


def table_of(path: Path) -> LoggerTable:
    """The channels of a file on one grid of times; raises BadInput where it is damaged."""
    traces = _traces(path)
    rates = [trace.sampling_rate_hz for trace in traces]
    rate, start_ns = rates[0], min(trace.start_ns for trace in traces)
    if max(rates) - min(rates) > _SAME_RATE * rate:
        told = ", ".join(f"{each:g}" for each in sorted(set(rates)))
        raise BadInput(
            f"the channels have different sampling rates ({told}).",
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
    columns = tuple(LoggerColumn(n, _COUNTS if n in whole else "", rows[n]) for n in names)
    start = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=start_ns // 1000)
    hanger = hanger_numbered(path.stem)
    return LoggerTable(columns, rate, NAN, hanger, start, NAN, 0, (_NAME, *names), ())


def _fill(row: FloatArray, values: np.ndarray) -> None:
    """What is there twice is taken from what began first."""
    is_free = np.isnan(row)
    row[is_free] = values[is_free]


def _traces(path: Path) -> list[_Trace]:
    """All traces by time; nothing is unpacked before its size is known."""
    library = _library(path)
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


def _library(path: Path) -> Any:
    try:
        import pymseed
    except ImportError:
        raise BadInput(
            "miniSEED needs the extra `miniseed`, which is not installed.",
            file=path,
            remedy="Install it (pip install 'shm[miniseed]'), or export as CSV.",
        ) from None
    return pymseed


def _worthless(table: LoggerTable, path: Path) -> BadInput | None:
    """The refusal of a file of which nobody says what a count is worth."""
    header, used, _ = logger_text.header_of(table, path)
    names = [table.columns[place].name for place in used]
    units = {column.name: column.unit for column in table.columns}
    unknown = [
        name
        for name in names or units
        if name not in header.channels
        or (units[name] == _COUNTS and math.isnan(header.calibration(name)))
    ]
    if not unknown:
        return None
    what = units[unknown[0]] or "numbers without a unit"
    return BadInput(
        f"holds {what}, and nobody says what one is worth.",
        file=path,
        channel=unknown[0],
        remedy=f"Write into {sidecar_path(path).name}, or for all files of a stream into its "
        f'stream.toml: [channel.{unknown[0]}] with unit = "m/s2" and calibration = the m/s2 of '
        "one count (1 / the recorder's sensitivity).",
    )


def _read(path: Path) -> Recording:
    table = table_of(path)
    if (refusal := _worthless(table, path)) is not None:
        raise refusal
    return logger_text.recording(table, path)


def _peek(path: Path) -> Peek:
    table = table_of(path)
    found = logger_text.peeked(table, _NAME, path)
    refusal = _worthless(table, path)
    if refusal is None:
        return found
    return replace(found, problems=(*found.problems, str(refusal)))


FORMAT = Format(
    name=_NAME,
    suffixes=(".mseed", ".miniseed", ".msd"),
    recognises=recognises,
    peek=_peek,
    read=_read,
    holds_responses=False,
    names_channels=False,
    table=table_of,
    library="pymseed",
)
