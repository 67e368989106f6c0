"""A table of texts, and how it stands in a terminal; titles and paragraphs there."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from itertools import zip_longest
from operator import gt

WIDTH = 100
"""Columns of a terminal that a text may fill, where nobody says how wide it is."""
_GAP = "  "
_LONGEST_NAME = 24
_LONGEST_NUMBER = 12
_LEAST = 9


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


def headed(title: str, paragraph: str, width: int = WIDTH) -> str:
    """An underlined title and a paragraph."""
    lines = textwrap.wrap(title, width)
    told = "\n".join((*lines, "=" * max(map(len, lines)), textwrap.fill(paragraph, width)))
    return f"{told}\n"


def laid_out(table: Table, width: int = WIDTH) -> str:
    """The table for a terminal of `width` columns: those of the table fold, the widest first.

    No word is cut. Where there is no room for that, each row stands as a list.
    """
    title = textwrap.fill(table.title.upper(), width)
    note = [textwrap.fill(table.note, width)] if table.note else []
    widths = _widths(table, width)
    return "\n".join(
        (title, *(_columns(table, widths) if widths else _lists(table, width)), *note, "")
    )


def _columns(table: Table, widths: list[int]) -> list[str]:
    lines = [*_lines(table.headings, widths), _GAP.join("-" * width for width in widths)]
    for row in table.rows:
        lines += _lines(row, widths)
    return lines


def _lists(table: Table, width: int) -> list[str]:
    """Each row as lines of heading and value, empty values left out, and an empty line."""
    widest = max(map(len, table.headings))
    widths = [widest, max(width - widest - len(_GAP), _LEAST)]
    lines: list[str] = []
    for row in table.rows:
        for heading, cell in zip(table.headings, row, strict=True):
            lines += _lines((heading, cell), widths) if cell else []
        lines.append("")
    return lines


def _widths(table: Table, width: int) -> list[int]:
    """Of each column; none where they do not fit."""
    columns = list(zip(table.headings, *table.rows, strict=True))
    widths = [max(len(cell) for cell in column) for column in columns]
    room = width - len(_GAP) * (len(widths) - 1)
    for longest in (_LONGEST_NAME, _LEAST):
        least = [max(_longest_word(cell, longest) for cell in column) for column in columns]
        while sum(widths) > room and any(map(gt, widths, least)):
            loose = [column for column, own in enumerate(widths) if own > least[column]]
            widths[max(loose, key=widths.__getitem__)] -= 1
    return widths if sum(widths) <= room else []


def _longest_word(cell: str, longest: int) -> int:
    """Of its words; of names of tests, files and checksums only so much as `longest`."""
    words = cell.split()
    return max((min(len(e), longest) if _is_name(e) else len(e) for e in words), default=0)


def _is_name(word: str) -> bool:
    return len(word) > _LONGEST_NUMBER and any(each in "_/0123456789" for each in word)


def _lines(cells: tuple[str, ...], widths: list[int]) -> list[str]:
    """One row as one line or several."""
    wrapped = [textwrap.wrap(cell, width) for cell, width in zip(cells, widths, strict=True)]
    return [
        _GAP.join(part.ljust(width) for part, width in zip(parts, widths, strict=True)).rstrip()
        for parts in zip_longest(*wrapped, fillvalue="")
    ]
