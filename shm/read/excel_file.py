"""Workbooks of Excel (.xlsx): the sheet with the numbers, read as if it were tab-separated text.

Smaller sheets are what the logger says about the recording. Formulas count as what they gave when
the workbook was saved; macros are never run.
"""

from __future__ import annotations

import io
import re
import warnings
import zipfile
from datetime import date, datetime, time, timedelta
from pathlib import Path

from shm.errors import BadInput
from shm.read.comma_separated import text_format
from shm.read.content import checked_members
from shm.read.limits import guarded, limits, refuse_many_samples, too_large

_PARTS = (b"[Content_Types].xml", b"_rels/.rels", b"docProps/", b"xl/")
_MOST_COLUMNS = 200  # judgement: far more than the 16 accelerations that are read
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_EMPTY_FILL = re.compile(rb"<fill\s*/>")
_SHARE_OF_LARGEST = 0.5  # judgement: a sheet of half as many rows holds a recording too


def recognises(head: bytes) -> bool:
    """Whether the first bytes of a file are those of an office document."""
    return head.startswith(b"PK\x03\x04") and any(part in head for part in _PARTS)


def text_of_workbook(path: Path) -> tuple[str, tuple[str, ...]]:
    """The sheet of numbers as tab-separated lines, and the lines of all smaller sheets.

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
    import openpyxl  # half a second that no other format needs

    with guarded(path, "the workbook"):
        warnings.simplefilter("ignore")  # of styles and extensions that openpyxl does not know
        options = {"read_only": True, "data_only": True, "keep_links": False}
        try:
            book = openpyxl.load_workbook(path, **options)
        except TypeError:  # of a fill that is empty, as some programs write it
            book = openpyxl.load_workbook(_with_fills(path), **options)
        try:
            return {sheet.title: _lines(sheet, path) for sheet in book.worksheets}
        finally:
            book.close()


def _with_fills(path: Path) -> io.BytesIO:
    """A copy of a workbook in which no fill is empty: openpyxl raises TypeError for one."""
    copy = io.BytesIO()
    with zipfile.ZipFile(path) as packed, zipfile.ZipFile(copy, "w") as archive:
        for member in packed.namelist():
            content = packed.read(member)
            if member.endswith("styles.xml"):
                content = _EMPTY_FILL.sub(b"<fill><patternFill/></fill>", content)
            archive.writestr(member, content)
    copy.seek(0)
    return copy


def _lines(sheet: object, path: Path) -> list[str]:
    """The rows of a sheet as lines, empty ones kept so that line numbers are those of the rows."""
    lines: list[str] = []
    for row in sheet.iter_rows(values_only=True):  # type: ignore[attr-defined]
        lines.append("\t".join(map(_cell, row[:_MOST_COLUMNS])).rstrip())
        if len(lines) % 10_000 == 0:
            refuse_many_samples(len(lines), path)
    while lines and not lines[-1]:
        lines.pop()
    return lines


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, timedelta):
        return repr(value.total_seconds())
    text = str(value)
    if _COMMA_NUMBER.fullmatch(text):  # a number that was exported as text, in German
        return text.replace(",", ".")
    return re.sub(r"[\t\r\n]+", " ", text).strip()


FORMAT = text_format("Excel", (".xlsx", ".xlsm"), recognises, text_of_workbook, library="openpyxl")
