"""Figures of the hanger page, drawn of a hanger that is put together here."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import plotly.graph_objects as plotly
import pytest

from shm.report.figures.time_axes import MOST_POINTS, places
from shm.report.states import NOTHING_WATCHED, QuantityOverTime, StatesOverTime
from shm.store import BaselineGlance, EventKind, HangerEvent, TrendPoint
from shm.values import NAN, Averaged, FloatArray, Summary
from shm.values.notes import Note, NoteKind
from shm.watch.state import Band
from shm_daemon.web.hanger_figures import FIGURES
from shm_daemon.web.hanger_view import HangerView
from tests.helpers.workspaces import START
from tests.report.diagnoses import HANGER

TREND, STIFFNESS, TEMPERATURE = FIGURES[:3]
BLUNDER = 700


def summed_up(mean: float, sd: float) -> Summary:
    return Summary(mean, sd, mean - 1.645 * sd, mean, mean + 1.645 * sd)


def a_point(number: int, tension_n: float = 700e3) -> TrendPoint:
    stiffness = {f"{plane}_end_stiffness": summed_up(6.5, 0.1) for plane in PLANES}
    time = START + timedelta(days=number)
    return TrendPoint(
        tension_n=summed_up(tension_n, 2e3),
        stiffness=stiffness,
        parameters={},
        most_probable_tension_n=tension_n,
        averaged=Averaged(summed_up(tension_n, 2e3), 1e3),
        test_id=number,
        test=f"t{number}",
        hanger=3,
        time=time,
        taken_at=time,
        temperature_c=NAN if number % 3 == 0 else 10.0 + number % 20,
        posterior_id=number,
        model="beam2",
    )


PLANES = ("transverse", "longitudinal")
BASELINE = BaselineGlance(
    tension_n=summed_up(700e3, 2e3),
    stiffness={f"{plane}_end_stiffness": summed_up(6.5, 0.1) for plane in PLANES},
    parameters={},
    most_probable_tension_n=700e3,
    averaged=Averaged(summed_up(700e3, 2e3), 1e3),
    id=1,
    hanger=3,
    set_at=START,
    who="shm",
    why="the first test",
    since=None,
    model="beam2",
    tests=("t0",),
    temperature_c=11.0,
)


def a_view(tests: int, **parts: Any) -> HangerView:
    """A hanger of so many tests, one of which is far off."""
    points = [a_point(i, 500e3 if i == BLUNDER else 700e3 + 1e3 * (i % 7)) for i in range(tests)]
    view = SimpleNamespace(
        hanger=HANGER,
        trend=tuple(points),
        baseline=BASELINE,
        events=(),
        notes=(),
        calls=(),
        states=NOTHING_WATCHED,
    )
    vars(view).update(parts)
    return cast(HangerView, view)


def states_of(view: HangerView) -> StatesOverTime:
    """The tension and two springs of one plane that the tests tell apart."""
    count = len(view.trend)

    def quantity(name: str, title: str, value: float) -> QuantityOverTime:
        middle = np.full(count, value)
        band = Band(0.99 * middle, middle, 1.01 * middle)
        unit = "N m/rad" if name.startswith("log10_") else "N"
        return QuantityOverTime(name, title, band, band, band, value, unit=unit)

    return StatesOverTime(
        tuple(point.time for point in view.trend),
        np.full(count, 11.0),
        11.0,
        np.zeros(count, bool),
        (
            quantity("tension", "tension", 702e3),
            quantity("log10_k1", "end stiffness k1 (deck end, transverse)", 6.4),
            quantity("log10_k3", "end stiffness k3 (arch end, transverse)", 6.8),
        ),
    )


def drawn(view: HangerView, figure: Any) -> dict[str, Any]:
    document: dict[str, Any] = figure.document(view)
    plotly.Figure({key: document[key] for key in ("data", "layout")})
    return document


def trace(document: dict[str, Any], name: str) -> dict[str, Any]:
    return next(each for each in document["data"] if each.get("name") == name)


def test_a_short_trend_is_drawn_whole() -> None:
    dots = trace(drawn(a_view(30), TREND), "test, absolute interval")
    assert len(dots["x"]) == 30


@pytest.mark.parametrize(("tension_n", "unit"), [(5.4, "N"), (20e3, "kN"), (12e6, "MN")])
def test_tensions_are_drawn_in_the_unit_that_fits_them(tension_n: float, unit: str) -> None:
    averaged = Averaged(summed_up(tension_n, 0.01 * tension_n), 0.001 * tension_n)
    points = [replace(a_point(number), averaged=averaged) for number in range(5)]
    baseline = replace(BASELINE, averaged=averaged)
    view = a_view(5, trend=tuple(points), baseline=baseline)
    for figure in (TREND, TEMPERATURE):
        document = drawn(view, figure)
        assert document["layout"]["yaxis"]["title"]["text"] == f"tension ({unit})"
        assert f" {unit}" in document["alt"]
        assert not re.search(r"(?<![\d.])0\.0*(?!\d)", document["alt"])
    low, high = drawn(view, TREND)["layout"]["yaxis"]["range"]
    assert low < tension_n / {"N": 1.0, "kN": 1e3, "MN": 1e6}[unit] < high


@pytest.mark.slow
def test_a_long_trend_is_thinned_and_keeps_its_extremes_and_its_alerts() -> None:
    view = a_view(8 * MOST_POINTS)
    alerted = view.trend[4321]
    event = HangerEvent(alerted.time, EventKind.ALERT, "", "tension fell", 1)
    view = a_view(8 * MOST_POINTS, events=(event,))
    document = drawn(view, TREND)
    dots = trace(document, "test, absolute interval")
    assert len(dots["x"]) <= 1.05 * MOST_POINTS
    assert min(dots["y"]) == 500.0
    names = [text.split(":")[0] for text in dots["text"]]
    assert {f"t{BLUNDER}", "t4321"} <= set(names)
    assert (names[0], names[-1]) == ("t0", f"t{8 * MOST_POINTS - 1}")
    for figure in (TREND, STIFFNESS, TEMPERATURE):
        assert "keep every extreme; enlarging brings no more" in drawn(view, figure)["caption"]


@pytest.mark.parametrize("seed", range(3))
def test_thinning_keeps_the_extremes_of_every_curve(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curves: list[FloatArray] = [rng.normal(size=20_000) for _ in range(3)]
    chosen = places(*curves, always=(7, 11))
    for curve in curves:
        assert curve[chosen].max() == curve.max()
        assert curve[chosen].min() == curve.min()
    assert {0, 7, 11, 19_999} <= set(chosen.tolist())
    assert np.all(np.diff(chosen) > 0)


def test_the_tension_shows_the_state_where_there_is_one() -> None:
    view = a_view(12)
    with_state = a_view(12, states=states_of(view))
    state = trace(drawn(with_state, TREND), "state, 90 % band")
    assert state["y"] == [pytest.approx(700.0)] * 12  # that of the baseline: nothing has changed
    assert "at 11.0 °C" in TREND.caption(with_state)
    assert "state, 90 % band" not in [t.get("name") for t in drawn(view, TREND)["data"]]
    assert "being worked out" in TREND.caption(a_view(12, states=None))


def test_one_far_interval_does_not_squeeze_the_rest() -> None:
    view = a_view(12)
    wide = replace(view.trend[3], tension_n=Summary(700e3, 1e6, 1e3, 700e3, 9e6))
    document = drawn(a_view(12, trend=(*view.trend[:3], wide, *view.trend[4:])), TREND)
    low, high = document["layout"]["yaxis"]["range"]
    assert 600 < low < 665
    assert 735 < high < 800


def test_a_hanger_without_a_baseline_has_no_thresholds() -> None:
    document = drawn(a_view(1, baseline=None), TREND)
    assert "threshold" not in [each.get("name") for each in document["data"]]
    assert document["caption"].endswith("Dotted: nominal.")


def test_each_plane_has_its_panel_of_stiffness() -> None:
    document = drawn(a_view(9), STIFFNESS)
    titles = [each["text"] for each in document["layout"]["annotations"]]
    assert titles == ["transverse end stiffness", "longitudinal end stiffness"]
    assert {each["yaxis"] for each in document["data"]} == {"y", "y2"}
    assert "MN m/rad" in document["caption"]


def test_ends_that_frequencies_tell_apart_have_a_panel_each() -> None:
    view = a_view(9)
    document = drawn(a_view(9, states=states_of(view)), STIFFNESS)
    titles = [each["text"] for each in document["layout"]["annotations"]]
    assert titles == [
        "end stiffness k1 (deck end, transverse)",
        "end stiffness k3 (arch end, transverse)",
    ]
    assert "(deck end, transverse) 2.5 MN m/rad (2.2 to 2.9)" in document["alt"]


def test_tests_without_a_temperature_are_left_out_and_counted() -> None:
    document = drawn(a_view(10), TEMPERATURE)
    assert sum(len(each["x"]) for each in document["data"]) == 6
    assert "4 tests without a temperature left out" in document["caption"]
    assert not TEMPERATURE.is_there(a_view(2))


def test_a_note_widens_the_axis_after_the_last_test_and_never_before_the_first() -> None:
    def reach(*days: float) -> list[str]:
        notes = [
            Note(1, 3, START + timedelta(day), NoteKind.NOTE, "rust " * 100, "anna", START)
            for day in days
        ]
        document = TREND.document(a_view(12, notes=notes))
        (mark,) = [each for each in document["data"] if each.get("name") == "note"] or [None]
        assert mark is None or all(len(each) < 400 for each in mark["text"])
        return list(document["layout"]["xaxis"]["range"])

    plain = reach()
    assert reach(-900) == plain
    assert reach(900)[0] < plain[0]
    assert reach(900)[1] > (START + timedelta(900)).isoformat()
