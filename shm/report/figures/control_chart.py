"""The control chart of a hanger of known tension."""

from __future__ import annotations

import numpy as np

from shm.report.figures import specification as spec
from shm.report.figures import time_axes
from shm.report.formatting import NORMAL_90
from shm.watch.control_chart import ControlChart, ControlPoint


def specify(chart: ControlChart | None) -> spec.Specification | None:
    """Draw deviations from the known tension with their limits; None where there are none."""
    if chart is None or not chart.points:
        return None
    times = [each.time for each in chart.points]
    centres = 100 * np.array([each.centre for each in chart.points])
    limits = 100 * np.array([each.limit for each in chart.points])
    known = 100 * NORMAL_90 * chart.hanger.known_tension_sd_n / chart.hanger.known_tension_n
    marks = [
        spec.Span(axis="y", low=-known, high=known, colour="green", opacity=0.15,
                  name="known tension, 90 %"),
        spec.Rule(at=0.0, colour="green"),
        spec.Line(x=times, y=centres + limits, colour="orange", dash="dash", name="limits"),
        spec.Line(x=times, y=centres - limits, colour="orange", dash="dash"),
        spec.Line(x=times, y=centres, colour="quiet", dash="dot", name="expected"),
        _tests([each for each in chart.points if not each.is_out], "blue", "circle", "test"),
        _tests([each for each in chart.points if each.is_out], "orange", "diamond",
               "out of limits"),
    ]  # fmt: skip
    axis = spec.Axis(label="from known tension (%)")
    return spec.stacked([spec.Panel(y=axis, marks=marks, x=time_axes.time_axis(times))], 3.4, 5)


def _tests(points: list[ControlPoint], colour: str, symbol: spec.Symbol, name: str) -> spec.Points:
    middle = 100 * np.array([each.deviation for each in points])
    half = 100 * NORMAL_90 * np.array([each.sd for each in points])
    return spec.Points(
        x=[each.time for each in points], y=middle, low=middle - half, high=middle + half,
        colour=colour, symbol=symbol, size=5.5, name=name if points else "", hover="%{text}",
        texts=[f"{each.test}: {100 * each.deviation:+.2g} %" for each in points],
    )  # fmt: skip


FIGURE = spec.FigureSpec[ControlChart | None](
    "control",
    "Control chart",
    specify,
    lambda _: (
        "Tension of the control hanger against its known tension, with 90 % intervals of "
        "repetition. Dashed: limits at three standard deviations, by all earlier tests within them."
    ),
    lambda chart: (
        f"Control chart of {len(chart.points if chart else ())} tests, of which "
        f"{sum(each.is_out for each in (chart.points if chart else ()))} are out of limits."
    ),
)
