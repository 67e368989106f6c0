"""One paper, three renderers: all it says stands in text, page and PDF, in its order."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import shm.report
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.bridge_report import bridge_paper
from shm.report.contents import BridgeReport, HangerReport
from shm.report.diagnosis_report import diagnosis_paper
from shm.report.hanger_report import hanger_paper
from shm.report.hanger_status import Status
from shm.report.modal_test_report import modal_test_paper
from shm.report.paper import Paper, Section, Table
from shm.watch.neighbours import HangerShift
from shm.watch.words.neighbours_words import bridge_pattern
from tests.helpers.nouns import a_summary
from tests.report.conftest import START
from tests.report.diagnoses import CASES, sheet
from tests.report.outline import page_words, pdf_words
from tests.report.sheets import make_sheet, warned

pytestmark = pytest.mark.usefixtures("unpainted", "drawn_once")
RENDERERS = ("as_text", "as_html", "as_pdf")
WIDE = 100_000
"""Columns with which no line of a text folds."""


def of_hanger(season: HangerReport) -> Paper:
    return hanger_paper(
        replace(season, diagnosis=CASES["led"], gap_watch="The gap has stayed below 0.3 %.")
    )


def of_bridge(season: HangerReport) -> Paper:
    shifts = [
        HangerShift(number, number - 1, START, 700e3, -34e3 if number == 3 else 0.0, 1.5e3)
        for number in range(1, 6)
    ]
    line = a_summary(
        season.hanger, Status.ALERT, season.tension_n, open_alerts=1, drifts=season.drifts
    )
    report = BridgeReport("Arch", (line,), bridge_pattern(shifts, range(1, 7)), "", START, "0.1.0")
    return bridge_paper(replace(report, settings={"seed": "1"}))


KINDS: dict[str, Callable[[HangerReport], Paper]] = {
    "hanger": of_hanger,
    "bridge": of_bridge,
    "diagnosis": lambda _: diagnosis_paper(sheet("led")),
    "sheet": lambda _: modal_test_paper(warned(make_sheet(hits=6, dropped={2: "double hit"}))),
}


@pytest.fixture(scope="module")
def papers(season: HangerReport) -> dict[str, Paper]:
    return {kind: make(season) for kind, make in KINDS.items()}


def unabridged(paper: Paper) -> Paper:
    """With every row in a terminal, too."""
    return replace(
        paper,
        parts=[
            replace(part, tables=[replace(table, terminal_rows=None) for table in part.tables])
            for part in paper.parts
        ],
    )


def texts(paper: Paper, renderer: str) -> Iterator[str]:
    """Everything that a paper says, in reading order, as far as the renderer promises it."""
    if renderer != "as_pdf":
        yield paper.title
    for number, part in enumerate(paper.parts):
        if not (part.is_appendix and renderer == "as_pdf"):
            yield from _texts_of_part(part, renderer, is_first=number == 0)
    yield paper.foot


def _texts_of_part(part: Section, renderer: str, is_first: bool) -> Iterator[str]:
    figures = () if renderer == "as_text" else part.figures()
    told = (*part.paragraphs, part.full_summary, *part.facts, *part.remarks, *figures, *part.tables)
    if not any(told):
        return
    if not is_first or renderer != "as_text":
        yield from (part.title, part.status)
    yield from (*part.paragraphs, part.lead, part.summary)
    if renderer != "as_text":  # whose summary tells them
        yield from (text for fact in part.facts for text in fact)
    yield from part.remarks
    for figure in figures:
        yield from (figure.title, figure.caption)
    for stated in part.tables:
        folds = stated.is_folded and renderer == "as_pdf"
        table = stated.folded() if folds else stated
        yield from (table.title, *table.headings)
        yield from (cell for row in table.rows for cell in row)
        yield table.note


def written(paper: Paper, renderer: str) -> str:
    if renderer == "as_text":
        return as_text(unabridged(paper), WIDE)
    if renderer == "as_pdf":
        return pdf_words(paper)
    return page_words(paper)


def squeezed(text: str) -> str:
    """Without blanks, case and the marks of commands: lines fold where a renderer likes."""
    return "".join(text.split()).replace("`", "").lower()


def first_missing(paper: Paper, renderer: str, found: str) -> str | None:
    """Return the first text of the paper that does not follow those before it.

    A PDF repeats headings and lines over pages, even amid a paragraph: there each word counts.
    """
    place = 0
    for text in texts(paper, renderer):
        for piece in text.split() if renderer == "as_pdf" else [text]:
            at = found.find(squeezed(piece), place)
            if at < 0:
                return text
            place = at + len(squeezed(piece))
    return None


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("renderer", RENDERERS)
def test_renderer_says_all_in_order(kind: str, renderer: str, papers: dict[str, Paper]) -> None:
    paper = papers[kind]
    assert first_missing(paper, renderer, squeezed(written(paper, renderer))) is None


@pytest.mark.parametrize("renderer", RENDERERS)
def test_lost_or_moved_cell_is_found(renderer: str, papers: dict[str, Paper]) -> None:
    paper = papers["diagnosis"]
    *parts, last = paper.parts
    (first, *others) = last.tables
    lost = replace(first, rows=first.rows[:-1])
    turned = replace(first, rows=first.rows[::-1])
    for table in (lost, turned):
        found = written(
            replace(paper, parts=[*parts, replace(last, tables=[table, *others])]), renderer
        )
        assert first_missing(paper, renderer, squeezed(found)) is not None


@pytest.mark.parametrize("kind", KINDS)
def test_kind_leads_with_state_and_fits(kind: str, papers: dict[str, Paper]) -> None:
    paper = papers[kind]
    assert paper.parts[0].title == "In short"
    assert paper.parts[0].full_summary
    assert paper.status
    assert as_text(paper).splitlines()[0] == paper.headline
    assert f"<title>{paper.headline}</title>" in as_html(paper)
    for width in (100, 72):
        assert max(map(len, as_text(paper, width).splitlines())) <= width


def test_a_terminal_says_how_many_rows_it_leaves_out() -> None:
    rows = tuple((str(number), "x") for number in range(30))
    long = Table("Long", ("no.", "what"), rows, note="A note.")
    told = as_text(_paper(long.shortened(5, last=2)))
    assert "A note. ... and 25 more rows (in HTML and JSON)." in told
    assert [line.split()[0] for line in told.splitlines() if line.endswith("  x")] == [
        "0", "1", "2", "28", "29",
    ]  # fmt: skip
    assert replace(long, rows=rows[:6]).shortened(5).terminal_rows is None
    assert "LONG" not in as_text(_paper(long.not_in_terminal()))
    only = as_text(_paper(replace(long, terminal_rows=(), hidden_note="{} checks good.")))
    assert "LONG\n30 checks good.\n" in only


def test_a_part_that_has_nothing_is_not_headed() -> None:
    paper = replace(_paper(Table("t", ("a",), (("1",),))), parts=[
        Section("In short", summary="All."), Section("Figures"), Section("Numbers", tables=()),
    ])  # fmt: skip
    assert "Figures" not in as_text(paper)
    assert "Figures" not in as_html(paper)
    assert "Figures" not in pdf_words(paper)


def _paper(table: Table) -> Paper:
    return Paper("Title", "", "first", [Section("In short", tables=[table])], "The end.")


@pytest.mark.parametrize("module", ["paper", *RENDERERS])
def test_the_model_and_its_renderers_know_no_kind_of_report(module: str) -> None:
    source = Path(shm.report.__file__).with_name(f"{module}.py").read_text()
    imported = {
        node.module
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("shm.report.")
    }
    figures = {"shm.report.figures.specification", "shm.report.figures.style"}
    assert imported <= {"shm.report.paper", *figures}
