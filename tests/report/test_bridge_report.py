"""The report of a complete bridge with its figure, and what a hanger's says of its neighbours."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex

from shm.report.as_html import as_html
from shm.report.as_text import as_text
from shm.report.bridge_report import bridge_json, bridge_paper
from shm.report.contents import BridgeReport, HangerReport
from shm.report.figures import style
from shm.report.figures.along_the_bridge import bridge_illustration
from shm.report.formatting import Interval
from shm.report.hanger_sentences import summary
from shm.report.hanger_status import Status
from shm.report.hanger_tables import neighbours
from shm.values import Hanger
from shm.watch.neighbours import BridgePattern, HangerShift
from shm.watch.words.neighbours_words import bridge_pattern
from tests.helpers.nouns import a_change, a_summary, with_now
from tests.report.outline import Outline, flat, text_words

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


def test_bridge_report_tells_states_shifts_and_the_explanation(report: BridgeReport) -> None:
    told = as_text(bridge_paper(report))
    assert told.startswith("Arch: Alert\n")
    lead = "Arch: Alert =========== Hanger 3: tension fell by 10.00 ± 0.66 %, beyond"
    assert flat(told).startswith(lead)
    assert "Load has moved from hanger 3 to its neighbours. Hanger 3 lost 34" in flat(told)
    assert "-34.0 (-36.5 to -31.5)" in told
    assert not re.search(r"\b(nan|None)\b", told)
    assert max(map(len, told.splitlines())) <= 100
    page = as_html(bridge_paper(report))
    assert Outline.of(page).names.count("svg") == 2
    assert "Hanger 3 lost 34" in page
    assert "&lt;===" not in page


def test_without_a_pattern_the_hangers_are_told_and_why(report: BridgeReport) -> None:
    few = replace(report, pattern=None, why_no_pattern="Nothing can be compared: too few.")
    assert "compared: too few." in text_words(bridge_paper(few))
    assert as_html(bridge_paper(few)).count("<svg") == 1
    document = bridge_json(few)
    assert document["pattern"] is None
    assert document["hangers"][2]["status"] == "alert"
    assert document["hangers"][8]["tension_n"] is None


def test_changed_hanger_tells_of_neighbours(season: HangerReport, pattern: BridgePattern) -> None:
    called = replace(with_now(season, called=(a_change(),)), neighbours=pattern)
    table = neighbours(called)
    assert [row[0] for row in table.rows] == ["1", "2", "3", "4", "5"]
    assert "shm report --bridge" in table.note
    assert "Load has moved from hanger 3" in summary(called)
    assert neighbours(season).rows == ()


def test_undetermined_tension_asks_for_modes(report: BridgeReport) -> None:
    first, *rest = report.hangers
    wide = a_summary(first.hanger, Status.STEADY, Interval(700e3, 400e3, 1900e3))
    told = text_words(bridge_paper(replace(report, hangers=(wide, *rest))))
    assert "Identify more modes of hanger 1: the interval of the tension is wider than half" in told
    assert "Identify more modes" not in as_text(bridge_paper(report))


def shifts(count: int) -> list[HangerShift]:
    moved = {6: 16e3, 7: -34e3, 8: 17e3}
    return [
        HangerShift(i, i - 1, NOW, 700e3, moved.get(i, 0.0), 1.5e3)
        for i in range(1, count + 1)
        if i != 3
    ]


def test_elevation_shows_shifts_with_intervals_numbers_and_words() -> None:
    """A loss is orange, a gain blue, rest grey; a hanger without a test a cross; no arch."""
    pattern = bridge_pattern(shifts(12), range(1, 13))
    shown = bridge_illustration(pattern)
    (axes,) = shown.figure.axes
    bars: list[Any] = list(axes.patches)
    colours = {round(b.get_x() + b.get_width() / 2): to_hex(b.get_facecolor()) for b in bars}
    assert (colours[6], colours[0]) == (style.ORANGE, style.QUIET)
    assert colours[5] == colours[7] == style.BLUE
    heights = sorted(bar.get_height() for bar in bars)
    assert heights == pytest.approx(sorted(row.shift_n / 1e3 for row in pattern.rows))
    assert axes.get_ylabel() == "lost or gained (kN)"
    assert len(axes.containers) == 4  # lost, gained, unchanged, intervals
    assert [label.get_text() for label in axes.get_xticklabels()] == [str(i) for i in range(1, 13)]
    (cross,) = [line for line in axes.lines if line.get_label() == "not compared"]
    assert np.asarray(cross.get_xdata()).tolist() == [2.0]
    assert axes.get_xlabel() == "hanger, in the order of the bridge"
    assert max(len(np.asarray(line.get_xdata())) for line in axes.lines) <= len(pattern.rows)
    assert "hanger 7 -34 kN (-4.9 %)" in shown.alt
    assert pattern.sentence in shown.caption
    assert shown.png().startswith(b"\x89PNG")
    assert shown.svg().startswith("<svg")
    (axes,) = bridge_illustration(bridge_pattern(shifts(100), range(1, 101))).figure.axes
    assert min(np.diff(axes.get_xticks())) >= 4, "numbers of many hangers do not overlap"
