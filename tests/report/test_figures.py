"""Figures of every report: drawn where their data exist, true to them, legible, well-formed."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.diagnosis_report import FIGURES as OF_DIAGNOSIS
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_temperature import FIGURE as TEMPERATURE
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.modal_test_axes import ResponseCurves
from shm.report.figures.specification import Illustration, Specification, drawn
from shm.report.figures.style import PALETTE
from shm.report.modal_test_report import FIGURES as OF_MODAL_TEST
from shm.report.modal_test_report import modal_test_figures
from tests.report.diagnoses import ALIKE, CASES, HANGER, LED, sheet
from tests.report.sheets import make_sheet, warned

OF_HANGER = (TREND, FREQUENCIES, STIFFNESS, TEMPERATURE)
SVG = "{http://www.w3.org/2000/svg}"
Figures = dict[str, dict[str, Illustration]]


@pytest.fixture(scope="module")
def figures(season: HangerReport) -> Figures:
    """Every figure of a season, of each diagnosis and of a hammer test, by its name."""
    made = {case: drawn(OF_DIAGNOSIS, sheet(case)) for case in CASES}
    made |= {"season": drawn(OF_HANGER, season), "test": modal_test_figures(warned(make_sheet()))}
    return {case: {item.name: item for item in items} for case, items in made.items()}


def test_figures_are_drawn_where_their_numbers_exist(figures: Figures, bare: HangerReport) -> None:
    assert list(figures["season"]) == ["trend", "frequencies", "stiffness", "temperature"]
    assert [item.name for item in drawn(OF_HANGER, bare)] == ["frequencies"]
    for case in CASES:
        assert list(figures[case]) == ([] if case == "nothing known" else ["causes", "gap_map"])


def test_axes_have_units(figures: Figures) -> None:
    labels = {
        f"{case}: {name}": {axes.get_xlabel() for axes in item.figure.axes}
        | {axes.get_ylabel() for axes in item.figure.axes}
        for case, items in figures.items()
        for name, item in items.items()
    }
    assert {"time of the test (UTC)", "tension (kN)"} <= labels["season: trend"]
    assert "predicted / measured frequency" in labels["season: frequencies"]
    assert "MN m/rad" in labels["season: stiffness"]
    assert {"order of the mode", "gap (%)"} <= labels["led: gap_map"]


def test_words_beside_figures_are_sentences(figures: Figures) -> None:
    for item in (item for items in figures.values() for item in items.values()):
        assert item.caption.endswith(".")
        assert len(item.alt) > 40
        assert not re.search(r"\b(nan|inf|None)\b", item.caption + item.alt)


@pytest.mark.parametrize("case", ["season", "alike", "blunder", "test"])
def test_no_word_is_cut_off(case: str, figures: Figures) -> None:
    for item in figures[case].values():
        figure = item.figure
        figure.draw_without_rendering()
        used = figure.get_tightbbox()
        assert min(used.x0, used.y0) > -0.02, item.name
        assert used.x1 < figure.get_figwidth() + 0.02, item.name
        assert used.y1 < figure.get_figheight() + 0.02, item.name


def test_many_tests_and_long_names_leave_room() -> None:
    tests = tuple(f"t{n}" for n in range(20))
    rows = tuple(replace(r, test=t) for r in LED.where[:40] for t in tests)
    long = replace(
        ALIKE.causes[0], effect="translational_end_flexibility + skewed_principal_axes",
        at="deck end, longitudinal + both ends", group=None,
    )  # fmt: skip
    for diagnosis in (replace(LED, tests=tests, where=rows), replace(LED, causes=(long,))):
        for item in drawn(OF_DIAGNOSIS, DiagnosisSheet(diagnosis, HANGER)):
            item.figure.draw_without_rendering()
            assert all(axes.get_position().width > 0.2 for axes in item.figure.axes), item.name


def test_svgs_are_named_and_follow_the_page(figures: Figures) -> None:
    elements = {
        name: item.svg()
        for case in ("season", "led", "test")
        for name, item in figures[case].items()
    }
    for name, element in elements.items():
        root = ElementTree.fromstring(element)
        assert root.get("aria-labelledby") == f"{name}-title {name}-alt"
        assert root.find(f"{SVG}desc") is not None
        plain = re.sub(r"var\(--\w+, #[0-9a-f]{6}\)", "", element)
        assert not re.search(r"(fill|stroke): #[0-9a-f]{6}", plain), name
        assert set(re.findall(r"var\(--(\w+),", element)) <= set(PALETTE)
    together = "".join(elements.values())
    ids = re.findall(r'\bid="([^"]+)"', together)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', together)) <= set(ids)


def test_drawing_is_repeatable_and_changes_no_setting(season: HangerReport) -> None:
    before = dict(mpl.rcParams)
    first, second = (drawn(OF_HANGER[:1], season)[0].svg() for _ in range(2))
    assert first == second
    assert dict(mpl.rcParams) == before


def test_the_trend_has_levels_and_alerts(figures: Figures, season: HangerReport) -> None:
    assert season.baseline_tension_n is not None
    (axes,) = figures["season"]["trend"].figure.axes
    named = [line for line in axes.lines if line.get_label() in ("baseline", "threshold")]
    levels = [float(np.asarray(line.get_ydata())[0]) for line in named]
    baseline = season.baseline_tension_n.mean / 1e3
    assert levels == pytest.approx([baseline, baseline * 1.05, baseline * 0.95])
    marks = next(line for line in axes.lines if line.get_label() == "alert")
    assert marks.get_ydata() == pytest.approx([season.trend[-1].tension_n.mean / 1e3])


def test_undated_tests_are_counted_in_the_caption(season: HangerReport) -> None:
    undated = replace(season.trend[0], time=None)
    item = drawn(OF_HANGER[:1], replace(season, trend=(undated, *season.trend[1:])))[0]
    assert "1 test without a time left out" in item.caption


def test_ratios_are_prediction_over_measurement(figures: Figures) -> None:
    (axes,) = figures["season"]["frequencies"].figure.axes
    bars = [each for each in axes.containers if each.get_label() == "transverse"]
    ratios = np.asarray(bars[0][0].get_ydata())
    assert ratios == pytest.approx([1 + 0.004 * (-1) ** order for order in range(1, 7)])


def test_bars_are_the_probabilities_and_end_with_no_gap(figures: Figures) -> None:
    (axes,) = figures["alike"]["causes"].figure.axes
    widths = [bar.get_width() for bar in axes.patches]  # type: ignore[attr-defined]
    assert widths == pytest.approx([0.52, 0.31, 0.07, 0.05, 0.049, 0.001])
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels[-1] == "no gap"
    assert sum(label.endswith("[A]") for label in labels) == 3


def test_the_map_shows_every_residual_once(figures: Figures) -> None:
    axes = figures["led"]["gap_map"].figure.axes
    marks = [line for each in axes for line in each.lines if line.get_marker() in ("o", "s")]
    shown = np.sort(np.concatenate([np.asarray(line.get_ydata(), float) for line in marks]))
    assert shown == pytest.approx(np.sort([r.residual_percent for r in LED.where]))


def test_the_map_shows_what_the_cause_leaves(figures: Figures) -> None:
    names = {each.get_label() for each in figures["led"]["gap_map"].figure.axes[0].containers}
    assert {"with the cause", "with the cause, held out"} <= names
    unheld = tuple(replace(r, held_out_after_percent=float("nan")) for r in LED.where)
    item = drawn(OF_DIAGNOSIS, DiagnosisSheet(replace(LED, where=unheld), HANGER))[1]
    assert "nothing was held out" in item.caption


def test_an_excluded_frequency_does_not_squeeze_the_others(figures: Figures) -> None:
    item = figures["blunder"]["gap_map"]
    axes = item.figure.axes[0]
    (cross,) = [line for line in axes.lines if line.get_marker() == "X"]
    assert cross.get_label() == "excluded"
    assert "+30.00 %" in [text.get_text() for text in axes.texts]
    assert axes.get_ylim()[1] < 5
    assert "Excluded as a gross error: transverse 3 in t4." in item.alt


def test_hovers_ask_for_what_their_mark_has(season: HangerReport) -> None:
    curves = ResponseCurves.of(warned(make_sheet()))
    specifications = [
        *(each.draw(season) for each in OF_HANGER),
        *(each.draw(sheet("blunder")) for each in OF_DIAGNOSIS),
        *(each.draw(curves) for each in OF_MODAL_TEST),
    ]
    marks: list[Any] = [
        mark
        for each in specifications
        if isinstance(each, Specification)
        for panel in each.panels
        for mark in panel.marks
        if mark.hover or len(mark.texts)
    ]
    assert len(marks) > 50
    for mark in marks:
        fields = set(re.findall(r"%\{(\w+)(?::[^}]+)?\}", mark.hover))
        assert fields <= {"x", "y"} | ({"text"} if len(mark.texts) else set())
        assert not len(mark.texts) or len(mark.texts) == len(mark.x)
        assert not any(re.search(r"\bnan\b|\bNone\b", text) for text in mark.texts)
