"""CSV: `# key: value` lines, the names of the columns, then numbers.

    # hanger: 3
    # time: 2026-05-01T10:00:00Z
    # temperature_c: 12
    # sampling_rate_hz: 512
    # plane: , transverse, longitudinal
    # unit: N, m/s2, m/s2
    # x_m: 1.92, 2.52, 2.52
    force,acc_1,acc_2
    0.12,0.003,-0.001

What belongs to a column may also stand alone: `# acc_1.unit: g`. Columns may be separated by
commas, semicolons (then with decimal commas, if need be) or tabs. A first column `time`, in
seconds, is checked against the sampling rate, or gives it.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from shm.documents import format_time
from shm.errors import UsageError
from shm.read import assemble
from shm.read.atomic import replace_text
from shm.read.base import Format, Peek
from shm.read.comma_header import parse_heading
from shm.read.content import is_text, text_of
from shm.read.sidecar import with_sidecar
from shm.read.table import parse_table, rows_in
from shm.read.timebase import rate_of, without_time
from shm.read.units import SI
from shm.values import FrequencyResponse, Recording

_PLAIN = re.compile(r"[^,;\t\r\n#\"]+")


def _read(path: Path) -> Recording:
    heading = parse_heading(text_of(path), path)
    table = parse_table(heading, path)
    values, file_rate_hz = without_time(heading, table, path)
    return assemble.recording(with_sidecar(heading.header, path), values, path, file_rate_hz)


def _peek(path: Path) -> Peek:
    heading = parse_heading(text_of(path), path)
    rows = rows_in(heading.body)
    header = with_sidecar(heading.header, path)
    return assemble.peeked(
        header, FORMAT.name, rows, lambda: rate_of(heading, path), path, heading.remarks
    )


def _write(recording: Recording | FrequencyResponse, path: Path) -> None:
    if isinstance(recording, FrequencyResponse):
        raise UsageError(
            "CSV files hold recordings, not frequency responses.", remedy="Write a .uff file."
        )
    for channel in recording.channels:
        if not _PLAIN.fullmatch(channel.name):
            raise UsageError(
                f"the channel name {channel.name!r} cannot head a column.",
                remedy="Leave out commas, semicolons, quotes, # and line breaks.",
            )
    text = _heading_text(recording) + _body_text(recording)
    replace_text(path, text)


def _heading_text(recording: Recording) -> str:
    channels = recording.channels
    known = {
        "hanger": recording.hanger,
        "time": format_time(recording.time),
        "temperature_c": _number(recording.temperature_c),
        "sampling_rate_hz": _number(recording.sampling_rate_hz),
        "plane": ", ".join(channel.plane or "" for channel in channels),
        "unit": ", ".join(SI[channel.quantity] for channel in channels),
        "x_m": ", ".join(_number(channel.x_m) for channel in channels),
    }
    lines = [f"# {key}: {value}" for key, value in known.items() if value not in (None, "")]
    return "\n".join([*lines, ",".join(channel.name for channel in channels)]) + "\n"


def _number(value: float) -> str:
    return "" if math.isnan(value) else repr(float(value))


def _body_text(recording: Recording) -> str:
    """Rows of nine digits, one more than a 24-bit converter gives."""
    rows = np.column_stack([channel.values for channel in recording.channels])
    row = ",".join(["%.9g"] * rows.shape[1]) + "\n"
    return (row * len(rows)) % tuple(rows.ravel().tolist())


FORMAT = Format(
    name="CSV",
    suffixes=(".csv", ".txt", ".tsv"),
    recognises=is_text,
    peek=_peek,
    read=_read,
    write=_write,
    holds_gaps=True,
    holds_frequency_responses=False,
    needs_sidecar=False,
)
