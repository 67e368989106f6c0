"""Reports as PDF: pages, fonts, properties, the same bytes for the same content."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from shm.report.as_pdf import WIDTH, _rules, as_pdf, widths
from shm.report.contents import HangerReport
from shm.report.figures import style
from shm.report.hanger_report import hanger_paper
from shm.report.hanger_tables import alerts
from shm.report.paper import Paper, Section, Table
from tests.helpers.nouns import with_now
from tests.helpers.painting import paint_blank
from tests.helpers.pdf_words import Pdf


@pytest.fixture(scope="module")
def content(season: HangerReport) -> bytes:
    with pytest.MonkeyPatch.context() as patch:
        paint_blank(patch)
        return as_pdf(hanger_paper(season))


@pytest.fixture(scope="module")
def parsed(content: bytes) -> Pdf:
    return Pdf.parse(content)


@pytest.mark.usefixtures("unpainted")
def test_the_same_content_gives_the_same_bytes(bare: HangerReport) -> None:
    first = as_pdf(hanger_paper(bare))
    assert first == as_pdf(hanger_paper(bare))
    assert first != as_pdf(hanger_paper(replace(bare, bridge="Another bridge")))


def test_every_page_names_bridge_hanger_version_and_its_number(parsed: Pdf) -> None:
    assert len(parsed.pages) > 2
    for number, page in enumerate(parsed.pages, 1):
        told = " ".join(page.split())
        assert told.startswith("Arch bridge Hanger 3 Made 2026-09-08 10:00 UTC by shm 0.1.0")
        assert f"Page {number} of" in told
    total = [body for body in parsed.objects.values() if b"/Form" in body or b" Tj T*" in body]
    assert any(f"({len(parsed.pages)})".encode() in body for body in total)


def test_a_hanger_has_at_most_five_pages_of_which_the_first_says_what_to_do(parsed: Pdf) -> None:
    assert len(parsed.pages) <= 5
    first = " ".join(parsed.pages[0].split())
    for words in (
        "tension fell by 7.2 ± 2.0 %",
        "Repeat the hammer test today",
        "650 ± 19 kN",
        "Sensors and hits",
        "The bar as described",
        "Formulas of practice",
        "ours, by all modes of the same test",
    ):
        assert words in first
    assert "Prepared by" in parsed.pages[-1]
    assert not any("Appendix" in page or "log10" in page for page in parsed.pages)


def test_it_has_a_title_properties_an_outline_and_a_language(content: bytes, parsed: Pdf) -> None:
    assert b"/Title (Hanger 3, Arch bridge)" in content
    assert b"/CreationDate (D:20260908100000Z)" in content
    assert b"/Lang (en)" in content
    for heading in (b"In short", b"Tension over time", b"Fit of the model", b"Gap diagnosis"):
        assert b"/Title (" + heading + b")" in content
    assert "Alert" in parsed.words


@pytest.mark.usefixtures("unpainted")
def test_its_words_are_set_in_embedded_fonts_that_hold_every_sign(bare: HangerReport) -> None:
    signs = "α → ± ² · ≤ ✓ ✗ – … ° é Ł ω"  # noqa: RUF001
    told = Pdf.parse(as_pdf(hanger_paper(replace(bare, bridge=signs))))
    assert signs in told.words
    used = {name for name in told.fonts if name.startswith(("F1", "F2"))}
    assert all(b"FontFile2" in told._referred(told.fonts[name], b"FontDescriptor") for name in used)


def test_figures_are_as_fine_as_print_needs_and_have_numbered_captions(
    season: HangerReport, content: bytes, parsed: Pdf
) -> None:
    widths = [int(width) for width in re.findall(rb"/Subtype /Image.*?/Width (\d+)", content, re.S)]
    assert widths
    assert min(widths) / (WIDTH / 72) >= 200
    parts = [part for part in hanger_paper(season).parts if not part.is_appendix]
    drawn = [item for part in parts for item in part.figures()]
    for number, item in enumerate(drawn, 1):
        assert f"Figure {number}. {item.caption[:40]}" in parsed.words


@pytest.mark.usefixtures("unpainted")
def test_a_long_table_goes_on_under_repeated_headings(
    bare: HangerReport, season: HangerReport
) -> None:
    (history,) = [
        table
        for part in hanger_paper(replace(bare, trend=season.trend * 12)).parts
        for table in part.tables
        if table.title.startswith("Tests")
    ]
    paper = Paper("Long", "", "first", [Section("In short", tables=[history])], "That is all.")
    pages = Pdf.parse(as_pdf(paper)).pages
    with_heading = [page for page in pages if "credible interval, kN" in page and "beam2" in page]
    assert len([page for page in with_heading if "t004" in page]) >= 2


@pytest.mark.usefixtures("unpainted")
def test_a_cell_longer_than_a_page_is_set(bare: HangerReport, season: HangerReport) -> None:
    alert = replace(season.alerts[0], message="The tension fell. " * 700)
    table = alerts(replace(bare, alerts=(alert,)))
    paper = Paper("Long", "", "first", [Section("In short", tables=[table])], "That is all.")
    assert Pdf.parse(as_pdf(paper)).words.count("fell.") == 700


@pytest.mark.usefixtures("unpainted")
def test_names_from_outside_are_set_as_they_are(bare: HangerReport) -> None:
    sly = '<b>&amp;</b> "x" <img src="http://example.org/a.png"/>'
    told = Pdf.parse(
        as_pdf(
            hanger_paper(replace(with_now(bare, hanger=replace(bare.hanger, name=sly)), bridge=sly))
        )
    )
    assert sly in told.words


def test_narrow_columns_keep_one_line_and_wide_ones_share_the_rest() -> None:
    table = Table("t", ("no.", "what was found"), (("12.5 ms", "word " * 80), ("3", "x")))
    narrow, wide = widths(table, 300.0, 8.0, 6.0)
    assert narrow < 60
    assert narrow + wide == pytest.approx(300.0)
    small = Table("t", ("a", "b"), (("1", "2"),))
    assert sum(widths(small, 300.0, 8.0, 6.0)) < 60


@pytest.mark.parametrize(("columns", "marked"), [(1, 0), (2, 1), (3, 1), (5, 1)])
def test_a_rows_mark_stands_before_its_second_cell_in_the_colour_of_its_verdict(
    columns: int, marked: int
) -> None:
    verdicts = ("good", "unknown", "refused", "best", "warning")
    row = ("x",) * columns
    table = Table("t", row, (row,) * len(verdicts), marks=verdicts)
    drawn = [
        (*at, colour.hexval()[2:])
        for name, at, _, *_, colour in _rules(table)
        if name == "LINEBEFORE"
    ]
    coloured = [(n, v) for n, v in enumerate(verdicts, 1) if v not in ("unknown", "best")]
    assert drawn == [
        (marked, line, style.VERDICT_COLOURS[verdict][1:].lower())  # type: ignore[index]
        for line, verdict in coloured
    ]
