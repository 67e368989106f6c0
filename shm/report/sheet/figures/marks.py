"""How modes, and what is not one, are marked over frequency in every figure."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.report.contents import TestSheet
from shm.report.figures.specification import (
    PLANE_HUES,
    PLANE_SYMBOLS,
    Dash,
    Line,
    Mark,
    Points,
    Symbol,
)
from shm.values import PLANES

_ROWS = {"transverse": 0.94, "longitudinal": 0.83}
_SET_ASIDE_ROW = 0.72
_ROOM = 0.026
"""Least distance of two numbers, as a share of the axis."""
_HEADROOM = 0.36
"""Share of the axes' height that the marks take."""


def mode_marks(sheet: TestSheet, low_hz: float, high_hz: float) -> list[Mark]:
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
    name = "set aside: not a mode of the hanger"
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
