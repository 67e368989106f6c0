"""A paper as the bytes of a PDF file: A4, the same bytes for the same content."""

from __future__ import annotations

import io
from datetime import UTC
from typing import Any

from reportlab.lib import colors
from reportlab.lib.pagesizes import A4
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import BaseDocTemplate, CallerMacro, Flowable, Frame, PageTemplate

from shm.report import colours
from shm.report.paper import fonts
from shm.report.paper.content import Paper
from shm.report.paper.setting import WIDTH, flowables

_PAGE_WIDTH, _PAGE_HEIGHT = A4
_SIDE = (_PAGE_WIDTH - WIDTH) / 2
_TOP, _BOTTOM = 22 * mm, 20 * mm
_LINE_SIZE = 7.4
_NUMBER_OF_PAGES = "number-of-pages"
_UNDATED = "D:20000101000000Z"


def made(paper: Paper) -> bytes:
    """The document with its fonts, figures, outline and properties inside."""
    fonts.register()
    buffer = io.BytesIO()
    document = BaseDocTemplate(
        buffer,
        pagesize=A4,
        title=paper.name,
        author=f"shm {paper.version}".rstrip(),
        subject=f"{paper.status}: {paper.name}" if paper.status else paper.name,
        creator=f"shm {paper.version}".rstrip(),
        keywords=["bridge hangers", "tension", "hammer test"],
        lang="en",
        displayDocTitle=True,
        invariant=1,
        initialFontName=fonts.PLAIN,
    )
    frame = Frame(
        _SIDE, _BOTTOM, WIDTH, _PAGE_HEIGHT - _TOP - _BOTTOM,
        leftPadding=0, rightPadding=0, topPadding=0, bottomPadding=0,
    )  # fmt: skip

    def around(canvas: Canvas, _: BaseDocTemplate) -> None:
        _around(canvas, paper)

    document.addPageTemplates(PageTemplate("page", [frame], onPage=around))
    document.build([*flowables(paper), _counted()])
    return buffer.getvalue()


def _around(canvas: Canvas, paper: Paper) -> None:
    """Header and footer of one page; how many there are is filled in at the last."""
    canvas.setDateFormatter(lambda *_: _made_at(paper))
    canvas.saveState()
    canvas.setFont(fonts.PLAIN, _LINE_SIZE)
    canvas.setFillColor(colors.HexColor(colours.QUIET))
    canvas.setStrokeColor(colors.HexColor(colours.GRID))
    right, top, bottom = _SIDE + WIDTH, _PAGE_HEIGHT - 13 * mm, 11 * mm
    canvas.drawString(_SIDE, top, _cut(paper.bridge))
    canvas.drawRightString(right, top, _cut(paper.title))
    canvas.line(_SIDE, top - 2 * mm, right, top - 2 * mm)
    canvas.line(_SIDE, bottom + 4 * mm, right, bottom + 4 * mm)
    canvas.drawString(_SIDE, bottom, paper.made)
    page = f"Page {canvas.getPageNumber()} of "
    room = fonts.width("00", fonts.PLAIN, _LINE_SIZE)
    canvas.drawRightString(right - room, bottom, page)
    canvas.translate(right - room, bottom)
    canvas.doForm(_NUMBER_OF_PAGES)
    canvas.restoreState()


def _counted() -> Flowable:
    """Stands last and fills in how many pages there are."""

    def fill_in(macro: Any) -> None:
        canvas: Canvas = macro.canv
        pages = str(canvas.getPageNumber())
        canvas.beginForm(_NUMBER_OF_PAGES)
        canvas.setFont(fonts.PLAIN, _LINE_SIZE)
        canvas.setFillColor(colors.HexColor(colours.QUIET))
        canvas.drawString(0, 0, pages)
        canvas.endForm()

    return CallerMacro(drawCallable=fill_in)


def _made_at(paper: Paper) -> str:
    return (
        f"D:{paper.generated_at.astimezone(UTC):%Y%m%d%H%M%S}Z" if paper.generated_at else _UNDATED
    )


def _cut(text: str, room: float = WIDTH / 2 - 4 * mm) -> str:
    """As much of `text` as stands on its half of the line."""
    if fonts.width(text, fonts.PLAIN, _LINE_SIZE) <= room:
        return text
    while text and fonts.width(f"{text}…", fonts.PLAIN, _LINE_SIZE) > room:
        text = text[:-1]
    return f"{text}…"
