"""A paper as plain text for a terminal: all of it without figures, or what fits a screen."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from operator import gt

from shm.report.paper import Paper, Section, Table

WIDTH = 100
"""Columns of a terminal that a text may fill, where nobody says how wide it is."""
_GAP = "  "
# Layout: what fits a terminal of 80 columns with four numbers beside a name.
_LONGEST_NAME = 24
_LONGEST_NUMBER = 12
_LEAST = 9


def as_brief_text(paper: Paper, width: int = WIDTH) -> str:
    """Return what fits a screen: state, action, reason, and the figures on top."""
    first = paper.parts[0]
    blocks = [*_underlined(paper.headline, "=", width), *_part(replace(first, tables=()), width)]
    blocks += [laid_out(in_terminal(table), width) for table in first.brief]
    return "\n".join([*blocks, *([_folded(paper.more, width)] if paper.more else []), ""])


def as_text(paper: Paper, width: int = WIDTH) -> str:
    """Return all of it in lines of at most `width` columns, unless a single word is longer."""
    first, *others = paper.parts
    blocks = [*_underlined(paper.headline, "=", width), *_part(first, width)]
    for part in others:
        if wording := list(_part(part, width)):
            blocks += [*_underlined(part.headline, "-", width), *wording]
    return "\n".join([*blocks, _folded(paper.foot, width), ""])


def _part(part: Section, width: int) -> Iterator[str]:
    for paragraph in (*part.paragraphs, part.full_summary, part.details):
        if paragraph:
            yield f"{_folded(paragraph, width)}\n"
    if part.remarks:
        yield "\n".join(_folded(each, width, "! ") for each in part.remarks) + "\n"
    if part.facts:
        yield laid_out(Table("", ("", "", ""), tuple(part.facts)), width)
    for table in part.tables:
        shown = in_terminal(table)
        if shown.rows or shown.note:
            yield laid_out(shown, width)


def _underlined(title: str, line: str, width: int) -> list[str]:
    lines = textwrap.wrap(title, width)
    return [*lines, line * max(map(len, lines))]


def _folded(text: str, width: int, start: str = "") -> str:
    return textwrap.fill(
        text, width, initial_indent=start, subsequent_indent=" " * len(start),
        break_long_words=False,
    )  # fmt: skip


def in_terminal(table: Table) -> Table:
    """Return the table with the rows that a terminal shows."""
    rows, note = table.rows, table.note
    if table.terminal_rows is not None:
        more = table.hidden_note.format(len(rows) - len(table.terminal_rows))
        rows = tuple(rows[index] for index in table.terminal_rows)
        note = f"{note} {more}".strip() if rows else more
    return replace(table, rows=rows, note=note, marks=(), terminal_rows=None)


def laid_out(table: Table, width: int = WIDTH) -> str:
    """Lay out a table for a terminal of `width` columns; its columns fold, the widest first.

    No word is cut. Where there is no room for that, each row becomes a list.
    """
    title = [textwrap.fill(table.title.upper(), width)] if table.title else []
    note = [textwrap.fill(table.note, width)] if table.note else []
    lines: list[str] = []
    if table.rows:
        widths = _widths(table, width)
        lines = _columns(table, widths) if widths else _lists(table, width)
    return "\n".join((*title, *lines, *note, ""))


def _columns(table: Table, widths: list[int]) -> list[str]:
    head = [*_lines(table.headings, widths), _GAP.join("-" * width for width in widths)]
    lines = head if any(table.headings) else []
    for row in table.rows:
        lines += _lines(row, widths)
    return lines


def _lists(table: Table, width: int) -> list[str]:
    """Return each row as lines of heading and value, empty values left out, and an empty line."""
    widest = max(map(len, table.headings))
    widths = [widest, max(width - widest - len(_GAP), _LEAST)]
    lines: list[str] = []
    for row in table.rows:
        for heading, cell in zip(table.headings, row, strict=True):
            lines += _lines((heading, cell), widths) if cell else []
        lines.append("")
    return lines


def _widths(table: Table, width: int) -> list[int]:
    """Return the width of each column; empty where they do not fit."""
    columns = list(zip(table.headings, *table.rows, strict=True))
    widths = [max(1, *map(len, column)) for column in columns]
    room = width - len(_GAP) * (len(widths) - 1)
    for longest in (_LONGEST_NAME, _LEAST):
        least = [max(_longest_word(cell, longest) for cell in column) for column in columns]
        while sum(widths) > room and any(map(gt, widths, least)):
            loose = [column for column, this in enumerate(widths) if this > least[column]]
            widths[max(loose, key=widths.__getitem__)] -= 1
    return widths if sum(widths) <= room else []


def _longest_word(cell: str, longest: int) -> int:
    """Return the length of the longest word; names of tests and files count up to `longest`."""
    words = cell.split()
    return max((min(len(e), longest) if _is_name(e) else len(e) for e in words), default=0)


def _is_name(word: str) -> bool:
    return len(word) > _LONGEST_NUMBER and any(each in "_/0123456789" for each in word)


def _lines(cells: tuple[str, ...], widths: list[int]) -> list[str]:
    """Return one row as one line or several."""
    wrapped = [textwrap.wrap(cell, width) for cell, width in zip(cells, widths, strict=True)]
    return [
        _GAP.join(part.ljust(width) for part, width in zip(parts, widths, strict=True)).rstrip()
        for parts in zip_longest(*wrapped, fillvalue="")
    ]
