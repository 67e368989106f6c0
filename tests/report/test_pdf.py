"""Reports as PDF: pages, fonts, properties, the logo, the same bytes for the same content."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from shm.report.as_pdf import WIDTH, _rules, as_pdf, widths
from shm.report.contents import HangerReport
from shm.report.figures import style
from shm.report.hanger_report import hanger_paper
from shm.report.hanger_tables import alerts
from shm.report.paper import Logo, Paper, Section, Table, read_logo
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


def test_pages_are_few_and_named(parsed: Pdf, content: bytes) -> None:
    assert len(parsed.pages) > 2
    for number, page in enumerate(parsed.pages, 1):
        told = " ".join(page.split())
        assert told.startswith("Arch bridge Hanger 3 Made 2026-09-08 10:00 UTC by shm 0.1.0")
        assert f"Page {number} of" in told
    total = [body for body in parsed.objects.values() if b"/Form" in body or b" Tj T*" in body]
    assert any(f"({len(parsed.pages)})".encode() in body for body in total)
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
    for words in ("Revision: not stated", "Prepared by", "Checked by", "Date", "Signature"):
        assert words in parsed.pages[-1]
    assert not any("Appendix" in page or "log10" in page for page in parsed.pages)
    assert b"/Title (Hanger 3, Arch bridge)" in content
    assert b"/CreationDate (D:20260908100000Z)" in content
    assert b"/Lang (en)" in content
    for heading in (b"In short", b"Tension over time", b"Fit of the model", b"Gap diagnosis"):
        assert b"/Title (" + heading + b")" in content
    assert "Alert" in parsed.words


@pytest.mark.usefixtures("unpainted")
def test_words_are_set_as_they_are_in_embedded_fonts(bare: HangerReport) -> None:
    """Names from outside, too."""
    signs = "α → ± ² · ≤ ✓ ✗ – … ° é Ł ω"  # noqa: RUF001
    told = Pdf.parse(as_pdf(hanger_paper(replace(bare, bridge=signs))))
    assert signs in told.words
    used = {name for name in told.fonts if name.startswith(("F1", "F2"))}
    assert all(b"FontFile2" in told._referred(told.fonts[name], b"FontDescriptor") for name in used)
    sly = '<b>&amp;</b> "x" <img src="http://example.org/a.png"/>'
    named = replace(with_now(bare, hanger=replace(bare.hanger, name=sly)), bridge=sly)
    assert sly in Pdf.parse(as_pdf(hanger_paper(named))).words


def test_figures_are_fine_and_numbered(season: HangerReport, content: bytes, parsed: Pdf) -> None:
    widths = [int(width) for width in re.findall(rb"/Subtype /Image.*?/Width (\d+)", content, re.S)]
    assert widths
    assert min(widths) / (WIDTH / 72) >= 200
    parts = [part for part in hanger_paper(season).parts if not part.is_appendix]
    drawn = [item for part in parts for item in part.figures()]
    for number, item in enumerate(drawn, 1):
        assert f"Figure {number}. {item.caption[:40]}" in parsed.words


@pytest.mark.usefixtures("unpainted")
def test_long_tables_and_cells_are_set_in_full(bare: HangerReport, season: HangerReport) -> None:
    """A table goes on under repeated headings; a cell may be longer than a page."""

    def printed(table: Table) -> Pdf:
        paper = Paper("Long", "", "first", [Section("In short", tables=[table])], "That is all.")
        return Pdf.parse(as_pdf(paper))

    (history,) = [
        table
        for part in hanger_paper(replace(bare, trend=season.trend * 12)).parts
        for table in part.tables
        if table.title.startswith("Tests")
    ]
    pages = printed(history).pages
    with_heading = [page for page in pages if "credible interval, kN" in page and "beam2" in page]
    assert len([page for page in with_heading if "t004" in page]) >= 2
    alert = replace(season.alerts[0], message="The tension fell. " * 700)
    assert printed(alerts(replace(bare, alerts=(alert,)))).words.count("fell.") == 700


def test_narrow_columns_keep_one_line_and_wide_ones_share_the_rest() -> None:
    table = Table("t", ("no.", "what was found"), (("12.5 ms", "word " * 80), ("3", "x")))
    narrow, wide = widths(table, 300.0, 8.0, 6.0)
    assert narrow < 60
    assert narrow + wide == pytest.approx(300.0)
    small = Table("t", ("a", "b"), (("1", "2"),))
    assert sum(widths(small, 300.0, 8.0, 6.0)) < 60


@pytest.mark.parametrize(("columns", "marked"), [(1, 0), (2, 1), (3, 1), (5, 1)])
def test_row_mark_has_colour_of_verdict(columns: int, marked: int) -> None:
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


@pytest.mark.parametrize(("form", "kind"), [("PNG", "image/png"), ("JPEG", "image/jpeg")])
def test_a_logo_is_kept_as_it_is_with_its_size(form: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "logo"
    Image.new("RGB", (7, 4)).save(path, form)
    logo = read_logo(path)
    assert logo == Logo(path.read_bytes(), kind, 7, 4)
    head, _, content = logo.as_address.partition(",")
    assert head == f"data:{kind};base64"
    assert base64.b64decode(content) == logo.content


def test_logo_that_cannot_be_read_is_a_fault_that_names_it(tmp_path: Path) -> None:
    assert read_logo(None) == Logo(b"", "", 0, 0, "")
    Image.new("RGB", (7, 4)).save(tmp_path / "b.png", "GIF")
    Image.new("RGB", (70, 40)).save(tmp_path / "c.png", "PNG")
    (tmp_path / "c.png").write_bytes((tmp_path / "c.png").read_bytes()[:60])
    for name, fault in (
        ("a.png", "cannot be read: No such file or directory"),
        ("b.png", "cannot be read: it is no PNG or JPEG image"),
        ("c.png", ""),
    ):
        logo = read_logo(tmp_path / name)
        said = f"Without the logo {name}, which {fault}"
        assert logo.fault == said if fault else logo.fault.startswith(said)
        assert logo.content == b""
