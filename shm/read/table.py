"""The numbers of a CSV file, fast where all is well, line by line where something is off."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shm.errors import BadInput
from shm.read.comma_header import Heading
from shm.values import NAN, FloatArray

_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}


def parse_table(heading: Heading, path: Path) -> FloatArray:
    """All columns (columns, rows), empty cells as NaN; raises BadInput naming line and column."""
    lines = _with_points(heading)
    try:
        rows = _fast(lines, heading)
    except ValueError:
        rows = _slow(lines, heading, path)
    _refuse_infinite(rows, lines, heading, path)
    return np.ascontiguousarray(rows.T)


def rows_in(body: Sequence[str]) -> int:
    """How many lines hold numbers, by their look alone."""
    return sum(1 for line in body if _holds_numbers(line))


def _holds_numbers(line: str) -> bool:
    stripped = line.strip()
    return bool(stripped) and not stripped.startswith("#") and stripped != "\x1a"


def _with_points(heading: Heading) -> Sequence[str]:
    """The lines with decimal points: commas are decimal where they do not separate columns."""
    if heading.delimiter == ",":
        return heading.body
    return [line.replace(",", ".") for line in heading.body]


def _fast(lines: Sequence[str], heading: Heading) -> FloatArray:
    columns = len(heading.columns)
    if rows_in(lines) == 0:
        return np.zeros((0, columns))
    rows = np.loadtxt(lines, delimiter=heading.delimiter, ndmin=2)
    if rows.shape[1] != columns:
        raise ValueError(f"{rows.shape[1]} columns")
    return rows


def _slow(lines: Sequence[str], heading: Heading, path: Path) -> FloatArray:
    rows = [
        _row(line, number, heading, path)
        for number, line in enumerate(lines, start=heading.body_line)
        if _holds_numbers(line)
    ]
    return np.array(rows, dtype=float)


def _row(line: str, number: int, heading: Heading, path: Path) -> list[float]:
    cells = line.split("#")[0].split(heading.delimiter)
    if len(cells) != len(heading.columns):
        raise BadInput(
            f"{len(cells)} values where the names of the columns are {len(heading.columns)}.",
            file=path,
            line=number,
            remedy="Complete or remove the line; a bad value may be left empty.",
        )
    return [
        _cell(cell, name, number, path) for cell, name in zip(cells, heading.columns, strict=True)
    ]


def _cell(text: str, name: str, line: int, path: Path) -> float:
    plain = text.strip().strip('"').strip()
    if plain.lower() in _MISSING:
        return NAN
    try:
        return float(plain)
    except ValueError:
        raise BadInput(
            f"{plain[:40]!r} is not a number.",
            file=path,
            channel=name,
            line=line,
            remedy="Correct it, or leave it empty.",
        ) from None


def _refuse_infinite(rows: FloatArray, lines: Sequence[str], heading: Heading, path: Path) -> None:
    found = np.argwhere(np.isinf(rows))
    if len(found):
        row, column = found[0]
        numbers = [i for i, line in enumerate(lines) if _holds_numbers(line)]
        raise BadInput(
            "the value is infinite.",
            file=path,
            channel=heading.columns[column],
            line=heading.body_line + numbers[row],
            remedy="Leave the cell empty where the logger failed.",
        )
