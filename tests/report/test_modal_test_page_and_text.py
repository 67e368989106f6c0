"""The sheet of one test as a page and in a terminal."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import pytest

from shm import documents
from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.contents import ModalTestReport
from shm.report.modal_test_report import modal_test_json, modal_test_paper
from shm.report.shared_tables import headline
from shm.values import QualityCheck
from tests.report.outline import Outline
from tests.report.sheets import (
    ambient,
    given_responses,
    make_sheet,
    one_sensor,
    refused,
    warned,
)

CASES: dict[str, Callable[[], ModalTestReport]] = {
    "dropped": lambda: warned(make_sheet(hits=6, dropped={2: "double hit"})),
    "refused": lambda: refused(make_sheet()),
    "given responses": given_responses,
    "one sensor": one_sensor,
    "ambient": ambient,
}

PAGES = ["dropped", "given responses"]


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return {name: as_html(modal_test_paper(CASES[name]())) for name in PAGES}


@pytest.fixture(scope="module")
def outlines(pages: dict[str, str]) -> dict[str, Outline]:
    parsed = {name: Outline() for name in pages}
    for name, page in pages.items():
        parsed[name].feed(page)
    return parsed


def told(outline: Outline) -> str:
    return " ".join(" ".join(outline.words).split())


def test_the_page_begins_with_how_far_it_can_be_used(
    outlines: dict[str, Outline],
) -> None:
    page = told(outlines["dropped"])
    paragraph = page[page.index("In short") : page.index("Modes and quality")]
    for words in (
        "Excluded, as they are no modes of the hanger: harmonic at 11.6 Hz, tone at 50 Hz and",
        "The modes can be used with care: 2 of 4 checks warn (double hits and tones)",
        "Next: Hit freely. Move the cables",
    ):
        assert words in paragraph


def test_the_page_holds_every_number_that_a_person_checks(outlines: dict[str, Outline]) -> None:
    page = told(outlines["dropped"])
    for words in (
        "transverse 1 5.8000 0.001 0.400 0.02 0.4",
        "harmonic 11.600 0.4000 twice the frequency of transverse 1",
        "tone 50.000 not known mains",
        "2 made.csv 4.500 950 no: double hit",
        "poles 41 not stable over the model orders",
        "double hits ! warning 1 hits 0 hits hit 2 struck twice Hit freely.",
        "cross-check ? unknown not known 0.2 %",
        "transverse order 4 was not found; the others keep their numbers",
        "2 to 90 Hz",
        "hit level over reference level 0.97",
        "Hanger 3 (north), 12 m, nominal tension 711 kN",
    ):
        assert words in page, words


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("refused", "Do not use it: refused by noise. Next: Hit harder."),
        ("ambient", "Its quality was not checked: judge by the figures before using the modes."),
    ],
)
def test_the_paragraph_fits_every_kind_of_test(name: str, words: str) -> None:
    assert words in " ".join(as_text(modal_test_paper(CASES[name]())).split())


def test_a_test_of_good_checks_is_trusted() -> None:
    sheet = make_sheet(hits=1)
    checks = (
        QualityCheck("clipping", "good", 0.2, 0.95, "", "sound"),
        QualityCheck("coherence", "unknown", float("nan"), 0.8, "", "one hit gives none"),
    )
    sheet = replace(sheet, identification=replace(sheet.identification, quality=checks))
    text = " ".join(as_text(modal_test_paper(sheet)).split())
    assert "the one check that could be made is good" in text
    assert "Nothing needs doing before using them." in text
    assert "1 further check good." in text
    assert text.startswith("Test t1, Hanger 3 (north): Good")


def test_the_text_tells_doubts_in_full_and_counts_good_checks() -> None:
    text = " ".join(as_text(modal_test_paper(CASES["dropped"]())).split())
    assert "double hits ! warning 1 hits 0 hits hit 2 struck twice Hit freely." in text
    assert "clipping" not in text
    assert "2 further checks good." in text
    assert "1 transverse order 4 was not found" in text
    assert "LEFT OUT what how many why" in text


def test_the_document_survives_json_and_holds_what_the_page_tells() -> None:
    document = json.loads(documents.dump(modal_test_json(CASES["dropped"]())))
    assert document["schema"] == "shm.test-sheet/1"
    assert document["verdict"] == "warning"
    assert document["test"]["modes"][0]["frequency_hz"] == 5.8
    assert [check["verdict"] for check in document["quality"]].count("warning") == 2
    assert document["quality"][-1]["value"] is None
    assert document["set_aside"][1] == {
        "kind": "tone", "frequency_hz": 50.0, "damping_ratio": None, "reason": "mains",
        "plane": None, "frequency_sd_hz": None, "damping_sd": None,
    }  # fmt: skip
    assert document["hits"][1]["reason"] == "double hit"
    assert document["band_hz"] == [2.0, 90.0]


def test_the_headline_names_a_missing_first_order() -> None:
    lost = QualityCheck("first orders", "warning", 1, 0, "", "transverse order 1 not found", "Hit.")
    good = QualityCheck("noise", "good", 30, 20, "dB", "quiet")
    assert headline([good, lost]) == "Use with care: transverse order 1 not found"
    assert headline([good]) == "Good"
