"""Frequency responses as text: a column of frequencies, then real and imaginary parts.

    # hanger: 3
    # x_m: 2.5, 4.0
    frequency,low_real,low_imaginary,low_coherence,high_real,high_imaginary,high_coherence
    0,0.12,0,0.99,0.05,0,0.98

Columns of coherence may be missing. An analyser's export is read too: free lines before the names
(Frequency, Real, Imaginary), and one of units between names and numbers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from shm.errors import BadInput
from shm.read import assemble
from shm.read.base import Peek
from shm.read.comma_table import (
    LINE_BREAK,
    Heading,
    cells_of,
    header_of,
    mark_between,
    parse_table,
    refuse_long_heading,
)
from shm.read.header import Entry, Header
from shm.read.sidecar import with_sidecar
from shm.values import FrequencyResponse

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


def parse(text: str, path: Path) -> ResponseTable | None:
    """The heading of frequency responses; None for other texts; raises BadInput where faulty."""
    first = LINE_BREAK.split(text[:_FREE_CHARACTERS])[:_FREE_LINES]
    at = next((i for i, line in enumerate(first) if _names(line)), None)
    if at is None:
        return None
    lines = LINE_BREAK.split(text)
    refuse_long_heading(lines[: at + 1], path)
    mark = mark_between(lines[at])
    columns = [cell for cell in cells_of(lines[at], mark) if cell]
    places = _places(columns, at + 1, path)
    body = next((i for i in range(at + 1, len(lines)) if _numbers(lines[i], mark)), len(lines))
    header, remarks = header_of(lines[:at], list(places), mark, path)
    heading = Heading(header, tuple(columns), mark, lines[body:], body + 1, remarks)
    units = next((e for i in range(at + 1, body) if (e := _unit(lines[i], mark, path, i))), None)
    return ResponseTable(_with_unit(heading, units), places)


def read(table: ResponseTable, path: Path) -> FrequencyResponse:
    """The frequency responses of a text; raises BadInput naming line and column."""
    rows = parse_table(table.heading, path)
    parts = list(table.places.values())
    values = np.array([rows[p["real"]] + 1j * rows[p["imaginary"]] for p in parts])
    coherence = None
    if all("coherence" in part for part in parts):
        coherence = np.array([rows[part["coherence"]] for part in parts])
    return assemble.frequency_response(_header(table, path), rows[0], values, coherence, path)


def peek(table: ResponseTable, file_format: str, path: Path) -> Peek:
    """What the heading and the column of frequencies say."""
    listed = parse_table(table.heading, path)[0]
    found = assemble.peeked_response(_header(table, path), file_format, listed, path)
    return replace(found, problems=(*table.heading.remarks, *found.problems))


def _header(table: ResponseTable, path: Path) -> Header:
    return with_sidecar(table.heading.header, path)


def _names(line: str) -> bool:
    """Whether a line heads columns of which the first holds frequencies."""
    cells = cells_of(line, mark_between(line))
    return len(cells) > 2 and cells[0].lower().startswith("freq")


def _numbers(line: str, mark: str) -> bool:
    cells = [cell for cell in cells_of(line, mark) if cell]
    plain = (cell.replace(",", ".") if mark != "," else cell for cell in cells)
    return len(cells) > 2 and all(_is_number(cell) for cell in plain)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _places(columns: Sequence[str], line: int, path: Path) -> dict[str, dict[_Part, int]]:
    """The columns of each point; a point without a name is point_1, point_2, ..."""
    places: dict[str, dict[_Part, int]] = {}
    for place, column in enumerate(columns[1:], start=1):
        found = _COLUMN.fullmatch(_BRACKETS.sub("", column))
        if found is None:
            raise _refusal(f"the column {column!r} is no part of a response", line, path)
        part = _PARTS[found[2].lower()]
        nameless = sum(name.startswith("point_") for name in places) + (part == "real")
        own = places.setdefault(found[1] or f"point_{nameless}", {})
        if part in own:
            raise _refusal(f"the column {column!r} stands twice", line, path)
        own[part] = place
    if not all({"real", "imaginary"} <= set(own) for own in places.values()):
        raise _refusal("a real or an imaginary part is missing", line, path)
    return places


def _refusal(what: str, line: int, path: Path) -> BadInput:
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
