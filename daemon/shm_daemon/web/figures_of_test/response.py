"""Frequency response at one point with the fit of the modes over it, phase and coherence.

Of an ambient test, in which nobody hit, the spectral density stands instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shm.report import TestSheet, words
from shm.report.figures.style import PLANE_COLOURS
from shm.report.sheet.figures.response import FIGURE as PRINTED
from shm.report.sheet.spectra import shown_range
from shm.report.sheet.thinning import envelope_places, peak_places
from shm.values import ComplexArray, FloatArray, FrequencyResponse, ResponsePoint
from shm_daemon.web import plotting
from shm_daemon.web.figures_of_test.contract import Shown, TestFigure
from shm_daemon.web.figures_of_test.marks import marks, marks_axis, with_headroom
from shm_daemon.web.figures_of_test.panels import Panel, axis, drawn, numbers, stacked

_BINS = 700
_MAGNITUDE = "y"


def _draw(shown: Shown) -> dict[str, Any] | None:
    found = shown.spectrum
    if found is None or shown.point >= len(found.points):
        return None
    low, high = shown_range(shown.sheet)
    high = min(high, float(found.frequency_hz[-1]))
    lines = _lines(found.frequency_hz, low, high)
    values = found.values[shown.point, lines]
    panels = [_magnitude_panel(shown, values), *_panels_below(shown.sheet)]
    layout = stacked(panels, "frequency (Hz)", range=[low, high])
    overlay = len(panels) + 1
    layout[f"yaxis{overlay}"] = marks_axis(_MAGNITUDE)
    traces = [
        *_magnitude(shown, lines),
        *_below(shown, lines),
        *marks(shown.sheet, axis("y", overlay)),
    ]
    return drawn(traces, layout)


def _lines(frequency_hz: FloatArray, low: float, high: float) -> slice:
    """The lines that are drawn; that at 0 Hz says nothing of a response."""
    start, stop = np.searchsorted(frequency_hz, [low, high], side="right")
    return slice(max(1, int(start) - 1), int(stop) + 1)


def _magnitude_panel(shown: Shown, values: FloatArray) -> Panel:
    assert shown.spectrum is not None
    y: dict[str, Any] = {"type": "log", "exponentformat": "power", "dtick": 1}
    known = values[np.isfinite(values) & (values > 0)]
    if len(known):
        bottom, top = np.log10([0.5 * np.quantile(known, 0.02), 1.5 * known.max()])
        y["range"] = with_headroom(float(bottom), float(top))
    return Panel(shown.spectrum.quantity, 2.2, y)


def _panels_below(sheet: TestSheet) -> list[Panel]:
    response = sheet.identification.frequency_response
    if response is None:
        return []
    # From -90 to 270 degrees, so that 0 and 180, between which the phase jumps, lie inside.
    phase = Panel("phase (°)", 1.0, {"range": [-95, 275], "tickvals": [0, 90, 180]})
    coherence = Panel("coherence", 0.9, {"range": [0, 1.05], "tickvals": [0, 0.5, 1]})
    return [phase] if response.coherence is None else [phase, coherence]


def _magnitude(shown: Shown, lines: slice) -> list[dict[str, Any]]:
    found, fit = shown.spectrum, shown.sheet.identification.fit
    assert found is not None
    frequency_hz, values = found.frequency_hz[lines], found.values[shown.point, lines]
    measured = {"color": _colour(found.points[shown.point]), "width": 2.2}
    traces = [_curve(frequency_hz, values, "y", measured, "measured")]
    if fit is not None:
        thin = {"color": plotting.colour("ink"), "width": 1}
        size = np.abs(fit[shown.point, lines])
        traces.append(_curve(frequency_hz, size, "y", thin, "fit of the modes"))
    return traces


def _below(shown: Shown, lines: slice) -> list[dict[str, Any]]:
    response = shown.sheet.identification.frequency_response
    if response is None:
        return []
    traces = _phase(shown, response, lines)
    if response.coherence is not None:
        values = response.coherence[shown.point, lines]
        style = {"color": _colour(response.points[shown.point]), "width": 1}
        traces.append(_curve(response.frequency_hz[lines], values, "y3", style))
    return traces


def _phase(shown: Shown, response: FrequencyResponse, lines: slice) -> list[dict[str, Any]]:
    measured, fit = response.accelerance[shown.point, lines], shown.sheet.identification.fit
    # Of noise, phase fills the whole panel: the strongest line of each bin stands for it.
    places = peak_places(np.abs(measured), min(2 * _BINS, len(measured)))
    frequency_hz = response.frequency_hz[lines][places]
    colour = _colour(response.points[shown.point])
    traces = [_trace(frequency_hz, _degrees(measured[places]), "y2", {"color": colour})]
    if fit is not None:
        fitted = _degrees(fit[shown.point, lines][places])
        thin = {"color": plotting.colour("ink"), "width": 1}
        traces.append(_trace(frequency_hz, fitted, "y2", thin))
    return traces


def _curve(
    frequency_hz: FloatArray, values: FloatArray, y: str, line: dict[str, Any], name: str = ""
) -> dict[str, Any]:
    places = envelope_places(values, _BINS)
    return _trace(frequency_hz[places], values[places], y, line, name)


def _trace(
    frequency_hz: FloatArray, values: FloatArray, y: str, line: dict[str, Any], name: str = ""
) -> dict[str, Any]:
    return {
        "type": "scatter", "mode": "lines", "x": numbers(frequency_hz), "y": numbers(values),
        "yaxis": y, "line": line, "name": name or " ", "showlegend": bool(name),
        "hovertemplate": "%{x:.2f} Hz: %{y:.4g}<extra></extra>",
    }  # fmt: skip


def _degrees(values: ComplexArray) -> FloatArray:
    return np.asarray((np.degrees(np.angle(values)) + 90) % 360 - 90)


def _colour(point: ResponsePoint) -> str:
    return PLANE_COLOURS[point.plane] if point.plane else plotting.colour("purple")


def _name(shown: Shown) -> str:
    assert shown.spectrum is not None
    return point_name(shown.spectrum.points[shown.point])


def point_name(point: ResponsePoint) -> str:
    """Name, plane and place of a response."""
    return words.place(point.name, point.plane, point.x_m)


def _caption(shown: Shown) -> str:
    found = shown.sheet.identification
    marked = "Marks and lines: modes by plane, with their order."
    if found.frequency_response is None:
        return f"{_name(shown)}: power spectral density; nobody hit. {marked}"
    fit = (
        "the fit made of the identified modes is the thin line"
        if found.fit is not None
        else "the fit of the modes is not at hand"
    )
    below = (
        "Below, coherence: 1 where the force explains the response."
        if found.frequency_response.coherence is not None
        else "The coherence is not known."
    )
    return f"{_name(shown)}: acceleration per force, magnitude and phase; {fit}. {below} {marked}"


FIGURE = TestFigure(
    "response", PRINTED.title, "both", _draw, _caption, lambda shown: PRINTED.alt(shown.sheet),
    height_px=lambda sheet: 620,
)  # fmt: skip
