"""Damping and uncertainty of the modes over frequency."""

from __future__ import annotations

import math
from typing import Any

from shm.report import TestSheet
from shm.report.content import NORMAL_90
from shm.report.figures.style import PLANE_COLOURS
from shm.report.sheet.figures.damping import FIGURE as PRINTED
from shm.report.sheet.spectra import shown_range
from shm.values import PLANES, Mode, Plane
from shm_daemon.web.figures_of_test.contract import Shown, TestFigure
from shm_daemon.web.figures_of_test.marks import SYMBOLS
from shm_daemon.web.figures_of_test.panels import Panel, drawn, log_axis, numbers, stacked

_LEAST_SPAN = 30.0
"""Of the axis of intervals: equal ones shall look equal."""


def _draw(shown: Shown) -> dict[str, Any] | None:
    sheet = shown.sheet
    damped = [m for m in sheet.modes if math.isfinite(m.damping_ratio)]
    sure = [m for m in sheet.modes if m.frequency_sd_hz > 0]
    if not damped and not sure:
        return None
    panels, traces = [], []
    if damped:
        panels.append(Panel("damping ratio (%)", y={"rangemode": "tozero"}))
        traces += [_damping(sheet, plane) for plane in _planes(damped)]
    if sure:
        label = "90 % interval of<br>the frequency (± %)"
        panels.append(Panel(label, y=log_axis(*_extent_percent(sure))))
        traces += [_width(sure, plane, len(panels)) for plane in _planes(sure)]
    low, high = shown_range(sheet)
    return drawn(traces, stacked(panels, "frequency (Hz)", range=[low, high]))


def _planes(modes: list[Mode]) -> list[Plane]:
    return [plane for plane in PLANES if any(mode.plane == plane for mode in modes)]


def _damping(sheet: TestSheet, plane: Plane) -> dict[str, Any]:
    modes = [mode for mode in sheet.modes if mode.plane == plane]
    halves = numbers(100 * NORMAL_90 * mode.damping_sd for mode in modes)
    return {
        **_marked(modes, plane), "y": numbers(100 * mode.damping_ratio for mode in modes),
        "error_y": {"type": "data", "array": halves, "color": PLANE_COLOURS[plane]},
    }  # fmt: skip


def _width(modes: list[Mode], plane: Plane, panel: int) -> dict[str, Any]:
    own = [mode for mode in modes if mode.plane == plane]
    widths = map(_percent, own)
    return {
        **_marked(own, plane), "y": numbers(widths), "yaxis": f"y{panel}".removesuffix("1"),
        "showlegend": panel == 1,
    }  # fmt: skip


def _percent(mode: Mode) -> float:
    """Half the 90 % interval of a mode's frequency, in percent of it."""
    return 100 * NORMAL_90 * mode.frequency_sd_hz / mode.frequency_hz


def _extent_percent(sure: list[Mode]) -> tuple[float, float]:
    """Where the axis of the intervals begins and ends."""
    low, high = (side(map(_percent, sure)) for side in (min, max))
    room = max(1.3, math.sqrt(_LEAST_SPAN * low / high))
    return low / room, high * room


def _marked(modes: list[Mode], plane: Plane) -> dict[str, Any]:
    return {
        "type": "scatter", "mode": "markers", "name": plane, "legendgroup": plane,
        "x": numbers(mode.frequency_hz for mode in modes),
        "marker": {"symbol": SYMBOLS[plane], "size": 8, "color": PLANE_COLOURS[plane]},
        "text": [f"{plane} {mode.order}" for mode in modes],
        "hovertemplate": "%{text}: %{x:.4g} Hz, %{y:.3g} %<extra></extra>",
    }  # fmt: skip


FIGURE = TestFigure(
    "damping", PRINTED.title, "store", _draw, lambda shown: PRINTED.caption(shown.sheet),
    lambda shown: PRINTED.alt(shown.sheet), height_px=lambda sheet: 440,
)  # fmt: skip
