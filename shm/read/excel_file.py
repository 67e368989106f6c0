"""Workbooks of Excel (.xlsx): the sheet with the numbers, read as if it were tab-separated text.

Smaller sheets are what the logger says about the recording. Formulas count as what they gave when
the workbook was saved; macros are never run.
"""

from __future__ import annotations

import re
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

from shm.errors import BadInput
from shm.read.content import checked_members
from shm.read.limits import guarded, limits, refuse_large, refuse_many_samples, too_large

_PARTS = (b"[Content_Types].xml", b"_rels/.rels", b"docProps/", b"xl/")
_MOST_COLUMNS = 200  # judgement: far more than the 16 accelerations that are read
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_WHOLE = 2**53  # technical: beyond, a double leaves out whole numbers
_SHARE_OF_LARGEST = 0.5  # judgement: a sheet of half as many rows holds a recording too


def recognises(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of an office document."""
    return head.startswith(b"PK\x03\x04") and any(part in head for part in _PARTS)


def text_of_workbook(path: Path) -> tuple[str, tuple[str, ...]]:
    """Return the sheet of numbers as tab-separated lines, and the lines of all smaller sheets.

    Raises BadInput where several sheets hold numbers, or where the workbook is damaged.
    """
    if sum(member.file_size for member in checked_members(path)) > limits().bytes_at_once:
        raise too_large(path)
    sheets = _sheets(path)
    largest = max((len(lines) for lines in sheets.values()), default=0)
    full = [name for name, lines in sheets.items() if len(lines) > _SHARE_OF_LARGEST * largest]
    long = [name for name in full if len(sheets[name]) > 50]  # judgement: no notes are longer
    if len(long) > 1:
        raise BadInput(
            f"{len(long)} sheets hold numbers: {', '.join(long)[:100]}.",
            file=path,
            remedy="Save each recording as a workbook of its own; `shm ingest --together` joins"
            " the hits of a test.",
        )
    if not full:
        raise BadInput("no sheet holds anything.", file=path, remedy="Export or save it again.")
    chosen = max(full, key=lambda name: len(sheets[name]))
    others = (line for name, lines in sheets.items() if name != chosen for line in lines)
    return "\n".join(sheets[chosen]), tuple(others)


def _sheets(path: Path) -> dict[str, list[str]]:
    import python_calamine  # of use for no other format

    with guarded(path, "the workbook"):
        book = python_calamine.CalamineWorkbook.from_path(str(path))
        sheets = {}
        for found in book.sheets_metadata:
            if found.typ == python_calamine.SheetTypeEnum.WorkSheet:
                sheets[found.name] = _lines(book.get_sheet_by_name(found.name), path)
    return sheets


def _lines(sheet: Any, path: Path) -> list[str]:
    """Return the rows of a sheet as lines, numbered as the rows: the empty ones are kept."""
    refuse_large((sheet.total_height, min(sheet.total_width, _MOST_COLUMNS)), 32, sheet.name, path)
    refuse_many_samples(sheet.total_height, path)
    rows = sheet.to_python(skip_empty_area=False)
    lines = ["\t".join(map(_cell, row[:_MOST_COLUMNS])).rstrip() for row in rows]
    while lines and not lines[-1]:
        lines.pop()
    return lines


def _cell(value: object) -> str:
    if isinstance(value, float):
        return repr(int(value)) if value.is_integer() and abs(value) < _WHOLE else repr(value)
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, timedelta):
        return repr(value.total_seconds())
    text = str(value)
    if _COMMA_NUMBER.fullmatch(text):  # a number that was exported as text, in German
        return text.replace(",", ".")
    return re.sub(r"[\t\r\n]+", " ", text).strip()
