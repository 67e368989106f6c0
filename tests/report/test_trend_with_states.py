"""The trend of a report with the state over time, drawn from plain values."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from matplotlib.figure import Figure

from shm.report.contents import HangerReport, TrendRow
from shm.report.figures.hanger_trend import FIGURE
from shm.report.formatting import Interval
from shm.report.states import CalledChange, QuantityOverTime, StatesOverTime
from shm.values import FloatArray
from shm.watch.state import Band

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
        unit="N" if name == "tension" else "N m/rad",
    )


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
def report(season: HangerReport, data: StatesOverTime) -> HangerReport:
    """Sixty tests of the hanger of the season, with its baseline of 700 kN."""
    tension = data.quantities[0].read
    rows = tuple(
        TrendRow(f"t{n}", "beam2", Interval(middle, middle - 9e3, middle + 9e3), time=time)
        for n, (time, middle) in enumerate(zip(data.times, tension.middle.tolist(), strict=True))
    )
    return replace(season, states=data, trend=rows, alerts=())


def drawn(report: HangerReport) -> Figure:
    figure = FIGURE.figure(report)
    assert figure is not None
    figure.draw_without_rendering()
    return figure


def test_the_state_stands_at_the_level_of_the_average_over_classes(report: HangerReport) -> None:
    """The class of the watch has 711 kN at the baseline, all classes together 701 kN."""
    (axes,) = drawn(report).axes
    (state,) = [line for line in axes.lines if line.get_label() == "state, 90 % band"]
    assert report.now.baseline_n is not None
    level = report.now.baseline_n.mean / 1e3
    assert np.asarray(state.get_ydata())[0] == pytest.approx(level)


def test_an_excluded_test_stretches_no_axis_but_shows_at_its_edge(report: HangerReport) -> None:
    (axes,) = drawn(report).axes
    (mark,) = [line for line in axes.lines if line.get_label() == "excluded test"]
    assert np.asarray(mark.get_ydata()).tolist() == [axes.get_ylim()[1]]
    assert axes.get_ylim()[1] < 800
    assert "tests taken for blunders" in FIGURE.caption(report)
    sound = replace(report, states=replace(report.states, outlier=np.zeros(TESTS, bool)))
    assert drawn(sound).axes[0].get_ylim()[1] > 800


def test_words_over_changes_overlap_neither_each_other_nor_the_legend(
    report: HangerReport,
) -> None:
    figure = drawn(report)
    texts = [text for text in figure.axes[0].texts if text.get_text()]
    boxes = [text.get_window_extent() for text in texts] + [figure.legends[0].get_window_extent()]
    assert len(boxes) == 3
    for at, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[at + 1 :])
