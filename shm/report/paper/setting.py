"""The parts of a paper as what reportlab sets one below the other.

How wide the columns of a table are set.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import count
from typing import Any
from xml.sax.saxutils import escape

from reportlab.lib import colors
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.platypus import (
    CallerMacro,
    Flowable,
    Image,
    KeepTogether,
    Paragraph,
    Spacer,
)
from reportlab.platypus import (
    Table as SetTable,
)

from shm.report import colours
from shm.report.figures.member import Illustration
from shm.report.paper import fonts
from shm.report.paper.content import Fact, Paper, Part
from shm.report.table import Table

WIDTH = 174 * mm
DOTS_PER_INCH = 220
_TALLEST = 200 * mm
_PADDING = 4.0
_CELL_SIZE = 7.6
_INK, _QUIET, _GRID = (colors.HexColor(each) for each in (colours.INK, colours.QUIET, colours.GRID))
_PANEL = colors.HexColor("#f4f6f9")


def _letters(name: str, size: float, font: str = fonts.PLAIN, **more: Any) -> ParagraphStyle:
    settings = {"textColor": _INK, "leading": 1.35 * size, "bulletFontName": font, **more}
    return ParagraphStyle(name, fontName=font, fontSize=size, **settings)


_TITLE = _letters("title", 17, fonts.BOLD, spaceAfter=6)
_HEADING = _letters("heading", 12.5, fonts.BOLD, spaceBefore=12, spaceAfter=6, keepWithNext=1)
_SUBHEADING = _letters("subheading", 9.5, fonts.BOLD, spaceAfter=3, keepWithNext=1)
_BODY = _letters("body", 9, leading=13.2)
_NOTE = _letters("note", 7.6, textColor=_QUIET, spaceBefore=2, spaceAfter=9)
_REMARK = _letters("remark", 8.6, leftIndent=10, bulletIndent=0, spaceAfter=2)
_CELL = _letters("cell", _CELL_SIZE)
_HEAD = _letters("head", _CELL_SIZE, fonts.BOLD, textColor=_QUIET)
_FACT = _letters("fact", 11, fonts.BOLD)
_LABEL = _letters("label", 7.6, textColor=_QUIET)


def flowables(paper: Paper) -> list[Flowable]:
    """The title and all parts that have something, in order; figures and tables are numbered."""
    figures, tables = count(1), count(1)
    colour = colours.STATUS_COLOURS[paper.style]
    state = f' <font color="{colour}" size="12">● {escape(paper.status)}</font>'
    top: list[Flowable] = [
        Paragraph(escape(paper.bridge), _LABEL),
        Paragraph(escape(paper.title) + (state if paper.status else ""), _TITLE),
    ]
    parts = [
        each for part in paper.parts if not part.is_empty
        for each in _part(part, colours.STATUS_COLOURS[part.style or paper.style], figures, tables)
    ]  # fmt: skip
    return [*top, *parts, Paragraph(escape(f"{paper.made}. {paper.closing}"), _NOTE)]


def _part(part: Part, colour: str, figures: count[int], tables: count[int]) -> list[Flowable]:
    heading: list[Flowable] = [_mark(part.title), Paragraph(escape(part.title), _HEADING)]
    found: list[Flowable] = []
    if part.summary:
        found += [_panel(Paragraph(escape(part.summary), _BODY), colour), Spacer(1, 6)]
    if part.facts:
        found += [_facts(part.facts), Spacer(1, 8)]
    remarks = [Paragraph(escape(each), _REMARK, bulletText="•") for each in part.remarks]
    found += [*remarks, Spacer(1, 8)] if remarks else []
    groups = [_figure(each, next(figures)) for each in part.illustrations]
    groups += [_table(each, next(tables)) for each in part.tables]
    if groups and not found:
        # Stated, because a heading is not kept with what is itself kept together.
        groups[0], heading = [*heading, *groups[0]], []
    return [*heading, *found, *(KeepTogether(each) for each in groups)]


def _mark(title: str) -> Flowable:
    """An entry of the document's outline, kept with the heading that follows."""

    def entry(macro: CallerMacro) -> None:
        macro.canv.bookmarkPage(title)
        macro.canv.addOutlineEntry(title, title, level=0)

    mark = CallerMacro(drawCallable=entry)
    mark.keepWithNext = 1
    return mark


def _panel(paragraph: Paragraph, colour: str) -> Flowable:
    rules = [
        ("BACKGROUND", (0, 0), (-1, -1), _PANEL),
        ("LINEBEFORE", (0, 0), (0, -1), 3, colors.HexColor(colour)),
        ("LEFTPADDING", (0, 0), (-1, -1), 9),
        ("TOPPADDING", (0, 0), (-1, -1), 6),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 7),
    ]
    return SetTable([[paragraph]], [WIDTH], style=rules, splitInRow=1)


def _facts(facts: Sequence[Fact]) -> Flowable:
    cells = [
        [
            Paragraph(escape(what), _LABEL),
            Paragraph(escape(value), _FACT),
            Paragraph(escape(beside), _LABEL),
        ]
        for what, value, beside in facts
    ]
    rules = [
        ("BACKGROUND", (0, 0), (-1, -1), _PANEL),
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("INNERGRID", (0, 0), (-1, -1), 3, colors.white),
    ]
    return SetTable([cells], [WIDTH / len(cells)] * len(cells), style=rules)


def _figure(item: Illustration, number: int) -> list[Flowable]:
    inches = item.figure.get_size_inches()
    points = min(WIDTH / inches[0], _TALLEST / inches[1]) * inches
    picture = Image(io.BytesIO(item.png(DOTS_PER_INCH)), *map(float, points))
    caption = f"<b>Figure {number}.</b> {escape(item.caption)}"
    return [Paragraph(escape(item.title), _SUBHEADING), picture, Paragraph(caption, _NOTE)]


def _table(table: Table, number: int) -> list[Flowable]:
    """With title and note; rows break over pages, under repeated headings, only where one does not
    hold them all."""
    title = Paragraph(f"Table {number}. {escape(table.title)}", _SUBHEADING)
    rows = [[Paragraph(escape(cell), _HEAD) for cell in table.headings]]
    rows += [[Paragraph(escape(cell), _CELL) for cell in row] for row in table.rows]
    set_table = SetTable(
        rows,
        _widths(table),
        repeatRows=1,
        splitInRow=1,
        hAlign="LEFT",
        style=_rules(table),
    )
    note = Paragraph(escape(table.note), _NOTE) if table.note else Spacer(1, 9)
    return [title, set_table, note]


def _widths(table: Table) -> list[float]:
    """Points of each column; the second has room for its row's mark."""
    mark = _PADDING if table.marks else 0.0
    first, second, *rest = widths(table, WIDTH - mark, _CELL_SIZE, 2 * _PADDING)
    return [first, second + mark, *rest]


def _rules(table: Table) -> list[tuple[Any, ...]]:
    rules: list[tuple[Any, ...]] = [
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("LINEBELOW", (0, 0), (-1, 0), 0.8, _QUIET),
        ("LINEBELOW", (0, 1), (-1, -1), 0.3, _GRID),
        ("LEFTPADDING", (0, 0), (-1, -1), 0),
        ("RIGHTPADDING", (0, 0), (-1, -1), 2 * _PADDING),
        ("TOPPADDING", (0, 0), (-1, -1), 2),
        ("BOTTOMPADDING", (0, 0), (-1, -1), 2.5),
    ]
    for row, mark in enumerate(table.marks, 1):
        if mark in colours.VERDICT_COLOURS and mark != "unknown":
            colour = colors.HexColor(colours.VERDICT_COLOURS[mark])
            rules.append(("LINEBEFORE", (1, row), (1, row), 1.5, colour))
            rules.append(("LEFTPADDING", (1, row), (1, row), _PADDING))
    return rules


_LONGEST_WORD_POINTS = 110.0
_SLACK_POINTS = 1.0


def widths(table: Table, room: float, size: float, padding: float) -> list[float]:
    """Points of each column, together at most `room`.

    Narrow columns stand on one line; the wide ones share what is left, none narrower than its
    longest word as far as there is room. Words longer than a column are broken.
    """
    columns = list(zip(table.headings, *table.rows, strict=True))
    whole = [padding + max(_width(cell, size) for cell in column) for column in columns]
    if sum(whole) <= room:
        return whole
    least = [padding + max(_longest_word(cell, size) for cell in column) for column in columns]
    if sum(least) >= room:
        return [each * room / sum(least) for each in least]
    return _shared(whole, least, room)


def _shared(whole: Sequence[float], least: Sequence[float], room: float) -> list[float]:
    """The narrow first: each gets an equal share of what is left, or less if it wants less."""
    given = list(least)
    left = room - sum(least)
    ascending = sorted(range(len(whole)), key=lambda column: whole[column] - least[column])
    for place, column in enumerate(ascending):
        more = min(whole[column] - least[column], left / (len(whole) - place))
        given[column] += more
        left -= more
    return given


def _width(cell: str, size: float) -> float:
    # Headings stand in bold, which is the wider: measured so, no cell is too narrow.
    return fonts.width(cell, fonts.BOLD, size) + _SLACK_POINTS


def _longest_word(cell: str, size: float) -> float:
    words: Sequence[str] = cell.split() or [""]
    return min(max(_width(word, size) for word in words), _LONGEST_WORD_POINTS)
