"""The curve in which the modes of a test are peaks, and how modes are marked over frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.report.contents import ModalTestReport
from shm.report.figures.specification import (
    PLANE_HUES,
    PLANE_SYMBOLS,
    Dash,
    Line,
    Mark,
    Points,
    Symbol,
)
from shm.values import PLANES, FloatArray, Mode, Recording, ResponsePoint

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
    """The accelerance where somebody hit, else the power spectral density of the records."""
    response = sheet.identification.frequency_response
    if response is not None and response.points:
        values = np.abs(response.accelerance)
        return Spectrum(response.points, response.frequency_hz, values, "accelerance (m/s²/N)")
    if response is None and sheet.recordings:
        return _density(sheet.recordings)
    return None


@dataclass(frozen=True, eq=False)
class Shown:
    """A sheet, the curve its modes are peaks of, and on screen which response of it is asked for.

    `point` is an index into the points of `spectrum`; None on paper, where several are shown.
    """

    sheet: ModalTestReport
    spectrum: Spectrum | None
    point: int | None = None

    @classmethod
    def of(cls, sheet: ModalTestReport, point: int | None = None) -> Shown:
        """With the curve worked out from the sheet, whose records must be there."""
        return cls(sheet, spectrum(sheet), point)

    @property
    def is_on_screen(self) -> bool:
        return self.point is not None


def _density(records: Sequence[Recording]) -> Spectrum | None:
    """Welch's estimate (1967), averaged over the records that have the sensors of the first."""
    first = records[0]
    alike = [r for r in records if len(r.accelerations) == len(first.accelerations)]
    length = min(record.samples for record in alike)
    wanted = max(length // _SEGMENTS, int(_LEAST_SEGMENT_S * first.sampling_rate_hz))
    if not first.accelerations or length < 2:
        return None
    estimates = [_welch(record, min(length, wanted)) for record in alike]
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
    """Lowest and highest frequency to draw, in Hz."""
    low, high = searched_range(sheet)
    return (0.0 if low < 0.15 * high else low - _MARGIN * (high - low), high * (1 + _MARGIN / 2))


def searched_range(sheet: ModalTestReport) -> tuple[float, float]:
    """The band in Hz; where it is not known, from the lowest to the highest that was found."""
    if sheet.band_hz is not None:
        return sheet.band_hz
    found = [mode.frequency_hz for mode in sheet.modes]
    found += [each.frequency_hz for each in sheet.identification.set_aside]
    found += sheet.identification.poles.frequency_hz.tolist()
    return (min(found), max(found)) if found else (0.0, math.inf)


def telling_points(
    points: Sequence[ResponsePoint], modes: Sequence[Mode], values: FloatArray, most: int
) -> list[int]:
    """Indices of at most `most` points that between them show the modes best, in their order.

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
    """Indices of the points of `found` that are drawn."""
    lines = np.searchsorted(found.frequency_hz, [mode.frequency_hz for mode in sheet.modes])
    lines = np.minimum(lines, len(found.frequency_hz) - 1)
    values = np.nan_to_num(found.values[:, lines])
    return telling_points(found.points, sheet.modes, values, most)


_ROWS = {"transverse": 0.94, "longitudinal": 0.83}
_SET_ASIDE_ROW = 0.72
_ROOM = 0.026
"""Least distance of two numbers, as a share of the axis."""
_HEADROOM = 0.36
"""Share of the axes' height that the marks take."""


def mode_marks(sheet: ModalTestReport, low_hz: float, high_hz: float) -> list[Mark]:
    """A symbol and a line at each mode within the axis, a row for each plane, orders where there is
    room."""
    found: list[Mark] = []
    for plane in PLANES:
        modes = sorted(
            (m for m in sheet.modes if m.plane == plane and low_hz <= m.frequency_hz <= high_hz),
            key=lambda mode: mode.frequency_hz,
        )
        at = [mode.frequency_hz for mode in modes]
        is_lonely = np.diff([*at, math.inf]) >= _ROOM * (high_hz - low_hz)
        labels = [str(m.order) if alone else "" for m, alone in zip(modes, is_lonely, strict=True)]
        texts = [f"{plane} {m.order}: {m.frequency_hz:.4g} Hz" for m in modes]
        look = (PLANE_HUES[plane], PLANE_SYMBOLS[plane])
        found += _row(at, _ROWS[plane], *look, f"{plane} mode", texts, labels)
    apart = [s for s in sheet.identification.set_aside if low_hz <= s.frequency_hz <= high_hz]
    at = [each.frequency_hz for each in apart]
    texts = [f"{each.kind}, {each.frequency_hz:.4g} Hz: {each.reason}" for each in apart]
    name = "set aside"
    return found + _row(at, _SET_ASIDE_ROW, "red", "cross", name, texts, [], "dot")


def _row(
    at: Sequence[float], height: float, colour: str, symbol: Symbol, name: str,
    texts: Sequence[str], labels: Sequence[str], dash: Dash = "solid",
) -> list[Mark]:  # fmt: skip
    if not at:
        return []
    x = [place for each in at for place in (each, each, math.nan)]
    stems = [0.0, height, math.nan] * len(at)
    return [
        Line(x=x, y=stems, in_shares=True, colour=colour, opacity=0.45, width=0.5, dash=dash),
        Points(
            x=at, y=[height] * len(at), in_shares=True, colour=colour, symbol=symbol, size=4.0,
            name=name, texts=texts, labels=labels,
        ),
    ]  # fmt: skip


def with_headroom(low: float, high: float) -> tuple[float, float]:
    """A range of which the upper part is left to the marks."""
    return low, high + (high - low) * _HEADROOM / (1 - _HEADROOM)


def with_headroom_log(low: float, high: float) -> tuple[float, float]:
    """The same of a logarithmic axis."""
    lowest, highest = with_headroom(math.log10(low), math.log10(high))
    return 10**lowest, 10**highest
