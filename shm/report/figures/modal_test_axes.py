"""Prepare the figures of a hammer test: their data, the range of frequencies, marks of modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from shm.report.contents import ModalTestReport
from shm.report.figures import specification as spec
from shm.values import PLANES, FloatArray, Recording, ResponsePoint

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
