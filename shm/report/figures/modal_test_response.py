"""Draw the response at a few points with the modal fit over it, phase and coherence.

Of an ambient test it is the spectral density. A screen shows the one point that is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.report.figures.modal_test_axes import (
    ResponseCurves,
    Spectrum,
    mode_marks,
    shown_range,
    with_headroom_log,
)
from shm.values import (
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Mode,
    ResponsePoint,
)


def telling_points(
    points: Sequence[ResponsePoint], modes: Sequence[Mode], values: FloatArray, most: int
) -> list[int]:
    """Return indices of at most `most` points that together show the modes best.

    `values` (points, modes) is how strongly each point shows each mode. Planes take turns.
    """
    share = values / np.maximum(np.max(values, axis=0, initial=0.0), np.finfo(float).tiny)
    planes = list(dict.fromkeys(point.plane for point in points))
    covered = np.zeros((len(planes), len(modes)))
    chosen: list[int] = []
    for turn in range(len(points)):
        plane = turn % len(planes)
        left = [i for i, p in enumerate(points) if p.plane == planes[plane] and i not in chosen]
        if left and len(chosen) < most:
            best = max(left, key=lambda i: float(np.sum(np.maximum(covered[plane], share[i]))))
            covered[plane] = np.maximum(covered[plane], share[best])
            chosen.append(best)
    return sorted(chosen)


def shown_points(sheet: ModalTestReport, found: Spectrum, most: int) -> list[int]:
    """Return indices of the points of `found` that are drawn."""
    lines = np.searchsorted(found.frequency_hz, [mode.frequency_hz for mode in sheet.modes])
    lines = np.minimum(lines, len(found.frequency_hz) - 1)
    values = np.nan_to_num(found.values[:, lines])
    return telling_points(found.points, sheet.modes, values, most)


# Layout: curves that can be told apart, and as many bins as a page has dots.
_MOST_POINTS = 4
_BINS = 550
_HOVER = "%{x:.2f} Hz: %{y:.4g}"


def _draw(shown: ResponseCurves) -> spec.Specification | None:
    found, points = shown.spectrum, _points(shown)
    if found is None or not points:
        return None
    response = shown.sheet.identification.frequency_response
    low, high = shown_range(shown.sheet)
    band_hz = (low, min(high, float(found.frequency_hz[-1])))
    panels = []
    for index in points:
        panels.append(_magnitude(shown, found, index, band_hz))
        if response is not None:
            panels.append(_phase(shown, response, index, band_hz))
    if response is not None and response.coherence is not None:
        panels.append(_coherence(shown, response, points, band_hz))
    panels[-1] = replace(panels[-1], x=spec.Axis(label="frequency (Hz)", range=band_hz))
    return spec.stacked(panels, sum(panel.height for panel in panels) + 0.7, legend_columns=3)


def _points(shown: ResponseCurves) -> list[int]:
    """Return indices of the points that are drawn."""
    if shown.spectrum is None:
        return []
    if shown.point is None:
        return shown_points(shown.sheet, shown.spectrum, _MOST_POINTS)
    return [shown.point] if shown.point < len(shown.spectrum.points) else []


def _lines(frequency_hz: FloatArray, band_hz: tuple[float, float]) -> slice:
    """Return the lines within the axis; that at 0 Hz says nothing of a response."""
    start, stop = np.searchsorted(frequency_hz, band_hz, side="right")
    return slice(max(1, int(start) - 1), int(stop) + 1)


def _magnitude(
    shown: ResponseCurves, found: Spectrum, index: int, band_hz: tuple[float, float]
) -> spec.Panel:  # fmt: skip
    point, fit = found.points[index], shown.sheet.identification.fit
    lines = _lines(found.frequency_hz, band_hz)
    frequency_hz, values = found.frequency_hz[lines], found.values[index, lines]
    marks: list[spec.Mark] = [_curve(frequency_hz, values, point, 1.7, "measured")]
    if fit is not None:
        fitted = np.abs(fit[index, lines])
        marks.append(_curve(frequency_hz, fitted, None, 0.6, "fit of the modes"))
    known = values[np.isfinite(values) & (values > 0)]
    # From the floor of the curve to its top, with room above for the marks.
    extent = (0.5 * float(np.quantile(known, 0.02)), 1.5 * float(known.max())) if len(known) else ()
    label = found.quantity.replace(" (", "\n(", 1)
    return spec.Panel(
        y=spec.Axis(label=label, scale="log", range=with_headroom_log(*extent) if extent else None),
        marks=[*marks, *mode_marks(shown.sheet, *band_hz)],
        title=point_name(point), height=1.35,
    )  # fmt: skip


def _curve(
    frequency_hz: FloatArray, values: FloatArray, point: ResponsePoint | None, width: float,
    name: str = "", dash: spec.Dash = "solid",
) -> spec.Line:  # fmt: skip
    """Return a curve in the colour of the point's plane; dark without one."""
    places = spec.envelope_places(values, _BINS)
    return spec.Line(
        x=frequency_hz[places], y=values[places], width=width, name=name, dash=dash, hover=_HOVER,
        colour=spec.plane_colour(point.plane) if point else "ink",
    )  # fmt: skip


def _phase(
    shown: ResponseCurves, response: FrequencyResponse, index: int, band_hz: tuple[float, float]
) -> spec.Panel:
    """Return phase from -90 to 270 degrees, so that 0 and 180, where it jumps, are inside."""
    lines, fit = _lines(response.frequency_hz, band_hz), shown.sheet.identification.fit
    measured = response.accelerance[index, lines]
    # Of noise, phase fills the whole panel: the strongest line of each bin stands for it.
    places = spec.peak_places(np.abs(measured), min(2 * _BINS, len(measured)))
    frequency_hz = response.frequency_hz[lines][places]
    colour = spec.plane_colour(response.points[index].plane)
    look: dict[str, Any] = {"x": frequency_hz, "hover": _HOVER}
    marks = [spec.Line(y=_degrees(measured[places]), colour=colour, width=1.3, **look)]
    if fit is not None:
        marks.append(spec.Line(y=_degrees(fit[index, lines][places]), width=0.6, **look))
    axis = spec.Axis(label="phase (°)", range=(-95, 275), ticks=(0, 180))
    return spec.Panel(y=axis, marks=marks, height=0.62)


def _degrees(values: ComplexArray) -> FloatArray:
    return np.asarray((np.degrees(np.angle(values)) + 90) % 360 - 90)


def _coherence(
    shown: ResponseCurves,
    response: FrequencyResponse,
    points: Sequence[int],
    band_hz: tuple[float, float],
) -> spec.Panel:
    assert response.coherence is not None
    lines, marks, seen = _lines(response.frequency_hz, band_hz), [], set()
    for index in points:
        point, values = response.points[index], response.coherence[index, lines]
        dash: spec.Dash = "dash" if point.plane in seen else "solid"
        seen.add(point.plane)
        marks.append(_curve(response.frequency_hz[lines], values, point, 0.7, dash=dash))
    axis = spec.Axis(label="coherence", range=(0, 1.05), ticks=(0, 0.5, 1))
    return spec.Panel(y=axis, marks=marks, height=0.7)


def point_name(point: ResponsePoint) -> str:
    """Name, plane and place of a response."""
    return formatting.place(point.name, point.plane, point.x_m)


def _caption(shown: ResponseCurves) -> str:
    found, identified = shown.spectrum, shown.sheet.identification
    assert found is not None
    response = identified.frequency_response
    some = formatting.some(len(_points(shown)), len(found.points), "measured points")
    if response is None:
        density = "Power spectral density of the accelerations; nobody hit."
        return f"{density} {_MARKS}{some}"
    below = (
        "The coherence is not known. "
        if response.coherence is None
        else "Below, coherence: 1 where the force explains the response, dashed at the second "
        "point of a plane. "
    )
    fit = (
        "the fit of the modes is not at hand. "
        if identified.fit is None
        else "the fit made of the identified modes is the thin dark line. "
    )
    return f"Acceleration per force, magnitude and phase; {fit}{below}{_MARKS}{some}"


_MARKS = "Marks and lines: modes by plane, with their order where there is room."


def _alt(shown: ResponseCurves) -> str:
    sheet = shown.sheet
    modes = sorted(sheet.modes, key=lambda mode: mode.frequency_hz)
    listed = ", ".join(f"{m.plane} {m.order} at {m.frequency_hz:.2f} Hz" for m in modes)
    kind = "Frequency response"
    if sheet.identification.frequency_response is None:
        kind = "Power spectral density"
    return f"{kind} with {len(modes)} identified modes: {listed}."


FIGURE = spec.FigureSpec("response", "Response and modes", _draw, _caption, _alt)
