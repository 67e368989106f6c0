"""Stabilisation diagram: poles over model order, the spectrum behind, what was chosen."""

from __future__ import annotations

from typing import Any

import numpy as np

from shm.report.sheet.figures.stabilisation import FIGURE as PRINTED
from shm.report.sheet.spectra import Spectrum, shown_range
from shm.report.sheet.thinning import envelope_places
from shm.values import BoolArray
from shm_daemon.web import plotting
from shm_daemon.web.figures_of_test.contract import Shown, TestFigure
from shm_daemon.web.figures_of_test.marks import marks, marks_axis, with_headroom
from shm_daemon.web.figures_of_test.panels import Panel, drawn, numbers, stacked

_BINS = 550
_LEAST_SPAN = 2.0


def _draw(shown: Shown) -> dict[str, Any] | None:
    poles = shown.sheet.identification.poles
    if not len(poles.order):
        return None
    low, high = shown_range(shown.sheet)
    lowest, highest = float(poles.order.min()), float(poles.order.max())
    bottom = lowest - 0.03 * max(highest - lowest, _LEAST_SPAN)
    orders = Panel("model order", y={"range": with_headroom(bottom, highest)})
    layout = stacked([orders], "frequency (Hz)", range=[low, high])
    layout["yaxis3"] = marks_axis("y")
    traces = [
        _poles(shown, ~poles.stable, "dropped pole", {"symbol": "x-thin", "size": 5}, "quiet"),
        _poles(shown, poles.stable, "stable pole", {"symbol": "circle", "size": 5}, "green"),
        *marks(shown.sheet, "y3"),
    ]
    if shown.spectrum is not None:
        curve, behind = _background(shown.spectrum, low, high)
        layout["yaxis2"] = behind
        traces = [curve, *traces]
    return drawn(traces, layout)


def _poles(
    shown: Shown, which: BoolArray, name: str, marker: dict[str, Any], colour: str
) -> dict[str, Any]:
    poles, tint = shown.sheet.identification.poles, plotting.colour(colour)
    return {
        "type": "scatter", "mode": "markers", "name": name,
        "x": numbers(poles.frequency_hz[which]), "y": numbers(poles.order[which]),
        "marker": {**marker, "color": tint, "line": {"color": tint, "width": 1}},
        "customdata": numbers(100 * poles.damping_ratio[which]),
        "hovertemplate": "%{x:.3f} Hz, order %{y}, damping %{customdata:.2g} %<extra></extra>",
    }  # fmt: skip


def _background(found: Spectrum, low: float, high: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """The spectrum over all points, and its logarithmic axis without numbers."""
    start, stop = np.searchsorted(found.frequency_hz, [low, high])
    lines = slice(max(1, int(start)), int(stop) + 1)
    values = found.together[lines]
    places = envelope_places(values, _BINS)
    curve = {
        "type": "scatter", "mode": "lines", "name": "spectrum of all points (log scale)",
        "x": numbers(found.frequency_hz[lines][places]), "y": numbers(values[places]),
        "yaxis": "y2", "line": {"color": plotting.colour("quiet"), "width": 1}, "opacity": 0.6,
        "hoverinfo": "skip",
    }  # fmt: skip
    behind: dict[str, Any] = {"overlaying": "y", "type": "log", "visible": False}
    known = values[np.isfinite(values) & (values > 0)]
    if len(known):
        bottom, top = np.log10([0.5 * np.quantile(known, 0.01), known.max()])
        behind["range"] = with_headroom(float(bottom), float(top))
    return curve, behind


FIGURE = TestFigure(
    "stabilisation", PRINTED.title, "file", _draw, lambda shown: PRINTED.caption(shown.sheet),
    lambda shown: PRINTED.alt(shown.sheet), height_px=lambda sheet: 520,
)  # fmt: skip
