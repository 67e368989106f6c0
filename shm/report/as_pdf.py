"""A paper as the bytes of a PDF file: A4, the same bytes for the same content.

The fonts are DejaVu Sans as matplotlib ships it, which holds every sign that we use.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from datetime import UTC
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import matplotlib
from reportlab.lib import colors
from reportlab.lib.fonts import addMapping
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import (
    BaseDocTemplate,
    CallerMacro,
    CondPageBreak,
    Flowable,
    Frame,
    Image,
    KeepTogether,
    PageTemplate,
    Paragraph,
    Spacer,
)
from reportlab.platypus import Table as SetTable

from shm.report.figures.specification import Illustration
from shm.report.figures.style import GRID, INK, QUIET, STATUS_COLOURS, VERDICT_COLOURS
from shm.report.paper import Fact, Paper, Section, Table
from shm.values.rounding import unbroken

# Layout of an A4 page, in points unless it says mm: margins for a binder, type that reads on paper.
WIDTH = 174 * mm
DOTS_PER_INCH = 220
_PAGE_WIDTH, _PAGE_HEIGHT = A4
_SIDE = (_PAGE_WIDTH - WIDTH) / 2
_TOP, _BOTTOM = 22 * mm, 20 * mm
_TALLEST = 200 * mm
_LEAST_OF_TABLE = 40 * mm  # heading, title and some rows: less of a table goes on a new page
_PADDING = 4.0
_CELL_SIZE, _LINE_SIZE = 7.6, 7.4
_PLAIN, _BOLD = "DejaVuSans", "DejaVuSans-Bold"
_NUMBER_OF_PAGES = "number-of-pages"
_UNDATED = "D:20000101000000Z"
_INK, _QUIET, _GRID = (colors.HexColor(each) for each in (INK, QUIET, GRID))
_PANEL = colors.HexColor("#f4f6f9")


@cache
def _register_fonts() -> None:
    """Make the fonts known to reportlab, which embeds the signs that a document uses."""
    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    for name in (_PLAIN, _BOLD):
        pdfmetrics.registerFont(TTFont(name, folder / f"{name}.ttf"))
    for is_bold in (0, 1):
        for is_italic in (0, 1):
            addMapping(_PLAIN, is_bold, is_italic, _BOLD if is_bold else _PLAIN)


def _letters(name: str, size: float, font: str = _PLAIN, **more: Any) -> ParagraphStyle:
    settings = {"textColor": _INK, "leading": 1.35 * size, "bulletFontName": font, **more}
    return ParagraphStyle(name, fontName=font, fontSize=size, **settings)


# Sizes of type, in points: body 9, each heading a quarter larger than what it heads.
_TITLE = _letters("title", 17, _BOLD, spaceAfter=6)
_HEADING = _letters("heading", 12.5, _BOLD, spaceBefore=12, spaceAfter=6, keepWithNext=1)
_SUBHEADING = _letters("subheading", 9.5, _BOLD, spaceAfter=3, keepWithNext=1)
_LOOSE_SUBHEADING = _letters("loose subheading", 9.5, _BOLD, spaceAfter=3)
_BODY = _letters("body", 9, leading=13.2)
_NOTE = _letters("note", 7.6, textColor=_QUIET, spaceBefore=2, spaceAfter=9)
_REMARK = _letters("remark", 8.6, leftIndent=10, bulletIndent=0, spaceAfter=2)
_CELL = _letters("cell", _CELL_SIZE)
_HEAD = _letters("head", _CELL_SIZE, _BOLD, textColor=_QUIET)
_FACT = _letters("fact", 11, _BOLD)
_LABEL = _letters("label", 7.6, textColor=_QUIET)


def as_pdf(paper: Paper) -> bytes:
    """Return the document with its fonts, figures, outline and properties inside."""
    _register_fonts()
    buffer = io.BytesIO()
    made_by = f"shm {paper.version}".rstrip()
    document = BaseDocTemplate(
        buffer,
        pagesize=A4,
        title=paper.name,
        author=made_by,
        subject=f"{paper.status}: {paper.name}" if paper.status else paper.name,
        creator=made_by,
        keywords=["bridge hangers", "tension", "hammer test"],
        lang="en",
        displayDocTitle=True,
        invariant=1,
        initialFontName=_PLAIN,
    )
    frame = Frame(
        _SIDE, _BOTTOM, WIDTH, _PAGE_HEIGHT - _TOP - _BOTTOM,
        leftPadding=0, rightPadding=0, topPadding=0, bottomPadding=0,
    )  # fmt: skip

    def around(canvas: Canvas, _: BaseDocTemplate) -> None:
        _around(canvas, paper)

    document.addPageTemplates(PageTemplate("page", [frame], onPage=around))
    document.build(_flowables(paper))
    return buffer.getvalue()


def _around(canvas: Canvas, paper: Paper) -> None:
    """Draw header and footer of one page; the number of pages is filled in at the end."""
    made = paper.generated_at
    dated = f"D:{made.astimezone(UTC):%Y%m%d%H%M%S}Z" if made else _UNDATED
    canvas.setDateFormatter(lambda *_: dated)
    canvas.saveState()
    canvas.setFont(_PLAIN, _LINE_SIZE)
    canvas.setFillColor(_QUIET)
    canvas.setStrokeColor(_GRID)
    right, top, bottom = _SIDE + WIDTH, _PAGE_HEIGHT - 13 * mm, 11 * mm
    canvas.drawString(_SIDE, top, _cut(paper.above))
    canvas.drawRightString(right, top, _cut(paper.title))
    canvas.line(_SIDE, top - 2 * mm, right, top - 2 * mm)
    canvas.line(_SIDE, bottom + 4 * mm, right, bottom + 4 * mm)
    canvas.drawString(_SIDE, bottom, paper.made)
    room = _width("00", _PLAIN, _LINE_SIZE)
    canvas.drawRightString(right - room, bottom, f"Page {canvas.getPageNumber()} of ")
    canvas.translate(right - room, bottom)
    canvas.doForm(_NUMBER_OF_PAGES)
    canvas.restoreState()


def _counted() -> Flowable:
    """Return a flowable of the last page, which fills in the number of pages."""

    def fill_in(macro: Any) -> None:
        canvas: Canvas = macro.canv
        pages = str(canvas.getPageNumber())
        canvas.beginForm(_NUMBER_OF_PAGES)
        canvas.setFont(_PLAIN, _LINE_SIZE)
        canvas.setFillColor(_QUIET)
        canvas.drawString(0, 0, pages)
        canvas.endForm()

    return CallerMacro(drawCallable=fill_in)


def _cut(text: str) -> str:
    """Cut `text` to its half of the line."""
    room = WIDTH / 2 - 4 * mm
    if _width(text, _PLAIN, _LINE_SIZE) <= room:
        return text
    while text and _width(f"{text}…", _PLAIN, _LINE_SIZE) > room:
        text = text[:-1]
    return f"{text}…"


def _words(text: str) -> str:
    """Return a text for a paragraph, without the backticks around commands."""
    return escape(unbroken(text.replace("`", "")))


def _flowables(paper: Paper) -> list[Flowable]:
    """Return title, parts and signature in order; figures and tables are numbered."""
    figures, tables = count(1), count(1)
    colour = STATUS_COLOURS[paper.style]
    state = f' <font color="{colour}" size="12">● {escape(paper.status)}</font>'
    body = [
        each
        for part in paper.parts
        if not part.is_appendix
        for each in _part(part, STATUS_COLOURS[part.style or paper.style], figures, tables)
    ]
    signature = [_signature(paper)] if paper.is_signed else []
    return [
        *_logo(paper),
        Paragraph(escape(paper.above), _LABEL),
        Paragraph(escape(paper.title) + (state if paper.status else ""), _TITLE),
        *body,
        *signature,
        KeepTogether([_counted(), Paragraph(escape(paper.foot), _NOTE)]),
    ]


def _logo(paper: Paper) -> list[Flowable]:
    """Return the logo at the right of the first head, as high as its two lines."""
    logo = paper.logo
    if not logo.content:
        return []
    scale = min(12 * mm / logo.height, 60 * mm / logo.width)
    size = (scale * logo.width, scale * logo.height)
    return [Image(io.BytesIO(logo.content), *size, hAlign="RIGHT")]


def _signature(paper: Paper) -> Flowable:
    """Return lines for those who sign the report, with their names where given."""
    signed = paper.signatures
    room = WIDTH / len(signed)
    rules: list[tuple[object, ...]] = [
        ("LINEABOVE", (2 * n, 0), (2 * n, 0), 0.6, _QUIET) for n in range(len(signed))
    ]
    rules.append(("VALIGN", (0, 0), (-1, -1), "TOP"))
    gap = 6 * mm
    cells: list[object] = []
    for word, name in signed:
        cells += [Paragraph(f"{word}<br/>{escape(name)}" if name else word, _LABEL), ""]
    return KeepTogether(
        [
            Spacer(1, 6 * mm),
            Paragraph(escape(paper.revision_line), _BODY),
            Spacer(1, 12 * mm),
            SetTable([cells[:-1]], ([room - gap, gap] * len(signed))[:-1], style=rules),
        ]
    )


def _part(part: Section, colour: str, figures: count[int], tables: count[int]) -> list[Flowable]:
    heading: list[Flowable] = [_mark(part.headline), Paragraph(escape(part.headline), _HEADING)]
    found: list[Flowable] = []
    for paragraph in part.paragraphs:
        found += [Paragraph(_words(paragraph), _BODY), Spacer(1, 6)]
    if part.full_summary:
        lead = f"<b>{_words(part.lead)}</b> " if part.lead else ""
        wording = Paragraph(f"{lead}{_words(part.summary)}", _BODY)
        found += [_panel(wording, colour), Spacer(1, 6)]
    if part.details:
        found += [Paragraph(_words(part.details), _BODY), Spacer(1, 6)]
    if part.facts:
        found += [_facts(part.facts), Spacer(1, 8)]
    if part.remarks:
        found.append(Paragraph(escape(part.remarks_title), _SUBHEADING))
        found += [Paragraph(_words(each), _REMARK, bulletText="•") for each in part.remarks]
        found.append(Spacer(1, 8))
    groups = [_figure(each, next(figures)) for each in part.figures()]
    groups += [_table(each, next(tables)) for each in part.tables]
    if not found and not groups:
        return []
    if groups and not found:
        # Stated, because a heading is not kept with what is itself kept together.
        groups[0], heading = [*heading, *groups[0]], []
    loose = [False] * (len(groups) - len(part.tables)) + [each.may_break for each in part.tables]
    set_groups = [
        each
        for group, is_loose in zip(groups, loose, strict=True)
        for each in (
            [CondPageBreak(_LEAST_OF_TABLE), *group] if is_loose else [KeepTogether(group)]
        )
    ]
    return [*heading, *found, *set_groups]


def _mark(title: str) -> Flowable:
    """Return an entry of the document's outline, kept with the heading that follows."""

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
            Paragraph(_words(value), _FACT),
            Paragraph(_words(besides), _LABEL),
        ]
        for what, value, besides in facts
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
    """Return a table with title and note.

    It breaks over pages, under repeated headings, only where one page does not hold it.
    """
    table = table.folded() if table.is_folded else table
    # What is kept with a table keeps the table in one piece, too.
    style = _LOOSE_SUBHEADING if table.may_break else _SUBHEADING
    title = Paragraph(f"Table {number}. {_words(table.title)}", style)
    rows = [[Paragraph(_words(cell), _HEAD) for cell in table.headings]]
    rows += [[Paragraph(_words(cell), _CELL) for cell in row] for row in table.rows]
    set_table = SetTable(
        rows,
        _widths(table),
        repeatRows=1,
        splitInRow=1,
        hAlign="LEFT",
        style=_rules(table),
    )
    note = Paragraph(_words(table.note), _NOTE) if table.note else Spacer(1, 9)
    return [title, set_table, note]


def _widths(table: Table) -> list[float]:
    """Return points of each column; the one with its row's mark has room for it."""
    mark = _PADDING if table.marks else 0.0
    found = widths(table, WIDTH - mark, _CELL_SIZE, 2 * _PADDING)
    found[_marked(table)] += mark
    return found


def _marked(table: Table) -> int:
    """Return the column that stands for its row's mark: the second, where there is one."""
    return min(1, len(table.headings) - 1)


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
        if mark in VERDICT_COLOURS and mark != "unknown":
            colour, cell = colors.HexColor(VERDICT_COLOURS[mark]), (_marked(table), row)
            rules.append(("LINEBEFORE", cell, cell, 1.5, colour))
            rules.append(("LEFTPADDING", cell, cell, _PADDING))
    return rules


# A column is never wider for one word: a checksum breaks instead.
_LONGEST_WORD_POINTS = 110.0
_SLACK_POINTS = 1.0


def widths(table: Table, room: float, size: float, padding: float) -> list[float]:
    """Return points of each column, together at most `room`.

    Narrow columns stand on one line; the wide ones share what is left, none narrower than its
    longest word as far as there is room. Words longer than a column are broken.
    """
    columns = list(zip(table.headings, *table.rows, strict=True))
    whole = [padding + max(_bold_width(cell, size) for cell in column) for column in columns]
    if sum(whole) <= room:
        return whole
    least = [padding + max(_longest_word(cell, size) for cell in column) for column in columns]
    if sum(least) >= room:
        return [each * room / sum(least) for each in least]
    return _shared(whole, least, room)


def _shared(whole: Sequence[float], least: Sequence[float], room: float) -> list[float]:
    """Share `room` equally among columns, the narrow first; none gets more than it needs."""
    given = list(least)
    left = room - sum(least)
    ascending = sorted(range(len(whole)), key=lambda column: whole[column] - least[column])
    for place, column in enumerate(ascending):
        more = min(whole[column] - least[column], left / (len(whole) - place))
        given[column] += more
        left -= more
    return given


def _longest_word(cell: str, size: float) -> float:
    words: Sequence[str] = cell.split() or [""]
    return min(max(_bold_width(word, size) for word in words), _LONGEST_WORD_POINTS)


def _bold_width(cell: str, size: float) -> float:
    # Headings stand in bold, which is the wider: measured so, no cell is too narrow.
    return _width(cell, _BOLD, size) + _SLACK_POINTS


def _width(text: str, font: str, size: float) -> float:
    """Return the width of a text as it is set, in points."""
    _register_fonts()
    return float(pdfmetrics.stringWidth(text, font, size))
