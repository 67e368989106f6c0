"""The report of a whole bridge, and what a hanger's report says of those beside it."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.bridge_report import bridge_json, bridge_paper
from shm.report.contents import BridgeReport, HangerReport
from shm.report.formatting import Interval
from shm.report.hanger_sentences import summary
from shm.report.hanger_status import Status
from shm.report.hanger_tables import neighbours
from shm.values import Hanger
from shm.watch.neighbours import BridgePattern, HangerShift
from shm.watch.neighbours_words import bridge_pattern
from tests.helpers.nouns import a_change, a_summary, with_now
from tests.report.outline import Outline

NOW = datetime(2026, 5, 1, tzinfo=UTC)
MOVED = {2: 16e3, 3: -34e3, 4: 17e3}


@pytest.fixture(scope="module")
def pattern() -> BridgePattern:
    shifts = [HangerShift(i, i - 1, NOW, 700e3, MOVED.get(i, 0.0), 1.5e3) for i in range(1, 9)]
    return bridge_pattern(shifts, range(1, 10))


@pytest.fixture(scope="module")
def report(hanger: Hanger, pattern: BridgePattern) -> BridgeReport:
    tension = Interval(666e3, 660e3, 672e3)
    lines = [
        a_summary(
            replace(hanger, id=number),
            Status.ALERT if number == 3 else Status.STEADY,
            tension,
            detected="sudden: tension -4.9 %" if number == 3 else "",
            open_alerts=int(number == 3),
        )
        for number in range(1, 9)
    ]
    untested = a_summary(replace(hanger, id=9))
    return BridgeReport("Arch", (*lines, untested), pattern, "", NOW, "0.1.0")


def test_the_text_tells_states_shifts_and_the_explanation(report: BridgeReport) -> None:
    told = as_text(bridge_paper(report))
    assert told.startswith("Arch: Alert\n")
    flat = " ".join(told.split())
    assert flat.startswith(
        "Arch: Alert =========== Hanger 3: tension fell by 10.00 ± 0.66 %, beyond"
    )
    assert "Load has moved from hanger 3 to its neighbours. Hanger 3 lost 34" in flat
    assert "-34.0 (-36.5 to -31.5)" in told
    assert not re.search(r"\b(nan|None)\b", told)
    assert max(map(len, told.splitlines())) <= 100


def test_the_page_has_the_elevation_without_being_asked(report: BridgeReport) -> None:
    page, parsed = as_html(bridge_paper(report)), Outline()
    parsed.feed(page)
    assert parsed.open == []
    assert [tag for tag, _ in parsed.tags].count("svg") == 2
    assert "Hanger 3 lost 34" in page
    assert "&lt;===" not in page


def test_without_a_pattern_the_hangers_are_told_and_why(report: BridgeReport) -> None:
    few = replace(report, pattern=None, why_no_pattern="Nothing can be compared: too few.")
    assert "compared: too few." in " ".join(as_text(bridge_paper(few)).split())
    assert as_html(bridge_paper(few)).count("<svg") == 1
    document = bridge_json(few)
    assert document["pattern"] is None
    assert document["hangers"][2]["status"] == "alert"
    assert document["hangers"][8]["tension_n"] is None


def test_a_hanger_whose_change_is_called_tells_of_those_beside_it(
    season: HangerReport, pattern: BridgePattern
) -> None:
    called = replace(with_now(season, called=(a_change(),)), neighbours=pattern)
    table = neighbours(called)
    assert [row[0] for row in table.rows] == ["1", "2", "3", "4", "5"]
    assert "shm report --bridge" in table.note
    assert "Load has moved from hanger 3" in summary(called)
    assert neighbours(season).rows == ()


def test_a_hanger_whose_tension_is_hardly_known_is_to_be_tested_for_more_modes(
    report: BridgeReport,
) -> None:
    first, *rest = report.hangers
    wide = a_summary(first.hanger, Status.STEADY, Interval(700e3, 400e3, 1900e3))
    told = " ".join(as_text(bridge_paper(replace(report, hangers=(wide, *rest)))).split())
    assert "Identify more modes of hanger 1: the interval of the tension is wider than half" in told
    assert "Identify more modes" not in as_text(bridge_paper(report))
