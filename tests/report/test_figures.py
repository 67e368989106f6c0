"""Figures: drawn where their data exist, labelled with units, without global state."""

from __future__ import annotations

import io
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from datetime import timedelta

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image

from shm.report.contents import HangerReport
from shm.report.figures.every_figure import Illustration, hanger_figures
from shm.report.figures.specification import png
from shm.report.figures.style import PALETTE
from shm.report.formatting import Interval

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def drawn(season: HangerReport) -> dict[str, Illustration]:
    return {item.name: item for item in hanger_figures(season)}


@pytest.fixture(scope="module")
def elements(drawn: dict[str, Illustration]) -> dict[str, str]:
    return {name: item.svg() for name, item in drawn.items()}


def test_a_whole_report_has_all_figures(drawn: dict[str, Illustration]) -> None:
    assert list(drawn) == ["trend", "tension", "frequencies", "stiffness"]


def test_a_bare_report_has_only_the_figures_it_has_data_for(bare: HangerReport) -> None:
    assert [item.name for item in hanger_figures(bare)] == ["tension", "frequencies"]


def test_every_axis_has_a_label_and_quantities_a_unit(drawn: dict[str, Illustration]) -> None:
    labels = {
        name: {axes.get_xlabel() for axes in item.figure.axes}
        | {axes.get_ylabel() for axes in item.figure.axes}
        for name, item in drawn.items()
    }
    assert {"time of the test (UTC)", "tension (kN)"} <= labels["trend"]
    assert {"tension (kN)", "probability density (1/kN)"} <= labels["tension"]
    assert "predicted / measured frequency" in labels["frequencies"]
    assert "stiffness (MN m/rad)" in labels["stiffness"]


def test_captions_and_alternative_texts_are_whole_sentences_without_nan(
    drawn: dict[str, Illustration],
) -> None:
    for item in drawn.values():
        assert item.caption.endswith(".")
        assert len(item.alt) > 40
        assert not re.search(r"\bnan\b", item.caption + item.alt)


def test_legends_leave_the_axes_their_room(drawn: dict[str, Illustration]) -> None:
    """A legend wider than the figure would squeeze the axes to a strip."""
    for name, item in drawn.items():
        item.figure.draw_without_rendering()
        widths = [axes.get_position().width for axes in item.figure.axes]
        assert sum(widths) / len({axes.get_position().y0 for axes in item.figure.axes}) > 0.8, name


def test_lines_near_the_posterior_of_tension_are_drawn_and_far_ones_named(
    season: HangerReport,
) -> None:
    near = next(item for item in hanger_figures(season) if item.name == "tension").figure.axes[0]
    assert {line.get_label() for line in near.lines} == {"nominal", "baseline"}
    assert not near.texts
    sharp = replace(season.posterior, samples=season.posterior.samples.copy())
    sharp.samples[:, 0] = 650 / 711 + 1e-2 * (sharp.samples[:, 0] - 650 / 711)
    alone = replace(season, posterior=sharp, selection=None)
    far = next(i for i in hanger_figures(alone) if i.name == "tension")
    named = far.figure.axes[0].get_title(loc="right")
    assert named == "nominal 711 kN →; baseline 700.6 kN →"


def test_the_trend_marks_the_alerted_test_at_its_tension(
    drawn: dict[str, Illustration], season: HangerReport
) -> None:
    (axes,) = drawn["trend"].figure.axes
    marks = next(line for line in axes.lines if line.get_label() == "alert")
    assert marks.get_ydata() == pytest.approx([season.trend[-1].tension_n.mean / 1e3])


def test_the_thresholds_stand_either_side_of_the_baseline(
    drawn: dict[str, Illustration], season: HangerReport
) -> None:
    assert season.baseline_tension_n is not None
    (axes,) = drawn["trend"].figure.axes
    named = [line for line in axes.lines if line.get_label() in ("baseline", "threshold")]
    levels = [float(np.asarray(line.get_ydata())[0]) for line in named]
    baseline = season.baseline_tension_n.mean / 1e3
    assert levels == pytest.approx([baseline, baseline * 1.05, baseline * 0.95])


def test_the_ratio_figure_shows_prediction_over_measurement(
    drawn: dict[str, Illustration], season: HangerReport
) -> None:
    (axes,) = drawn["frequencies"].figure.axes
    bars = [container for container in axes.containers if container.get_label() == "transverse"]
    ratios = np.asarray(bars[0][0].get_ydata())
    assert ratios == pytest.approx([1 + 0.004 * (-1) ** order for order in range(1, 7)])


def test_tests_without_a_time_are_left_out_of_the_trend_and_counted(season: HangerReport) -> None:
    undated = replace(season.trend[0], time=None)
    item = hanger_figures(replace(season, trend=(undated, *season.trend[1:])))[0]
    assert "1 test without a time left out" in item.caption


def test_a_lone_test_stands_in_the_middle_of_a_narrow_trend(season: HangerReport) -> None:
    (axes,) = hanger_figures(replace(season, trend=season.trend[:1]))[0].figure.axes
    low, high = axes.get_xlim()
    assert high - low == pytest.approx(timedelta(days=2) / timedelta(days=1))


def test_the_svg_is_well_formed_and_named_for_screen_readers(elements: dict[str, str]) -> None:
    for name, element in elements.items():
        root = ElementTree.fromstring(element)
        assert root.get("role") == "img"
        assert root.get("aria-labelledby") == f"{name}-title {name}-alt"
        assert root.find(f"{SVG}title") is not None
        assert root.find(f"{SVG}desc") is not None


def test_ids_are_unique_across_figures_and_references_resolve(elements: dict[str, str]) -> None:
    together = "".join(elements.values())
    ids = re.findall(r'\bid="([^"]+)"', together)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', together)) <= set(ids)


def test_colours_follow_the_page_so_that_dark_pages_stay_readable(
    elements: dict[str, str],
) -> None:
    for element in elements.values():
        plain = re.sub(r"var\(--\w+, #[0-9a-f]{6}\)", "", element)
        assert not re.search(r"(fill|stroke): #[0-9a-f]{6}", plain)
        assert set(re.findall(r"var\(--(\w+),", element)) <= set(PALETTE)


def test_the_same_report_gives_the_same_svg(season: HangerReport) -> None:
    first, second = (hanger_figures(season)[1].svg() for _ in range(2))
    assert first == second


def test_a_png_is_a_png_and_has_room_below_for_words(drawn: dict[str, Illustration]) -> None:
    figure = drawn["tension"].figure
    bare, told = (
        Image.open(io.BytesIO(png(figure, 50, words))) for words in ("", "circles: seen. " * 40)
    )
    assert bare.format == "PNG"
    assert told.height > bare.height + 20
    assert told.width < 1.1 * bare.width


def test_drawing_leaves_the_global_settings_as_they_were(season: HangerReport) -> None:
    before = dict(mpl.rcParams)
    hanger_figures(season)[0].svg()
    assert dict(mpl.rcParams) == before


def test_reports_do_without_pyplot_and_its_global_figures() -> None:
    asked = (
        "import sys, shm.report.figures, shm.report.as_pdf; "
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0


def test_the_trend_ends_at_the_tension_by_the_latest_test(season: HangerReport) -> None:
    assert season.trend[-1].tension_n == Interval.of_averaged(season.by_latest_test)
    assert season.baseline_tension_n == season.trend[0].tension_n
