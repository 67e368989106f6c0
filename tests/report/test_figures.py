"""Figures of every report: drawn where their data exist, true to them, legible, well-formed."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from shm.report.contents import DiagnosisSheet, HangerReport, TrendRow
from shm.report.diagnosis_report import FIGURES as OF_DIAGNOSIS
from shm.report.figures.hanger_frequencies import FIGURE as FREQUENCIES
from shm.report.figures.hanger_stiffness import FIGURE as STIFFNESS
from shm.report.figures.hanger_temperature import FIGURE as TEMPERATURE
from shm.report.figures.hanger_trend import FIGURE as TREND
from shm.report.figures.modal_test_axes import ResponseCurves
from shm.report.figures.specification import Illustration, Specification, drawn
from shm.report.figures.style import PALETTE
from shm.report.formatting import Interval
from shm.report.modal_test_report import FIGURES as OF_MODAL_TEST
from shm.report.modal_test_report import modal_test_figures
from shm.report.states import CalledChange, QuantityOverTime, StatesOverTime
from shm.values import FloatArray
from shm.watch.engine.state import Band
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


def test_words_beside_figures_are_sentences_with_units(figures: Figures) -> None:
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


def test_trend_has_levels_and_alerts(figures: Figures, season: HangerReport) -> None:
    assert season.baseline_tension_n is not None
    axes, temperature = figures["season"]["trend"].figure.axes
    assert temperature.get_ylabel() == "°C"
    named = [line for line in axes.lines if line.get_label() in ("baseline", "threshold")]
    levels = [float(np.asarray(line.get_ydata())[0]) for line in named]
    baseline = season.baseline_tension_n.mean / 1e3
    assert levels == pytest.approx([baseline, baseline * 1.05, baseline * 0.95])
    marks = next(line for line in axes.lines if line.get_label() == "alert")
    assert marks.get_ydata() == pytest.approx([season.trend[-1].tension_n.mean / 1e3])
    undated = replace(season.trend[0], time=None)
    item = drawn(OF_HANGER[:1], replace(season, trend=(undated, *season.trend[1:])))[0]
    assert "1 test without a time left out" in item.caption


def test_bars_are_ratios_and_probabilities(figures: Figures) -> None:
    (axes,) = figures["season"]["frequencies"].figure.axes
    bars = [each for each in axes.containers if each.get_label() == "transverse"]
    ratios = np.asarray(bars[0][0].get_ydata())
    assert ratios == pytest.approx([1 + 0.004 * (-1) ** order for order in range(1, 7)])
    (axes,) = figures["alike"]["causes"].figure.axes
    widths = [bar.get_width() for bar in axes.patches]  # type: ignore[attr-defined]
    assert widths == pytest.approx([0.52, 0.31, 0.07, 0.05, 0.049, 0.001])
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels[-1] == "no gap"
    assert sum(label.endswith("[A]") for label in labels) == 3


def test_gap_map_shows_residuals_and_what_the_cause_leaves(figures: Figures) -> None:
    """Each residual once; an excluded frequency does not squeeze the others."""
    axes = figures["led"]["gap_map"].figure.axes
    marks = [line for each in axes for line in each.lines if line.get_marker() in ("o", "s")]
    shown = np.sort(np.concatenate([np.asarray(line.get_ydata(), float) for line in marks]))
    assert shown == pytest.approx(np.sort([r.residual_percent for r in LED.where]))
    names = {each.get_label() for each in figures["led"]["gap_map"].figure.axes[0].containers}
    assert {"with the cause", "with the cause, held out"} <= names
    unheld = tuple(replace(r, held_out_after_percent=float("nan")) for r in LED.where)
    item = drawn(OF_DIAGNOSIS, DiagnosisSheet(replace(LED, where=unheld), HANGER))[1]
    assert "nothing that it moves was held out" in item.caption
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


TESTS = 60
STEP = 40
FIRST = datetime(2024, 1, 1, tzinfo=UTC)
TIMES = tuple(FIRST + timedelta(days=14 * number) for number in range(TESTS))


def band(middle: FloatArray, half: float) -> Band:
    return Band(middle - half, middle, middle + half)


def quantity(name: str, title: str, level: float, step: float, reach: float) -> QuantityOverTime:
    truth: FloatArray = level + step * np.where(np.arange(TESTS) >= STEP, 1.0, 0.0)
    noisy: FloatArray = truth + np.asarray(reach / 10 * np.sin(np.arange(TESTS) * 2.4), np.float64)
    read, filtered, smoothed = (
        band(values, reach / part) for values, part in ((noisy, 10), (truth, 20), (truth, 25))
    )
    unit = "N" if name == "tension" else "N m/rad"
    return QuantityOverTime(name, title, read, filtered, smoothed, level, unit)


@pytest.fixture
def data() -> StatesOverTime:
    """Return a step of the tension at test 40, a loosening spring, an outlier far out of view."""
    tension = quantity("tension", "tension", 711e3, -28e3, 35e3)
    spring = quantity("log10_k1", "spring k1 (transverse, deck end)", 7.1, 0.0, 0.5)
    for part in (tension.read.low, tension.read.middle, tension.read.high):
        part[20] += 2e5
    return StatesOverTime(
        times=TIMES,
        temperatures_c=12 + 10 * np.sin(np.arange(TESTS) / 4),
        reference_temperature_c=12.0,
        outlier=np.arange(TESTS) == 20,
        quantities=(tension, spring),
        changes=(
            CalledChange(TIMES[STEP - 1], TIMES[STEP], "sudden: tension -3.9 %"),
            CalledChange(TIMES[STEP + 1], TIMES[STEP + 4], "slow: k1 at the deck end -0.4 decades"),
        ),
    )


@pytest.fixture
def watched(season: HangerReport, data: StatesOverTime) -> HangerReport:
    """Sixty tests of the hanger of the season, with its baseline of 700 kN."""
    tension = data.quantities[0].read
    rows = tuple(
        TrendRow(f"t{n}", "beam2", Interval(middle, middle - 9e3, middle + 9e3), time=time)
        for n, (time, middle) in enumerate(zip(data.times, tension.middle.tolist(), strict=True))
    )
    return replace(season, states=data, trend=rows, alerts=())


def with_states(watched: HangerReport) -> Figure:
    figure = TREND.figure(watched)
    assert figure is not None
    figure.draw_without_rendering()
    return figure


def test_the_state_stands_at_the_level_of_the_average_over_classes(watched: HangerReport) -> None:
    """The class of the watch has 711 kN at the baseline, all classes together 701 kN."""
    (axes,) = with_states(watched).axes
    (state,) = [line for line in axes.lines if line.get_label() == "state, 90 % band"]
    assert watched.now.baseline_n is not None
    level = watched.now.baseline_n.mean / 1e3
    assert np.asarray(state.get_ydata())[0] == pytest.approx(level)


def test_an_excluded_test_stretches_no_axis_but_shows_at_its_edge(watched: HangerReport) -> None:
    (axes,) = with_states(watched).axes
    (mark,) = [line for line in axes.lines if line.get_label() == "excluded test"]
    assert np.asarray(mark.get_ydata()).tolist() == [axes.get_ylim()[1]]
    assert axes.get_ylim()[1] < 800
    assert "tests taken for blunders" in TREND.caption(watched)
    sound = replace(watched, states=replace(watched.states, outlier=np.zeros(TESTS, bool)))
    assert with_states(sound).axes[0].get_ylim()[1] > 800


def test_words_over_changes_do_not_overlap(watched: HangerReport) -> None:
    figure = with_states(watched)
    texts = [text for text in figure.axes[0].texts if text.get_text()]
    boxes = [text.get_window_extent() for text in texts] + [figure.legends[0].get_window_extent()]
    assert len(boxes) == 3
    for at, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[at + 1 :])
