"""The report as plain text for a terminal of 80 columns or more."""

from __future__ import annotations

import textwrap

from shm.report import words
from shm.report.content import HangerReport
from shm.report.summary import status, summary
from shm.report.tables import Table, tables

_WIDTH = 100
_ROWS_SHOWN = 12


def text(data: HangerReport) -> str:
    """The report of one hanger: the summary, then the tables."""
    return "\n".join((_head(data), *(_table(table) for table in tables(data))))


def _head(data: HangerReport) -> str:
    name = words.hanger_name(data.hanger.id, data.hanger.name)
    title = f"{name}, {data.bridge}: {status(data).value}"
    return f"{title}\n{'=' * len(title)}\n{textwrap.fill(summary(data), _WIDTH)}\n"


def _table(table: Table) -> str:
    shown = table.rows if len(table.headings) == 2 else table.rows[:_ROWS_SHOWN]
    widths = [
        max(len(cell) for cell in column) for column in zip(table.headings, *shown, strict=True)
    ]
    lines = [_line(row, widths) for row in (table.headings, *shown)]
    lines.insert(1, "  ".join("-" * width for width in widths))
    if len(shown) < len(table.rows):
        lines.append(f"... and {len(table.rows) - len(shown)} earlier ones (in HTML and JSON)")
    note = [textwrap.fill(table.note, _WIDTH)] if table.note else []
    return "\n".join((table.title.upper(), *lines, *note, ""))


def _line(cells: tuple[str, ...], widths: list[int]) -> str:
    return "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()
