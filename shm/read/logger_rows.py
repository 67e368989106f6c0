"""Find the rows of numbers in a logger's text, and how they are written.

Lines from the middle of the file, where there are only numbers, show the separator, the decimal
mark and the kind of each column. From there the rows are followed up to the heading and down to the
tail.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from shm.errors import BadInput
from shm.read.stamps import is_stamp
from shm.values import NAN, FloatArray

Kind = Literal["number", "stamp", "text", "empty"]

_SAMPLE_LINES = 60  # judgement: enough that a bad line or two do not decide
_MOST_PREAMBLE = 2000  # judgement: lines; the longest heading of a logger has some hundred
_SHARE = 0.9  # judgement: of the sample; a heading in the midst is less than a tenth of it
_MISSING = {
    "", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "---", "nv", "#nv", "invalid", "bad",
    "ungültig", "nan.0", "#div/0!", "#value!", "#num!", "#ref!",
}  # fmt: skip
_NAN = re.compile(r"[+-]?(nan(\(\w*\))?|1\.#(ind|qnan|snan)0*)", re.IGNORECASE)  # of C libraries
_OVER = re.compile(
    r"[+-]?(ov(e?r)?(l|ld|f|flow|range|load)?|over[ _-]?(range|load|flow|fl)?|ol|o\.l\.?|∞"
    r"|inf(inity)?"
    r"|1\.#inf|überlauf|ueberlauf|übersteuert|uebersteuert|clip(ped)?|\*{2,}|#{2,}|9\.9e\+?37)"
    r"(\.0*)?",
    re.IGNORECASE,
)
_REMARK = "#"
_BLANKS = re.compile(r"[ \u00a0\u202f]+")
_GROUPS = r"[ \u00a0\u202f'\u2019]"
_NUMBERS = {
    ".": re.compile(
        rf"(?=[+-]?[.,]?\d)[+-]?(?:\d{{1,3}}(?:,\d{{3}})+|\d{{1,3}}(?:{_GROUPS}\d{{3}})+|\d+)?(?:\.\d*)?(?:[eEdD][+-]?\d+)?"
    ),
    ",": re.compile(
        rf"(?=[+-]?[.,]?\d)[+-]?(?:\d{{1,3}}(?:\.\d{{3}})+|\d{{1,3}}(?:{_GROUPS}\d{{3}})+|\d+)?(?:,\d*)?(?:[eEdD][+-]?\d+)?"
    ),
}
_MARKS = ("\t", ";", "|", ",", " ")


@dataclass(frozen=True)
class Dialect:
    """Describe how rows are written: `mark` between cells, decimal mark, kind of each column."""

    mark: str
    decimal: str
    kinds: tuple[Kind, ...]
    quoted: bool

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line, without surrounding blanks and quotes."""
        if self.quoted and '"' in line:
            quoted = next(csv.reader([line], delimiter=self.mark, skipinitialspace=True), [])
            return [cell.strip() for cell in quoted]
        if self.mark == " ":
            return _BLANKS.sub(" ", line.strip()).split(" ")
        return [cell.strip() for cell in line.split(self.mark)]

    def row(self, line: str) -> list[str] | None:
        """Return the cells of a line, as many as columns; None where it is no row of numbers."""
        cells = self.cells(line)
        count = len(self.kinds)
        if len(cells) > count and not any(cells[count:]):
            cells = cells[:count]
        missing = self.kinds[len(cells) :]
        if len(cells) > count or any(kind in ("number", "stamp") for kind in missing):
            return None
        cells += [""] * len(missing)
        return cells if self._fits(cells) else None

    def _fits(self, cells: Sequence[str]) -> bool:
        some = False
        for cell, kind in zip(cells, self.kinds, strict=True):
            if kind == "number":
                if is_number(cell, self.decimal):
                    some = True
                elif not is_gap(cell) and not is_over(cell):
                    return False
            elif (kind == "stamp" and not is_stamp(cell)) or (
                kind == "empty" and not some and not is_gap(cell)
            ):
                return False
        return some


@dataclass(frozen=True)
class DataRows:
    """The rows of numbers: `above` are the lines before them, `first_line` counts from 1.

    `rows` are cells by row, `lines` the number of the line of each.
    """

    dialect: Dialect
    above: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    remarks: tuple[str, ...] = ()


def is_number(text: str, decimal: str) -> bool:
    """Return whether a text is a number with that decimal mark, its thousands grouped or not."""
    return _NUMBERS[decimal].fullmatch(text) is not None


def is_gap(text: str) -> bool:
    """Return whether a cell marks a missing value."""
    return text.lower() in _MISSING or _NAN.fullmatch(text) is not None


def is_over(text: str) -> bool:
    """Return whether a cell marks a value beyond the range of the logger."""
    return _OVER.fullmatch(text) is not None


def number_of(text: str, decimal: str) -> float:
    """Return the number that a text with that decimal mark gives; raises ValueError."""
    plain = re.sub(_GROUPS, "", text)
    plain = plain.replace(".", "").replace(",", ".") if decimal == "," else plain.replace(",", "")
    return float(plain.replace("d", "e").replace("D", "e"))


# ---------------------------------------------------------------- how it is written


def dialect_of(lines: Sequence[str]) -> Dialect | None:
    """Return how the rows in the middle of a text are written; None where there are none."""
    filled = [line for line in lines if line.strip()]
    if len(filled) < 2:
        return None
    middle = max(0, (len(filled) + min(len(filled), 200)) // 2 - _SAMPLE_LINES // 2)
    sample = filled[middle : middle + _SAMPLE_LINES] or filled[-_SAMPLE_LINES:]
    quoted = any('"' in line for line in (*filled[:_SAMPLE_LINES], *sample))
    for mark in _MARKS:
        found = _dialect(sample, mark, quoted)
        if found is not None:
            return found
    return None


def _dialect(sample: Sequence[str], mark: str, quoted: bool) -> Dialect | None:
    """Return how a sample with that separator is written; None where it separates no columns."""
    if sum(mark in line for line in sample) < _SHARE * len(sample):
        return None
    plain = Dialect(mark, ".", (), quoted)
    rows = [plain.cells(line) for line in sample]
    count, times = Counter(map(len, rows)).most_common(1)[0]
    if count < 2 or times < _SHARE * len(rows):
        return None
    even = [row for row in rows if len(row) == count]
    columns = list(zip(*even, strict=True))
    decimal = "." if mark == "," and '"' not in "".join(sample) else _decimal(columns)
    kinds = tuple(_kind(column, decimal) for column in columns)
    if "number" not in kinds or kinds.count("text") > kinds.count("number") + 1:
        return None
    return Dialect(mark, decimal, kinds, quoted)


def _decimal(columns: Sequence[Sequence[str]]) -> str:
    """Return the decimal mark that makes more cells numbers; if both do, decide by the grouping."""
    cells = [c for column in columns for c in column if c and ("," in c or "." in c)]
    cells = [cell for cell in cells if not is_stamp(cell)]
    by_point, by_comma = (sum(is_number(c, mark) for c in cells) for mark in ".,")
    if by_point != by_comma:
        return "." if by_point > by_comma else ","
    # All fit both, as 1,234 and 12,345 do: then commas alone are decimal, as grouped thousands
    # without any decimals are rare.
    return "," if cells and all("," in cell and "." not in cell for cell in cells) else "."


def _kind(cells: Sequence[str], decimal: str) -> Kind:
    filled = [cell for cell in cells if not is_gap(cell) and not is_over(cell)]
    if not filled:
        return "number" if any(map(is_over, cells)) else "empty"
    if sum(is_number(cell, decimal) for cell in filled) >= _SHARE * len(filled):
        return "number"
    return "stamp" if sum(map(is_stamp, filled)) >= _SHARE * len(filled) else "text"


# ---------------------------------------------------------------- where it is


def block_of(lines: Sequence[str], dialect: Dialect, path: Path) -> DataRows | None:
    """Return the rows between heading and tail of a text; None where there are none.

    Raises BadInput for a line among them that is no row.
    """
    start = _first(lines, dialect)
    if start is None:
        return None
    stop, remarks = _last(lines, dialect, start)
    rows: list[list[str]] = []
    numbers: list[int] = []
    keys = {cells[0] for line in lines[:start] if (cells := dialect.cells(line))[0]}
    for place in range(start, stop):
        line = lines[place]
        if not line.strip() or line.lstrip().startswith(_REMARK):
            continue
        row = dialect.cells(line)
        if row[0] in keys:
            raise BadInput(
                "a second record begins here, with a heading of its own.",
                file=path,
                line=place + 1,
                remedy="Export each recording to a file of its own; `ingest --together` joins"
                " them.",
            )
        if len(row) != len(dialect.kinds):
            row = dialect.row(line) or []
        if not row:
            raise _no_row(dialect.cells(line), place + 1, dialect, path)
        rows.append(row)
        numbers.append(place + 1)
    return DataRows(dialect, tuple(lines[:start]), rows, numbers, remarks) if rows else None


def _first(lines: Sequence[str], dialect: Dialect) -> int | None:
    """Return the first line of two running that are rows."""
    before: int | None = None
    for place, line in enumerate(lines[:_MOST_PREAMBLE]):
        if not line.strip():
            continue
        if dialect.row(line) is None:
            before = None
        elif before is not None:
            return before
        else:
            before = place
    return before


def _last(lines: Sequence[str], dialect: Dialect, start: int) -> tuple[int, tuple[str, ...]]:
    """Return the end of the rows, and a remark on the lines left out after it."""
    stop = len(lines)
    while stop > start and (not lines[stop - 1].strip() or dialect.row(lines[stop - 1]) is None):
        stop -= 1
    left = [line for line in lines[stop:] if line.strip(" \t\x1a\x00")]
    if not left:
        return stop, ()
    return stop, (f"{len(left)} lines after the last row are no numbers; left out.",)


def _no_row(cells: Sequence[str], line: int, dialect: Dialect, path: Path) -> BadInput:
    """Return the refusal of a damaged line in the midst of the rows."""
    return BadInput(
        f"{' '.join(cells)[:60]!r} is no row of {len(dialect.kinds)} values.",
        file=path,
        line=line,
        remedy="Complete or remove the line, or export again; a bad value may be left empty.",
    )


def values_of(block: DataRows, column: int, path: Path) -> tuple[FloatArray, int]:
    """Return the numbers of a column, NaN where there are none, and how many were beyond the range.

    Raises BadInput for a cell that is none of these.
    """
    texts = [row[column] for row in block.rows]
    plain = _plainly(texts, block.dialect.decimal)
    if plain is not None:
        return plain, 0
    over = 0
    values = np.full(len(texts), NAN)
    for place, text in enumerate(texts):
        if is_number(text, block.dialect.decimal):
            values[place] = number_of(text, block.dialect.decimal)
            if np.isinf(values[place]):
                raise _no_row(block.rows[place], block.lines[place], block.dialect, path)
        elif is_over(text):
            over += 1
        elif not is_gap(text):
            raise _no_row(block.rows[place], block.lines[place], block.dialect, path)
    return values, over


def _plainly(texts: Sequence[str], decimal: str) -> FloatArray | None:
    """Return the numbers of cells that hold nothing else, without grouped thousands; else None."""
    if decimal == ",":
        if any("." in text for text in texts):
            return None
        texts = [text.replace(",", ".") for text in texts]
    try:
        found = np.array(list(map(float, texts)))
    except ValueError:
        return None
    return found if np.isfinite(found).all() else None
