"""Figures of a gap diagnosis: drawn where their numbers exist, true to them, legible."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

from shm.report.contents import DiagnosisSheet
from shm.report.figures.every_figure import diagnosis_figures
from shm.report.figures.specification import Illustration
from shm.report.figures.style import PALETTE
from tests.report.diagnoses import ALIKE, CASES, HANGER, LED, sheet

ALL = ["causes", "gap_map", "before_and_after"]


@pytest.fixture(scope="module")
def drawn() -> dict[str, dict[str, Illustration]]:
    return {case: {item.name: item for item in diagnosis_figures(sheet(case))} for case in CASES}


@pytest.mark.parametrize(
    ("case", "names"),
    [
        ("led", ALL),
        ("alike", ALL),
        ("no gap", ["causes", "gap_map"]),
        ("unexplained", ["causes", "gap_map"]),
        ("blunder", ALL),
        ("one mode", ["causes", "gap_map"]),
        ("nothing known", []),
    ],
)
def test_figures_are_drawn_where_their_numbers_exist(
    case: str, names: list[str], drawn: dict[str, dict[str, Illustration]]
) -> None:
    assert list(drawn[case]) == names


def test_captions_and_alternative_texts_are_whole_sentences_without_nan(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    for item in (item for items in drawn.values() for item in items.values()):
        assert item.caption.endswith(".")
        assert len(item.alt) > 40
        assert not re.search(r"\bnan\b", item.caption + item.alt)


def test_bars_are_the_probabilities_and_end_with_no_gap(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    (axes,) = drawn["alike"]["causes"].figure.axes
    widths = [bar.get_width() for bar in axes.patches]  # type: ignore[attr-defined]
    assert widths == pytest.approx([0.52, 0.31, 0.07, 0.05, 0.049, 0.001])
    assert [label.get_text() for label in axes.get_yticklabels()][-1] == "no gap"


def test_causes_alike_are_bracketed_with_their_sum(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    (axes,) = drawn["alike"]["causes"].figure.axes
    assert "not told apart:\n0.90 together" in [text.get_text() for text in axes.texts]
    (bracket,) = [line for line in axes.lines if len(line.get_xdata()) == 4]
    assert min(np.asarray(bracket.get_ydata())) == pytest.approx(-0.3)
    assert max(np.asarray(bracket.get_ydata())) == pytest.approx(2.3)


def test_the_map_shows_every_residual_once(drawn: dict[str, dict[str, Illustration]]) -> None:
    axes = drawn["led"]["gap_map"].figure.axes[:2]
    marks = [line for each in axes for line in each.lines if line.get_marker() in ("o", "s")]
    shown = np.sort(np.concatenate([np.asarray(line.get_ydata(), float) for line in marks]))
    assert shown == pytest.approx(np.sort([r.residual_percent for r in LED.where]))


def test_a_frequency_set_aside_is_a_cross_with_its_size_and_does_not_squeeze_the_others(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    item = drawn["blunder"]["gap_map"]
    axes = item.figure.axes[0]
    (cross,) = [line for line in axes.lines if line.get_marker() == "X"]
    assert cross.get_label() == "set aside"
    assert "+30.00 %" in [text.get_text() for text in axes.texts]
    assert axes.get_ylim()[1] < 5
    assert "Crosses: gross errors" in item.caption
    assert "Set aside as a gross error: transverse 3 in t4." in item.alt
    after = drawn["blunder"]["before_and_after"].figure.axes[0]
    assert after.get_ylim()[1] < 5


def test_the_map_names_place_and_units(drawn: dict[str, dict[str, Illustration]]) -> None:
    labels = {axes.get_xlabel() for axes in drawn["led"]["gap_map"].figure.axes}
    labels |= {axes.get_ylabel() for axes in drawn["led"]["gap_map"].figure.axes}
    assert {
        "position from the deck end (m)", "order of the mode", "measured / baseline - 1 (%)",
        "change over its range (%)",
    } <= labels  # fmt: skip


def test_one_plane_gets_one_panel() -> None:
    one = tuple(r for r in LED.where if r.plane == "transverse")
    alone = replace(LED, where=one, places=(), trends=())
    items = diagnosis_figures(DiagnosisSheet(alone, HANGER))
    assert len(next(i for i in items if i.name == "gap_map").figure.axes) == 1


def test_before_and_after_shows_held_out_modes_apart(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    upper = drawn["led"]["before_and_after"].figure.axes[0]
    labels = [series.get_label() for series in upper.containers]
    assert labels == ["baseline", "with the cause", "with the cause, held out"]
    unheld = tuple(replace(r, held_out_after_percent=float("nan")) for r in LED.where)
    item = diagnosis_figures(DiagnosisSheet(replace(LED, where=unheld), HANGER))[2]
    assert "Nothing was held out" in item.caption
    assert len(item.figure.axes[0].containers) == 2


def test_the_svg_is_well_formed_named_and_follows_the_page(
    drawn: dict[str, dict[str, Illustration]],
) -> None:
    for name, item in drawn["alike"].items():
        element = item.svg()
        root = ElementTree.fromstring(element)
        assert root.get("aria-labelledby") == f"{name}-title {name}-alt"
        plain = re.sub(r"var\(--\w+, #[0-9a-f]{6}\)", "", element)
        assert not re.search(r"(fill|stroke): #[0-9a-f]{6}", plain), name
        assert set(re.findall(r"var\(--(\w+),", element)) <= set(PALETTE)


def test_twenty_tests_and_long_names_leave_the_axes_their_room() -> None:
    tests = tuple(f"t{n}" for n in range(20))
    many = replace(LED, tests=tests, where=tuple(replace(r, test=t) for r in LED.where[:40]
                                                 for t in tests))  # fmt: skip
    long = replace(ALIKE.causes[0], effect="translational_end_flexibility + skewed_principal_axes",
                   at="deck end, longitudinal + both ends", group=None)  # fmt: skip
    for diagnosis in (many, replace(LED, causes=(long,))):
        for item in diagnosis_figures(DiagnosisSheet(diagnosis, HANGER)):
            item.figure.draw_without_rendering()
            for axes in item.figure.axes:
                assert axes.get_position().width > 0.2, item.name


@pytest.mark.parametrize("case", ["led", "alike", "blunder", "one mode"])
def test_no_word_of_a_figure_is_cut_off(
    case: str, drawn: dict[str, dict[str, Illustration]]
) -> None:
    for item in drawn[case].values():
        figure = item.figure
        figure.draw_without_rendering()
        used = figure.get_tightbbox()
        assert min(used.x0, used.y0) > -0.02, item.name
        assert used.x1 < figure.get_figwidth() + 0.02, item.name
        assert used.y1 < figure.get_figheight() + 0.02, item.name


def test_the_words_of_a_bracket_and_the_column_of_bayes_factors_keep_apart() -> None:
    sure = (replace(ALIKE.causes[0], probability=0.95), replace(ALIKE.causes[1], probability=0.04))
    figure = diagnosis_figures(DiagnosisSheet(replace(ALIKE, causes=sure), HANGER))[0].figure
    figure.draw_without_rendering()
    (axes,) = figure.axes
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    bracket = next(box for told, box in boxes.items() if told.startswith("not told apart"))
    factors = [box for told, box in boxes.items() if told.startswith(("+", "-"))]
    assert bracket.x1 < min(box.x0 for box in factors)
