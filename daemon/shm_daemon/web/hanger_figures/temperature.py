"""Tension over the temperature of the tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shm.report import words
from shm.store import TrendPoint
from shm.values.force_units import ForceUnit
from shm_daemon.web.hanger_figures import over_time
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure

_FEWEST = 2


def _known(view: HangerView) -> list[TrendPoint]:
    """Tests with a temperature."""
    return [point for point in view.trend if math.isfinite(point.temperature_c)]


def _shown(view: HangerView) -> list[TrendPoint]:
    """Those that are drawn: thinned by their tension where there are very many."""
    known = _known(view)
    means = np.array([point.tension_n.mean for point in known])
    temperatures = np.array([point.temperature_c for point in known])
    return [known[i] for i in over_time.places(means, temperatures).tolist()] if known else []


def _draw(view: HangerView) -> dict[str, Any]:
    known = _shown(view)
    parts = (
        (known[:-1], "earlier tests", "blue", "circle"),
        (known[-1:], "latest", "orange", "diamond"),
    )
    unit = over_time.tension_unit(view.trend)
    traces = [_trace(*part, unit) for part in parts]
    label = f"tension ({unit.name})"
    return figure(traces, "temperature (°C)", label, hovermode="closest")


def _trace(
    points: list[TrendPoint], name: str, hue: str, symbol: str, unit: ForceUnit
) -> over_time.Trace:
    band = over_time.in_unit(over_time.band_of([point.tension_n for point in points]), unit)
    labels = [f"{point.test}, {point.time:%Y-%m-%d}" for point in points]
    made = over_time.dots_trace([point.time for point in points], band, labels, name, hue)
    marker = {"color": colour(hue), "size": 8, "symbol": symbol}
    return {**made, "x": [point.temperature_c for point in points], "marker": marker}


def _caption(view: HangerView) -> str:
    known = len(_known(view))
    without = len(view.trend) - known
    left = f" {words.counted(without, 'test')} without a temperature left out." if without else ""
    return (
        "Tension by each test over its temperature, with 90 % intervals. A hanger that stays as it "
        f"is lies along one line; what leaves it has another reason than the weather.{left}"
        f"{over_time.thinned_words(known)}"
    )


def _alt(view: HangerView) -> str:
    known = _known(view)
    temperatures = [point.temperature_c for point in known]
    means_n, unit = [point.tension_n.mean for point in known], over_time.tension_unit(view.trend)
    low, high = (
        f"{unit.of(each):.{unit.decimals(each)}f}" for each in (min(means_n), max(means_n))
    )
    return (
        f"Tension of {words.counted(len(known), 'test')} between {min(temperatures):.1f} and "
        f"{max(temperatures):.1f} °C: {low} to {high} {unit.name}."
    )


FIGURE = HangerFigure(
    "temperature",
    "Tension and temperature",
    "trends",
    lambda view: len(_known(view)) >= _FEWEST,
    _draw,
    _caption,
    _alt,
)
