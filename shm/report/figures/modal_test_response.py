"""Draw the response at a few points with the modal fit over it, phase and coherence.

Of an ambient test it is the spectral density. A screen shows the one point that is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from shm.report import formatting
from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.values import (
    PLANES,
    ComplexArray,
    FloatArray,
    FrequencyResponse,
    Mode,
    Recording,
    ResponsePoint,
)

# Eight segments smooth a spectrum to a third (1 / sqrt 8); 20 s resolve 0.05 Hz.
_LEAST_SEGMENT_S = 20.0
_SEGMENTS = 8
_MARGIN = 0.06  # layout: of the width


@dataclass(frozen=True, eq=False)
class Spectrum:
    """`values` (points, lines), not negative, on `frequency_hz` (lines,)."""

    points: tuple[ResponsePoint, ...]
    frequency_hz: FloatArray
    values: FloatArray
    quantity: str

    @property
    def together(self) -> FloatArray:
        """Root mean square over the points, (lines,)."""
        return np.asarray(np.sqrt(np.mean(np.square(self.values), axis=0)))


def spectrum(sheet: ModalTestReport) -> Spectrum | None:
    """Return the accelerance where somebody hit, else the power spectral density of the records."""
    response = sheet.identification.frequency_response
    if response is not None and response.points:
        values = np.abs(response.accelerance)
        return Spectrum(response.points, response.frequency_hz, values, "accelerance (m/s²/N)")
    if response is None and sheet.recordings:
        return _density(sheet.recordings)
    return None


@dataclass(frozen=True, eq=False)
class ResponseCurves:
    """A sheet, the curve its modes are peaks of, and which response of it is asked for.

    `point` is an index into the points of `spectrum`; None: those that show the modes best.
    """

    sheet: ModalTestReport
    spectrum: Spectrum | None
    point: int | None = None

    @classmethod
    def of(cls, sheet: ModalTestReport, point: int | None = None) -> ResponseCurves:
        """Return the curves computed from the records of the sheet, which must be there."""
        return cls(sheet, spectrum(sheet), point)


def _density(records: Sequence[Recording]) -> Spectrum | None:
    """Return Welch's estimate (1967), averaged over the records with the sensors of the first."""
    first = records[0]
    similar = [r for r in records if len(r.accelerations) == len(first.accelerations)]
    length = min(record.samples for record in similar)
    wanted = max(length // _SEGMENTS, int(_LEAST_SEGMENT_S * first.sampling_rate_hz))
    if not first.accelerations or length < 2:
        return None
    estimates = [_welch(record, min(length, wanted)) for record in similar]
    points = tuple(ResponsePoint(c.name, c.plane, c.x_m) for c in first.accelerations)
    values = np.mean([values for _, values in estimates], axis=0)
    return Spectrum(points, estimates[0][0], values, "spectral density ((m/s²)²/Hz)")


def _welch(record: Recording, segment: int) -> tuple[FloatArray, FloatArray]:
    signals = np.array([channel.values for channel in record.accelerations])
    known = np.isfinite(signals)
    # A gap counts as rest: it lowers the level a little and hides no peak.
    rest = np.nan_to_num(signals - np.mean(signals, axis=1, where=known, keepdims=True))
    frequency_hz, values = scipy.signal.welch(
        rest, record.sampling_rate_hz, nperseg=segment, axis=1
    )
    return frequency_hz, values


def shown_range(sheet: ModalTestReport) -> tuple[float, float]:
    """Return the lowest and highest frequency to draw, in Hz."""
    low, high = searched_range(sheet)
    return (0.0 if low < 0.15 * high else low - _MARGIN * (high - low), high * (1 + _MARGIN / 2))


def searched_range(sheet: ModalTestReport) -> tuple[float, float]:
    """Return the band in Hz; if unknown, from the lowest to the highest mode."""
    if sheet.band_hz is not None:
        return sheet.band_hz
    found = [mode.frequency_hz for mode in sheet.modes]
    found += [each.frequency_hz for each in sheet.identification.set_aside]
    found += sheet.identification.poles.frequency_hz.tolist()
    return (min(found), max(found)) if found else (0.0, math.inf)


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


_MARK_ROWS = {"transverse": 0.94, "longitudinal": 0.83}
_EXCLUDED_ROW = 0.72
_LABEL_ROOM = 0.026
"""Least distance of two numbers, as a share of the axis."""
_HEADROOM = 0.36
"""Share of the axes' height that the marks take."""


def mode_marks(sheet: ModalTestReport, low_hz: float, high_hz: float) -> list[spec.Mark]:
    """Return a symbol and a line at each mode within the axis, a row for each plane.

    Orders are written where there is room.
    """
    found: list[spec.Mark] = []
    for plane in PLANES:
        modes = sorted(
            (m for m in sheet.modes if m.plane == plane and low_hz <= m.frequency_hz <= high_hz),
            key=lambda mode: mode.frequency_hz,
        )
        at = [mode.frequency_hz for mode in modes]
        is_lonely = np.diff([*at, math.inf]) >= _LABEL_ROOM * (high_hz - low_hz)
        labels = [str(m.order) if alone else "" for m, alone in zip(modes, is_lonely, strict=True)]
        texts = [f"{plane} {m.order}: {m.frequency_hz:.4g} Hz" for m in modes]
        look = (spec.PLANE_HUES[plane], spec.PLANE_SYMBOLS[plane])
        found += _marked_row(at, _MARK_ROWS[plane], *look, f"{plane} mode", texts, labels)
    apart = [s for s in sheet.identification.set_aside if low_hz <= s.frequency_hz <= high_hz]
    at = [each.frequency_hz for each in apart]
    texts = [f"{each.kind}, {each.frequency_hz:.4g} Hz: {each.reason}" for each in apart]
    name = "excluded"
    return found + _marked_row(at, _EXCLUDED_ROW, "red", "cross", name, texts, [], "dot")


def _marked_row(
    at: Sequence[float], height: float, colour: str, symbol: spec.Symbol, name: str,
    texts: Sequence[str], labels: Sequence[str], dash: spec.Dash = "solid",
) -> list[spec.Mark]:  # fmt: skip
    if not at:
        return []
    x = [place for each in at for place in (each, each, math.nan)]
    stems = [0.0, height, math.nan] * len(at)
    return [
        spec.Line(x=x, y=stems, in_shares=True, colour=colour, opacity=0.45, width=0.5, dash=dash),
        spec.Points(
            x=at, y=[height] * len(at), in_shares=True, colour=colour, symbol=symbol, size=4.0,
            name=name, texts=texts, labels=labels,
        ),
    ]  # fmt: skip


def with_headroom(low: float, high: float) -> tuple[float, float]:
    """Return a range of which the upper part is left to the marks."""
    return low, high + (high - low) * _HEADROOM / (1 - _HEADROOM)


def with_headroom_log(low: float, high: float) -> tuple[float, float]:
    """Return the same of a logarithmic axis."""
    lowest, highest = with_headroom(math.log10(low), math.log10(high))
    return 10**lowest, 10**highest


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
