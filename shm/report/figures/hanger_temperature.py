"""Draw the tension by each test over its temperature."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shm.report import formatting
from shm.report.contents import HangerReport, TrendRow
from shm.report.figures import specification as spec
from shm.report.figures import time_axes


def _known(data: HangerReport) -> list[TrendRow]:
    """Return the tests with a temperature."""
    return [row for row in data.trend if math.isfinite(row.temperature_c)]


def _specify(data: HangerReport) -> spec.Specification | None:
    """Return a mark for each test, thinned by tension and temperature where there are very many."""
    known, unit = _known(data), data.tension_unit
    if len(known) < 2:
        return None
    bounds = time_axes.bounds_of([row.tension_n for row in known])
    temperatures = np.array([row.temperature_c for row in known])
    chosen = time_axes.places(bounds.middle, temperatures)
    shown, x = time_axes.part(bounds, chosen, 1 / unit.newtons), temperatures[chosen]
    names = [_name(known[place]) for place in chosen.tolist()]
    earlier, latest = np.arange(len(chosen) - 1), np.array([len(chosen) - 1])
    tests = time_axes.single_tests(
        x[earlier], time_axes.part(shown, earlier), names[:-1], "blue", "earlier tests", 4.8
    )
    last = time_axes.single_tests(
        x[latest], time_axes.part(shown, latest), names[-1:], "orange", "latest", 4.8
    )
    axis = spec.Axis(label=f"tension ({unit.name})")
    panel = spec.Panel(
        y=axis,
        marks=[tests, replace(last, symbol="diamond")],
        x=spec.Axis(label="temperature (°C)"),
    )
    return spec.stacked([panel], 3.4)


def _name(row: TrendRow) -> str:
    return f"{row.test}, {row.time:%Y-%m-%d}" if row.time else row.test


def _caption(data: HangerReport) -> str:
    known = len(_known(data))
    without = len(data.trend) - known
    left = (
        f" {formatting.counted(without, 'test')} without a temperature left out." if without else ""
    )
    return (
        "Tension by each test over its temperature, with 90 % intervals. A hanger that does "
        f"not change lies on one line; what lies off it has another cause.{left}"
        f"{time_axes.thinned_words(known)}"
    )


def _alt(data: HangerReport) -> str:
    known, unit = _known(data), data.tension_unit
    temperatures = [row.temperature_c for row in known]
    means_n = [row.tension_n.mean for row in known]
    low, high = (
        f"{unit.of(each):.{unit.decimals(each)}f}" for each in (min(means_n), max(means_n))
    )
    return (
        f"Tension of {formatting.counted(len(known), 'test')} between {min(temperatures):.1f} and "
        f"{max(temperatures):.1f} °C: {low} to {high} {unit.name}."
    )


FIGURE = spec.FigureSpec("temperature", "Tension and temperature", _specify, _caption, _alt)
