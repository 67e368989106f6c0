"""Panels by plane, over the orders of the modes, that the figures of the gap share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from shm.report import DiagnosisSheet
from shm.report.diagnosis.figures.modes import planes
from shm.values import Plane, Residual
from shm_daemon.web.hanger_figures.over_time import Trace
from shm_daemon.web.hanger_figures.panels import axis, layout_name, stacked
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.plotting import colour, figure

LOOKS: dict[Plane, tuple[str, str]] = {
    "transverse": ("blue", "circle"),
    "longitudinal": ("orange", "square"),
}
"""Colour and mark of each plane."""


def sheet_of(view: HangerView) -> DiagnosisSheet:
    assert view.sheet is not None
    return view.sheet


def axes_of(residuals: Sequence[Residual]) -> dict[Plane, str]:
    """The vertical axis of each plane that was measured."""
    return {plane: axis("y", number) for number, plane in enumerate(planes(residuals))}


def by_plane(
    traces: Sequence[Trace], residuals: Sequence[Residual], y_label: str
) -> dict[str, Any]:
    """A panel a plane, one below the other."""
    found = planes(residuals)
    layout = stacked([f"{plane} plane" for plane in found], y_label)
    for number in range(1, len(found)):
        layout[layout_name("y", number)]["matches"] = "y"
    highest = max(residual.order for residual in residuals)
    return figure(
        traces,
        "order of the mode",
        y_label,
        xaxis={
            "anchor": axis("y", len(found) - 1), "range": [0.4, highest + 0.6], "tick0": 1,
            "dtick": 1 if highest <= 16 else 2, "showgrid": False,
        },
        hovermode="closest",
        **layout,
    )  # fmt: skip


def marks(
    x: Sequence[float],
    y: Sequence[float],
    name: str,
    y_axis: str,
    hue: str,
    symbol: str,
    **more: Any,
) -> Trace:
    """Marks of one kind in one panel; each kind stands in the legend once."""
    return {
        "type": "scatter", "mode": "markers", "name": name, "legendgroup": name, "yaxis": y_axis,
        "x": list(x), "y": list(y), "marker": {"color": colour(hue), "symbol": symbol, "size": 7},
        "showlegend": y_axis == "y", **more,
    }  # fmt: skip
