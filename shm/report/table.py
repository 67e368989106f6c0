"""A table of texts, and how it stands in a terminal; titles and paragraphs there."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from itertools import zip_longest

WIDTH = 100
"""Columns of a terminal that a text may fill."""
_GAP = "  "
_LEAST = 12


@dataclass(frozen=True)
class Table:
    """One table; every cell is a text with its unit in the cell or in the heading.

    `marks` names a style for each row on the page; empty: none has one.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    marks: tuple[str, ...] = ()


def headed(title: str, paragraph: str) -> str:
    """An underlined title and a paragraph."""
    return f"{title}\n{'=' * len(title)}\n{textwrap.fill(paragraph, WIDTH)}\n"


def laid_out(table: Table) -> str:
    """The table for a terminal: columns that together are too wide wrap, the widest first."""
    widths = _widths(table)
    lines = [*_lines(table.headings, widths), _GAP.join("-" * width for width in widths)]
    for row in table.rows:
        lines += _lines(row, widths)
    note = [textwrap.fill(table.note, WIDTH)] if table.note else []
    return "\n".join((table.title.upper(), *lines, *note, ""))


def _widths(table: Table) -> list[int]:
    columns = list(zip(table.headings, *table.rows, strict=True))
    widths = [max(len(cell) for cell in column) for column in columns]
    while sum(widths) + len(_GAP) * (len(widths) - 1) > WIDTH and max(widths) > _LEAST:
        widths[widths.index(max(widths))] -= 1
    return widths


def _lines(cells: tuple[str, ...], widths: list[int]) -> list[str]:
    """One row as one line or several."""
    wrapped = [textwrap.wrap(cell, width) for cell, width in zip(cells, widths, strict=True)]
    return [
        _GAP.join(part.ljust(width) for part, width in zip(parts, widths, strict=True)).rstrip()
        for parts in zip_longest(*wrapped, fillvalue="")
    ]
