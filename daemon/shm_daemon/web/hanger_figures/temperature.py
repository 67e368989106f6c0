"""Tension over the temperature of the tests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.report import Interval, words
from shm.report.figures.over_time import bounds_of, part, places, tests, thinned_words
from shm.report.figures.specification import Axis, Panel, Specification, stacked
from shm.store import TrendPoint
from shm.values.force_units import ForceUnit, force_unit
from shm_daemon.web.hanger_figures.member import HangerFigure
from shm_daemon.web.hanger_view import HangerView

_FEWEST = 2


def tension_unit(points: Sequence[TrendPoint]) -> ForceUnit:
    """The one unit of the tensions of a hanger's tests."""
    return force_unit(*(point.tension_n.mean for point in points))


def _known(view: HangerView) -> list[TrendPoint]:
    """Tests with a temperature."""
    return [point for point in view.trend if math.isfinite(point.temperature_c)]


def _specify(view: HangerView) -> Specification:
    """Thinned by tension and temperature where there are very many."""
    known, unit = _known(view), tension_unit(view.trend)
    bounds = bounds_of([Interval.of_summary(point.tension_n) for point in known])
    temperatures = np.array([point.temperature_c for point in known])
    chosen = places(bounds.middle, temperatures)
    shown = part(bounds, chosen, 1 / unit.newtons)
    names = [f"{known[i].test}, {known[i].time:%Y-%m-%d}" for i in chosen.tolist()]
    earlier, latest = np.arange(len(chosen) - 1), np.array([len(chosen) - 1])
    x = temperatures[chosen]
    marks = [
        tests(x[earlier], part(shown, earlier), names[:-1], "blue", "earlier tests", 4.8),
        replace(
            tests(x[latest], part(shown, latest), names[-1:], "orange", "latest", 4.8),
            symbol="diamond",
        ),
    ]
    axis = Axis(label=f"tension ({unit.name})")
    return stacked([Panel(y=axis, marks=marks, x=Axis(label="temperature (°C)"))], 3.4)


def _caption(view: HangerView) -> str:
    known = len(_known(view))
    without = len(view.trend) - known
    left = f" {words.counted(without, 'test')} without a temperature left out." if without else ""
    return (
        "Tension by each test over its temperature, with 90 % intervals. A hanger that stays as it "
        f"is lies along one line; what leaves it has another reason than the weather.{left}"
        f"{thinned_words(known)}"
    )


def _alt(view: HangerView) -> str:
    known = _known(view)
    temperatures = [point.temperature_c for point in known]
    means_n, unit = [point.tension_n.mean for point in known], tension_unit(view.trend)
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
    _specify,
    _caption,
    _alt,
)
