"""The figure of the states over time, drawn from plain values."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report.figures.hanger_states import STATES
from shm.report.states import CalledChange, QuantityOverTime, StatesOverTime, _over_time
from shm.values import TENSION, FloatArray, WatchedQuantity
from shm.watch.state import Band, StateHistory
from tests.helpers.hangers import HANGER_3

TESTS = 60
STEP = 40
START = datetime(2024, 1, 1, tzinfo=UTC)
TIMES = tuple(START + timedelta(days=14 * number) for number in range(TESTS))


def band(middle: FloatArray, half: float) -> Band:
    return Band(middle - half, middle, middle + half)


def quantity(name: str, title: str, level: float, step: float, reach: float) -> QuantityOverTime:
    truth: FloatArray = level + step * np.where(np.arange(TESTS) >= STEP, 1.0, 0.0)
    noisy: FloatArray = truth + np.asarray(reach / 10 * np.sin(np.arange(TESTS) * 2.4), np.float64)
    return QuantityOverTime(
        name=name,
        title=title,
        read=band(noisy, reach / 10),
        filtered=band(truth, reach / 20),
        smoothed=band(truth, reach / 25),
        baseline=level,
        lower_threshold=level - reach,
        upper_threshold=level + reach,
        unit="N" if name == "tension" else "N m/rad",
    )


@pytest.fixture
def data() -> StatesOverTime:
    """A step of the tension at test 40, a loosening spring, an outlier far out of view."""
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


def drawn(data: StatesOverTime) -> Figure:
    figure = STATES.figure(data)
    assert figure is not None
    figure.draw_without_rendering()
    return figure


def named(axes: Axes) -> set[str]:
    return set(axes.get_legend_handles_labels()[1])


def test_each_quantity_has_a_panel_and_the_temperature_a_strip(data: StatesOverTime) -> None:
    labels = [axes.get_ylabel() for axes in drawn(data).axes]
    assert labels == ["tension (kN)", "log10 of\nN m/rad", "temp.\n(°C)"]


@pytest.mark.parametrize(("unit", "label"), [("N/m", "log10 of\nN/m"), ("", "log10 of\nstiffness")])
def test_specify_stiffness_unit(data: StatesOverTime, unit: str, label: str) -> None:
    solid = replace(data.quantities[1], unit=unit)
    axes = drawn(replace(data, quantities=(data.quantities[0], solid))).axes
    assert axes[1].get_ylabel() == label


def test_without_temperatures_there_is_no_strip(data: StatesOverTime) -> None:
    figure = drawn(replace(data, temperatures_c=np.full(TESTS, np.nan)))
    assert [axes.get_ylabel() for axes in figure.axes] == ["tension (kN)", "log10 of\nN m/rad"]
    assert figure.axes[-1].get_xlabel() == "time of the test (UTC)"


def test_the_legend_names_all_that_is_drawn(data: StatesOverTime) -> None:
    figure = drawn(data)
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {
        "90 % band", "estimate to date", "retrospective", "test by itself", "taken as outlier",
        "test out of view", "baseline", "threshold", "change began",
    }  # fmt: skip


def test_thresholds_and_states_are_in_view_in_kilonewtons(data: StatesOverTime) -> None:
    low, high = drawn(data).axes[0].get_ylim()
    assert 650 < low < 676
    assert 746 < high < 770


def test_a_blunder_does_not_squeeze_the_panel_but_shows_at_its_edge(data: StatesOverTime) -> None:
    axes = drawn(data).axes[0]
    marks = [line for line in axes.lines if line.get_label() == "test out of view"]
    assert len(marks) == 1
    assert np.asarray(marks[0].get_ydata())[0] == axes.get_ylim()[1]
    assert axes.get_ylim()[1] < 800


def test_a_quantity_that_no_test_sees_has_its_state_but_no_dots(data: StatesOverTime) -> None:
    unseen = Band(*[np.full(TESTS, np.nan)] * 3)
    blind = replace(data.quantities[1], read=unseen)
    axes = drawn(replace(data, quantities=(data.quantities[0], blind))).axes[1]
    assert "estimate to date" in named(axes)
    assert "test by itself" not in named(axes)


def test_words_over_changes_overlap_neither_each_other_nor_the_legend(
    data: StatesOverTime,
) -> None:
    figure = drawn(data)
    texts = [text for text in figure.axes[0].texts if text.get_text()]
    boxes = [text.get_window_extent() for text in texts] + [figure.legends[0].get_window_extent()]
    assert len(boxes) == 3
    for at, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[at + 1 :])


def test_words_and_legend_stay_on_the_figure(data: StatesOverTime) -> None:
    late = CalledChange(TIMES[-2], TIMES[-1], "slow: longitudinal spring at the arch end -0.6")
    figure = drawn(replace(data, changes=(late,)))
    for artist in (*figure.axes[0].texts, figure.legends[0]):
        extent = artist.get_window_extent()
        assert extent.x0 >= 0
        assert extent.x1 <= figure.bbox.x1


def test_one_test_is_drawn(data: StatesOverTime) -> None:
    def first(whole: Band) -> Band:
        return Band(whole.low[:1], whole.middle[:1], whole.high[:1])

    alone = tuple(
        replace(q, read=first(q.read), filtered=first(q.filtered), smoothed=first(q.smoothed))
        for q in data.quantities
    )
    figure = drawn(
        StatesOverTime(
            TIMES[:1], data.temperatures_c[:1], 12.0, data.outlier[:1], alone, changes=()
        )
    )
    left, right = figure.axes[0].get_xlim()
    assert right - left == pytest.approx(2.0)


def test_nothing_is_drawn_of_nothing(data: StatesOverTime) -> None:
    assert STATES.draw(replace(data, quantities=())) is None


def test_caption_and_alternative_text_say_what_is_seen(data: StatesOverTime) -> None:
    caption, alt = STATES.caption(data), STATES.alt(data)
    assert "at 12.0 °C" in caption
    assert caption.endswith(".")
    assert "tension 683 kN (90 % interval 681.2 to 684.8 kN), baseline 711 kN" in alt
    assert "sudden: tension -3.9 %, begun by 2025-07-14" in alt
    unknown = replace(data, reference_temperature_c=float("nan"), changes=())
    assert "nan" not in STATES.caption(unknown) + STATES.alt(unknown)
    assert STATES.alt(unknown).endswith("Changes detected: none.")


@pytest.mark.parametrize(
    ("name", "baseline", "reach"), [(TENSION, 700e3, 0.08 * 700e3), ("log10_k1", 7.0, 0.3)]
)
def test_thresholds_are_a_share_of_the_tension_and_decades_of_a_stiffness(
    name: str, baseline: float, reach: float
) -> None:
    thresholds = replace(HANGER_3.thresholds, tension_shift_fraction=0.08)
    thresholds = replace(thresholds, stiffness_shift_decades=0.3)
    watched = WatchedQuantity(name, baseline, np.zeros(2), np.zeros(2), 0.1)
    history: Any = Mock(spec=StateHistory)
    found = _over_time(watched, history, replace(HANGER_3, thresholds=thresholds))
    assert found.lower_threshold == pytest.approx(baseline - reach)
    assert found.upper_threshold == pytest.approx(baseline + reach)
