"""How modes, and what is not one, are marked over frequency: a row for each plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from shm.report import TestSheet
from shm.report.figures.style import PLANE_COLOURS
from shm.report.sheet.figures.marks import HEADROOM
from shm.values import PLANES
from shm_daemon.web import plotting
from shm_daemon.web.figures_of_test.panels import escaped, numbers

SYMBOLS = {"transverse": "circle", "longitudinal": "square"}
_ROWS = {"transverse": 0.94, "longitudinal": 0.84}
_SET_ASIDE_ROW = 0.74


def marks(sheet: TestSheet, y: str) -> list[dict[str, Any]]:
    """A line and a marker at each mode, its order beside; `y` names the axis of `marks_axis`."""
    traces = []
    for plane in PLANES:
        modes = [mode for mode in sheet.modes if mode.plane == plane]
        if modes:
            found = [mode.frequency_hz for mode in modes]
            told = [f"{plane} {m.order}: {m.frequency_hz:.4g} Hz" for m in modes]
            style = {"color": PLANE_COLOURS[plane], "symbol": SYMBOLS[plane]}
            labels = [str(mode.order) for mode in modes]
            traces += _row(f"{plane} mode", found, _ROWS[plane], y, style, told, labels)
    apart = sheet.identification.set_aside
    if apart:
        found = [each.frequency_hz for each in apart]
        told = [f"{each.kind}, {each.frequency_hz:.4g} Hz: {each.reason}" for each in apart]
        style = {"color": plotting.colour("red"), "symbol": "x"}
        name = "set aside: not a mode of the hanger"
        traces += _row(name, found, _SET_ASIDE_ROW, y, style, told, [""] * len(apart))
    return traces


def marks_axis(over: str) -> dict[str, Any]:
    """An axis from 0 to 1 without numbers over the panel of the axis `over`."""
    return {"overlaying": over, "range": [0, 1], "visible": False, "fixedrange": True}


def with_headroom(low: float, high: float) -> list[float]:
    """A range of which the upper part is left to the marks."""
    return [low, high + (high - low) * HEADROOM / (1 - HEADROOM)]


def _row(
    name: str, found: Sequence[float], row: float, y: str, style: dict[str, Any],
    told: Sequence[str], labels: Sequence[str],
) -> list[dict[str, Any]]:  # fmt: skip
    """The markers with their legend, and the lines below them that go with it."""
    markers = {
        "type": "scatter", "mode": "markers+text", "name": name, "legendgroup": name, "yaxis": y,
        "x": numbers(found), "y": [row] * len(found), "text": list(labels),
        "textposition": "middle right", "textfont": {"size": 10, "color": style["color"]},
        "marker": {**style, "size": 7}, "hovertext": [escaped(each) for each in told],
        "hoverinfo": "text",
    }  # fmt: skip
    lines = {
        "type": "scatter", "mode": "lines", "legendgroup": name, "showlegend": False, "yaxis": y,
        "x": [x for each in numbers(found) for x in (each, each, None)],
        "y": [height for _ in found for height in (0, row, None)],
        "line": {"color": style["color"], "width": 0.8}, "opacity": 0.45, "hoverinfo": "skip",
    }  # fmt: skip
    return [lines, markers]
