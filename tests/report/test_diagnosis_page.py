"""A gap diagnosis as a page, in a terminal, as a document and inside a hanger's report."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest

from shm import documents
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.diagnosis_report import diagnosis_json, diagnosis_paper
from shm.report.diagnosis_summary import facts
from shm.report.hanger_report import hanger_json as report_json
from shm.report.hanger_report import hanger_paper
from tests.report.diagnoses import LED, STRING_HANGER, sheet
from tests.report.outline import Outline

PAGES = ("led", "alike", "nothing known")


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return {name: as_html(diagnosis_paper(sheet(name))) for name in PAGES}


def parsed(page: str) -> Outline:
    outline = Outline()
    outline.feed(page)
    return outline


def told(outline: Outline) -> str:
    return " ".join(" ".join(outline.words).split())


def test_the_page_leads_with_the_cause_its_size_place_and_probability(
    pages: dict[str, str],
) -> None:
    page = told(parsed(pages["led"]))
    verdict = "The gap is explained by point mass, probability 0.93;"
    cause = "The cause: a point mass of 12 kg (9 to 15) at 3.4 m (3.1 to 3.7)."
    assert page.index("Explained") < page.index(verdict) < page.index(cause)
    assert page.index(cause) < page.index("What causes the gap")


def test_remarks_on_bad_data_stand_beside_the_answer(pages: dict[str, str]) -> None:
    page = told(parsed(pages["led"]))
    assert page.index("transverse 9 and 10 are out of order") < page.index("What causes the gap")
    assert "What to mind about these data" not in told(parsed(pages["alike"]))


def test_a_shortened_table_of_causes_keeps_no_gap_and_something_else() -> None:
    text = as_text(diagnosis_paper(sheet("led")))
    table = text[text.index("CAUSES") : text.index("SIZES")]
    assert "no gap" in table
    assert "something not in" in table
    assert "9 further effects" in " ".join(table.split())


def test_the_document_holds_the_contract_and_the_answer_in_words() -> None:
    document = json.loads(documents.dump(diagnosis_json(sheet("led"))))
    assert document["answer"] == "explained"
    assert document["summary"].startswith("The gap is explained by point mass")
    assert document["details"].startswith("The cause: a point mass of 12 kg")
    assert document["causes"][0]["effect"] == "point_mass"
    assert document["tension_n"]["after"]["mean"] == pytest.approx(702.3e3)


def test_a_report_without_diagnosis_says_how_to_make_one(bare: HangerReport) -> None:
    for written in (
        told(parsed(as_html(hanger_paper(bare)))),
        " ".join(as_text(hanger_paper(bare)).split()),
    ):
        assert "shm gap diagnose --hanger 3" in written
    assert report_json(bare)["diagnosis"] is None


def test_a_report_holds_the_latest_diagnosis_and_how_the_gap_has_gone(bare: HangerReport) -> None:
    watched = "beam1 with point mass, adopted 2026-05-01: gap 2.30 % before, 0.62 % now."
    diagnosed = replace(bare, diagnosis=LED, gap_watch=watched)
    outline = parsed(as_html(hanger_paper(diagnosed)))
    assert outline.open == []
    names = {attributes.get("id") for _, attributes in outline.tags}
    assert {"causes-title", "gap_map-title"} <= names
    for written in (told(outline), " ".join(as_text(hanger_paper(diagnosed)).split())):
        assert "explained by point mass" in written
        assert watched in written
        assert "has not been diagnosed" not in written
    document = report_json(diagnosed)
    assert document["diagnosis"]["causes"][0]["effect"] == "point_mass"
    assert document["gap_watch"] == watched


def test_an_excluded_frequency_leads_the_table() -> None:
    text = as_text(diagnosis_paper(sheet("blunder")))
    rows = text[text.index("WHERE THE GAP LIES") :].splitlines()
    marked = [line for line in rows if "excluded" in line]
    assert len(marked) == 1
    assert marked[0].split()[:3] == ["transverse", "3", "t4"]
    others = [line for line in rows if re.search(r" t\d ", line) and line is not marked[0]]
    assert rows.index(marked[0]) < rows.index(others[0])


def test_the_figures_on_top_have_intervals_and_no_endless_number() -> None:
    found = facts(DiagnosisSheet(replace(LED, fit_p_value=1e-29), STRING_HANGER))
    told = {what: (value, beside) for what, value, beside in found}
    assert told["What is left"] == (
        "more than the errors",
        "posterior predictive p-value < 0.01",
    )
    assert told["Tension"] == (
        "702 ± 12 kN",
        "averaged over all explanations; baseline alone 731.4 ± 3.4 kN",
    )
