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
seconds, is checked against the sampling rate, or gives it. Any other heading is understood as
`logger_text` says.

A first column `frequency` makes it frequency responses, with real and imaginary parts:

    frequency,low_real,low_imaginary,low_coherence,high_real,high_imaginary,high_coherence
    0,0.12,0,0.99,0.05,0,0.98

Columns of coherence may be missing. An analyser's export is read too: free lines before the names
(Frequency, Real, Imaginary), and one of units between names and numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from shm.documents import format_time
from shm.errors import BadInput, UsageError
from shm.read import assemble, logger_text
from shm.read.atomic import replace_text
from shm.read.base import Format, LoggerColumn, LoggerTable, Peek, names_in
from shm.read.comma_table import (
    LINE_BREAK,
    REMEDY,
    Heading,
    cells_of,
    evened,
    header_of,
    is_number,
    mark_between,
    parse_heading,
    parse_table,
    rate_of,
    refuse_long_heading,
    rows_in,
)
from shm.read.content import is_text, text_of
from shm.read.header import Entry, Header, mass_entries
from shm.read.logger_words import ACCELERANCE, SI
from shm.read.sidecar import with_sidecar
from shm.values import NAN, Channel, FloatArray, FrequencyResponse, Recording, ResponsePoint

_PLAIN = re.compile(r"[^,;\t\r\n#\"]+")


def _read(path: Path) -> Recording | FrequencyResponse:
    return read_text(text_of(path), path)


def read_text(text: str, path: Path, preamble: Sequence[str] = ()) -> Recording | FrequencyResponse:
    """What a text holds, with lines that a workbook says elsewhere; raises BadInput."""
    responses = responses_in(text, path)
    if responses is not None:
        return _read_responses(responses, path)
    logged = None if logger_text.is_ours(text) else logger_text.parse(text, path, preamble)
    if logged is not None:
        return logger_text.recording(logged, path)
    heading = parse_heading(text, path)
    table, rate = parse_table(heading, path), NAN
    if heading.has_time:
        table, rate = evened(table[0], table[1:], lambda *fault: _uneven(heading, path, *fault))
    return assemble.recording(with_sidecar(heading.header, path), table, path, rate)


def _peek(path: Path) -> Peek:
    return peek_text(text_of(path), FORMAT.name, path)


def peek_text(text: str, file_format: str, path: Path, preamble: Sequence[str] = ()) -> Peek:
    """What the heading of a text says; faults become problems."""
    responses = responses_in(text, path)
    if responses is not None:
        return _peek_responses(responses, file_format, path)
    logged = None if logger_text.is_ours(text) else logger_text.parse(text, path, preamble)
    if logged is not None:
        return logger_text.peeked(logged, file_format, path)
    heading = parse_heading(text, path)
    rows = rows_in(heading.body)
    header = with_sidecar(heading.header, path)
    return assemble.peeked(
        header, file_format, rows, lambda: _rate(heading, path), path, heading.remarks
    )


def _table(path: Path) -> LoggerTable | None:
    return table_of_text(text_of(path), path)


def table_of_text(text: str, path: Path, preamble: Sequence[str] = ()) -> LoggerTable | None:
    """All columns of a text; None for frequency responses, and where there are no numbers."""
    if responses_in(text, path) is not None:
        return None
    if not logger_text.is_ours(text):
        return logger_text.parse(text, path, preamble)
    heading = parse_heading(text, path)
    rows = parse_table(heading, path)
    names = heading.columns[1:] if heading.has_time else heading.columns
    units = (heading.header.channels[name].get("unit") for name in names)
    columns = tuple(
        LoggerColumn(name, unit.text if unit else "", row)
        for name, unit, row in zip(names, units, rows[heading.has_time :], strict=True)
    )
    rate, said = _rate(heading, path), heading.header.sampling_rate_hz
    layout = ("shm", *names)
    return LoggerTable(
        columns, said, rate, heading.header.hanger, None, NAN, 0, layout, heading.remarks, False
    )


def _rate(heading: Heading, path: Path) -> float:
    """The rate that a column of times tells, NaN without one; raises BadInput where faulty."""
    if not heading.has_time:
        return NAN
    times = parse_table(heading, path)[0]
    return rate_of(times, lambda *fault: _uneven(heading, path, *fault))


def _uneven(heading: Heading, path: Path, row: int, what: str) -> BadInput:
    line, column = heading.body_line + row, heading.columns[0]
    return BadInput(f"{what}.", file=path, channel=column, line=line, remedy=REMEDY)


def _write(described: Recording | FrequencyResponse, path: Path) -> None:
    for name in names_in(described):
        if not _PLAIN.fullmatch(name):
            raise UsageError(
                f"the channel name {name!r} cannot head a column.",
                remedy="Leave out commas, semicolons, quotes, # and line breaks.",
            )
    if isinstance(described, FrequencyResponse):
        replace_text(path, response_text(described))
    else:
        replace_text(path, recording_text(described))


FORMAT = Format(
    name="CSV",
    suffixes=(".csv", ".txt", ".tsv", ".asc", ".dat", ".lvm", ".prn", ".xls"),
    recognises=is_text,
    peek=_peek,
    read=_read,
    write=_write,
    may_be_gzipped=True,
    table=_table,
)


def recording_text(recording: Recording) -> str:
    """Rows of nine digits, one more than a 24-bit converter gives."""
    channels = recording.channels
    known = {
        "sampling_rate_hz": _number(recording.sampling_rate_hz),
        **_places(channels),
        "unit": ", ".join(SI[c.quantity] if c.states_unit else "" for c in channels),
        "full_scale": _list([channel.full_scale for channel in channels]),
    }
    names = [channel.name for channel in channels]
    rows = np.column_stack([channel.values for channel in channels])
    return _heading(recording, known, names) + _body(rows, "%.9g")


def response_text(response: FrequencyResponse) -> str:
    """A column of frequencies, then of each point real and imaginary part and coherence."""
    names, columns = ["frequency"], [response.frequency_hz]
    for row, point in enumerate(response.points):
        parts = {
            "real": response.accelerance[row].real,
            "imaginary": response.accelerance[row].imag,
        }
        if response.coherence is not None:
            parts["coherence"] = response.coherence[row]
        names += [f"{point.name}_{part}" for part in parts]
        columns += list(parts.values())
    unit = ", ".join([ACCELERANCE] * len(response.points))
    known = {**_places(response.points), "unit": unit}
    return _heading(response, known, names) + _body(np.column_stack(columns), "%.15g")


def _heading(
    described: Recording | FrequencyResponse, more: dict[str, str], names: Sequence[str]
) -> str:
    known = {
        "hanger": described.hanger,
        "time": format_time(described.time),
        "temperature_c": _number(described.temperature_c),
        **{key: _number(value) for key, value in mass_entries(described.added_mass).items()},
        **more,
    }
    lines = [f"# {key}: {value}" for key, value in known.items() if value not in (None, "")]
    return "\n".join([*lines, ",".join(names)]) + "\n"


def _places(points: Sequence[Channel] | Sequence[ResponsePoint]) -> dict[str, str]:
    planes = [point.plane or "" for point in points]
    return {
        "plane": ", ".join(planes) if any(planes) else "",
        "x_m": _list([point.x_m for point in points]),
    }


def _list(values: Sequence[float]) -> str:
    """One value a column; nothing where none is known."""
    return "" if all(map(math.isnan, values)) else ", ".join(map(_number, values))


def _number(value: float) -> str:
    return "" if math.isnan(value) else repr(float(value))


def _body(rows: FloatArray, digits: str) -> str:
    row = ",".join([digits] * rows.shape[1]) + "\n"
    return (row * len(rows)) % tuple(rows.ravel().tolist())


_Part = Literal["real", "imaginary", "coherence"]
_PARTS: dict[str, _Part] = {
    "real": "real", "re": "real", "imaginary": "imaginary", "imag": "imaginary", "im": "imaginary",
    "coherence": "coherence", "coh": "coherence",
}  # fmt: skip
_COLUMN = re.compile(r"(?:(.*?)[ _.])?(real|re|imaginary|imag|im|coherence|coh)( part)?", re.I)
_BRACKETS = re.compile(r"\s*[\[(][^\])]*[\])]\s*$")
_FREE_LINES, _FREE_CHARACTERS = 60, 50_000


@dataclass(frozen=True)
class ResponseTable:
    """A parsed heading, with the places of each point's columns by their part."""

    heading: Heading
    places: dict[str, dict[_Part, int]]


def responses_in(text: str, path: Path) -> ResponseTable | None:
    """The heading of frequency responses; None for other texts; raises BadInput where faulty."""
    first = LINE_BREAK.split(text[:_FREE_CHARACTERS])[:_FREE_LINES]
    at = next((i for i, line in enumerate(first) if _names(line)), None)
    if at is None:
        return None
    lines = LINE_BREAK.split(text)
    refuse_long_heading(lines[: at + 1], path)
    mark = mark_between(lines[at])
    columns = [cell for cell in cells_of(lines[at], mark) if cell]
    places = _columns_of_points(columns, at + 1, path)
    body = next((i for i in range(at + 1, len(lines)) if _numbers(lines[i], mark)), len(lines))
    header, remarks = header_of(lines[:at], list(places), mark, path)
    heading = Heading(header, tuple(columns), mark, lines[body:], body + 1, remarks)
    units = next((e for i in range(at + 1, body) if (e := _unit(lines[i], mark, path, i))), None)
    return ResponseTable(_with_unit(heading, units), places)


def _read_responses(table: ResponseTable, path: Path) -> FrequencyResponse:
    """The frequency responses of a text; raises BadInput naming line and column."""
    rows = parse_table(table.heading, path)
    parts = list(table.places.values())
    values = np.array([rows[p["real"]] + 1j * rows[p["imaginary"]] for p in parts])
    coherence = None
    if all("coherence" in part for part in parts):
        coherence = np.array([rows[part["coherence"]] for part in parts])
    return assemble.frequency_response(
        _response_header(table, path), rows[0], values, coherence, path
    )


def _peek_responses(table: ResponseTable, file_format: str, path: Path) -> Peek:
    """What the heading and the column of frequencies say."""
    listed = parse_table(table.heading, path)[0]
    found = assemble.peeked_response(_response_header(table, path), file_format, listed, path)
    return replace(found, problems=(*table.heading.remarks, *found.problems))


def _response_header(table: ResponseTable, path: Path) -> Header:
    return with_sidecar(table.heading.header, path)


def _names(line: str) -> bool:
    """Whether a line heads columns of which the first holds frequencies."""
    cells = cells_of(line, mark_between(line))
    return len(cells) > 2 and cells[0].lower().startswith("freq")


def _numbers(line: str, mark: str) -> bool:
    cells = [cell for cell in cells_of(line, mark) if cell]
    return len(cells) > 2 and all(map(is_number, cells))


def _columns_of_points(
    columns: Sequence[str], line: int, path: Path
) -> dict[str, dict[_Part, int]]:
    """The columns of each point; a point without a name is point_1, point_2, ..."""
    places: dict[str, dict[_Part, int]] = {}
    for place, column in enumerate(columns[1:], start=1):
        found = _COLUMN.fullmatch(_BRACKETS.sub("", column))
        if found is None:
            raise _no_response(f"the column {column!r} is no part of a response", line, path)
        part = _PARTS[found[2].lower()]
        nameless = sum(name.startswith("point_") for name in places) + (part == "real")
        own = places.setdefault(found[1] or f"point_{nameless}", {})
        if part in own:
            raise _no_response(f"the column {column!r} stands twice", line, path)
        own[part] = place
    if not all({"real", "imaginary"} <= set(own) for own in places.values()):
        raise _no_response("a real or an imaginary part is missing", line, path)
    return places


def _no_response(what: str, line: int, path: Path) -> BadInput:
    return BadInput(
        f"{what}.",
        file=path,
        line=line,
        remedy="Head the columns frequency, acc_1_real, acc_1_imaginary, acc_2_real, ...",
    )


def _unit(line: str, mark: str, path: Path, index: int) -> Entry | None:
    """The unit in an analyser's line of units, which begins with Hz."""
    cells = [cell for cell in cells_of(line, mark) if cell]
    return Entry(cells[1], path, index + 1) if len(cells) > 1 and cells[0] == "Hz" else None


def _with_unit(heading: Heading, unit: Entry | None) -> Heading:
    if unit is None:
        return heading
    header = heading.header
    channels = {name: {"unit": unit, **said} for name, said in header.channels.items()}
    return replace(heading, header=Header(header.file, channels, header.entries))
