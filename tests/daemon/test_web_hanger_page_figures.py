"""Figures of the hanger page, drawn of a hanger that is put together here."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import plotly.graph_objects as plotly
import pytest

from shm.report.figures.time_axes import MOST_POINTS, places
from shm.report.states import NOTHING_WATCHED
from shm.store import BaselineGlance, EventKind, HangerEvent, TrendPoint
from shm.values import NAN, Averaged, FloatArray, Summary
from shm_daemon.web.hanger_figures import FIGURES
from shm_daemon.web.hanger_view import HangerView
from tests.helpers.workspaces import START
from tests.report.diagnoses import HANGER

_BY_NAME = {figure.name: figure for figure in FIGURES}
TREND, STIFFNESS, TEMPERATURE = (_BY_NAME[n] for n in ("trend", "stiffness", "temperature"))
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
    """Return a hanger of so many tests, one of which is far off."""
    points = [a_point(i, 500e3 if i == BLUNDER else 700e3 + 1e3 * (i % 7)) for i in range(tests)]
    view = SimpleNamespace(
        hanger=HANGER,
        trend=tuple(points),
        baseline=BASELINE,
        events=(),
        notes=(),
        calls=(),
        states=NOTHING_WATCHED,
        report=None,
    )
    vars(view).update(parts)
    return cast(HangerView, view)


def drawn(view: HangerView, figure: Any) -> dict[str, Any]:
    document: dict[str, Any] = figure.document(view)
    plotly.Figure({key: document[key] for key in ("data", "layout")})
    return document


def trace(document: dict[str, Any], name: str) -> dict[str, Any]:
    return next(each for each in document["data"] if each.get("name") == name)


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


def test_one_far_interval_does_not_squeeze_the_rest() -> None:
    view = a_view(12)
    wide = replace(view.trend[3], tension_n=Summary(700e3, 1e6, 1e3, 700e3, 9e6))
    document = drawn(a_view(12, trend=(*view.trend[:3], wide, *view.trend[4:])), TREND)
    low, high = document["layout"]["yaxis"]["range"]
    assert 600 < low < 665
    assert 735 < high < 800
