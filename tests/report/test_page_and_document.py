"""The HTML file and the JSON document."""

from __future__ import annotations

import json as standard_json
import re
from dataclasses import replace
from itertools import pairwise

import pytest

from shm import documents
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.contents import HangerReport
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.values import QualityCheck
from tests.helpers.nouns import with_now
from tests.report.outline import Outline


@pytest.fixture(scope="module")
def page(season: HangerReport) -> str:
    return as_html(hanger_paper(season))


@pytest.fixture(scope="module")
def outline(page: str) -> Outline:
    parsed = Outline()
    parsed.feed(page)
    return parsed


def test_the_page_nests_and_names_its_language(outline: Outline) -> None:
    assert outline.open == []
    assert dict(outline.tags)["html"] == {"lang": "en"}


def test_the_page_fetches_nothing(page: str, outline: Outline) -> None:
    for tag, attributes in outline.tags:
        assert tag not in {"script", "link", "iframe"}
        assert not {"src", "srcset", "data", "action"} & attributes.keys()
    assert not re.search(r"url\((?!#)|@import", page)


def test_every_figure_has_a_heading_a_drawing_and_a_caption(outline: Outline) -> None:
    names = [tag for tag, _ in outline.tags]
    assert names.count("figure") == names.count("figcaption") == names.count("svg") == 5


def test_ids_are_unique_on_the_page(outline: Outline) -> None:
    ids = [attributes["id"] for _, attributes in outline.tags if "id" in attributes]
    assert len(ids) == len(set(ids))


def test_every_table_has_a_caption_and_scoped_headings(outline: Outline) -> None:
    names = [tag for tag, _ in outline.tags]
    assert names.count("table") == names.count("caption") == 11
    scopes = {attributes.get("scope") for tag, attributes in outline.tags if tag == "th"}
    assert scopes == {"col", "row"}


def test_headings_do_not_skip_a_level(outline: Outline) -> None:
    levels = [int(tag[1]) for tag, _ in outline.tags if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_the_page_leads_with_the_summary_and_the_state(outline: Outline) -> None:
    told = " ".join(" ".join(outline.words).split())
    assert told.index("tension fell by 7.2 ± 2.0 %") < told.index("Tension over time")
    assert "Alert" in told


def test_names_from_outside_cannot_inject_markup(bare: HangerReport) -> None:
    sly = "<script>alert(1)</script>"
    page = as_html(
        hanger_paper(replace(with_now(bare, hanger=replace(bare.hanger, name=sly)), bridge=sly))
    )
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_the_document_survives_json_and_holds_the_contract(season: HangerReport) -> None:
    document = standard_json.loads(documents.dump(hanger_json(season)))
    assert document["schema"] == "shm.report/1"
    assert document["posterior"] == standard_json.loads(
        documents.dump(documents.posterior_document(season.posterior))
    )
    assert document["status"] == "alert"
    assert len(document["trend"]) == 10
    assert set(document["trend"][0]["tension_n"]) == {
        "mean", "low", "high", "repeatability_sd",
    }  # fmt: skip
    assert document["selection"]["selected"] == "beam2"
    assert document["drifts"][0]["quantity"] == "tension"
    assert document["generated_at"] == "2026-09-08T10:00:00Z"


def test_unknown_numbers_become_null_in_the_document(bare: HangerReport) -> None:
    document = standard_json.loads(documents.dump(hanger_json(bare)))
    assert document["baseline"] is None
    assert document["selection"] is None
    assert document["posterior"]["r_hat"] is None
    assert document["test"]["temperature_c"] is None


def test_the_quality_of_the_latest_test_stands_in_page_text_document_and_advice(
    bare: HangerReport,
) -> None:
    check = QualityCheck("clipping", "warning", 0.99, 0.95, "", "acc_1 clips", "Lower the gain.")
    judged = replace(bare, quality=(check,))
    parsed = Outline()
    parsed.feed(as_html(hanger_paper(judged)))
    told = " ".join(" ".join(parsed.words).split())
    for page in (told, " ".join(as_text(hanger_paper(judged)).split())):
        assert "clipping ! warning 0.99 0.95 acc_1 clips Lower the gain." in page
        assert "Test quality, to improve at the next test: clipping." in page
    assert ("tr", {"class": "warning"}) in parsed.tags
    document = standard_json.loads(documents.dump(hanger_json(judged)))
    assert document["quality"][0]["name"] == "clipping"
    assert document["quality"][0]["verdict"] == "warning"
