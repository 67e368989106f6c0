"""Damping and uncertainty of the modes over frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.report.figures.illustration import Member
from shm.report.figures.modal_test_spectra import Shown, shown_range
from shm.report.figures.specification import (
    PLANE_HUES,
    PLANE_SYMBOLS,
    Axis,
    Mark,
    Panel,
    Points,
    Specification,
    log_axis,
    stacked,
)
from shm.report.intervals import NORMAL_90
from shm.values import PLANES, FloatArray, Mode

_LEAST_SPAN = 30.0
"""Of the axis of intervals: equal ones shall look equal."""


def _draw(shown: Shown) -> Specification | None:
    damped = [m for m in shown.sheet.modes if math.isfinite(m.damping_ratio)]
    sure = [m for m in shown.sheet.modes if m.frequency_sd_hz > 0]
    across = Axis(label="frequency (Hz)", range=shown_range(shown.sheet))
    panels = []
    if damped:
        panels.append(_damping(damped, None if sure else across))
    if sure:
        panels.append(_uncertainty(sure, across))
    return stacked(panels, 4.6 if sure else 2.9) if panels else None


def _damping(modes: Sequence[Mode], across: Axis | None) -> Panel:
    value = np.array([100 * mode.damping_ratio for mode in modes])
    half = np.nan_to_num([100 * NORMAL_90 * mode.damping_sd for mode in modes])
    axis = Axis(label="damping ratio (%)", range=(0, 1.1 * float(max(value + half))))
    return Panel(y=axis, marks=_marks(modes, value, half), x=across)


def _uncertainty(modes: Sequence[Mode], across: Axis) -> Panel:
    """Half the 90 % interval of each frequency, in percent of it."""
    value = np.array([100 * NORMAL_90 * m.frequency_sd_hz / m.frequency_hz for m in modes])
    low, high = float(min(value)), float(max(value))
    room = max(1.3, math.sqrt(_LEAST_SPAN * low / high))
    axis = log_axis("90 % interval of\nthe frequency (± %)", low / room, high * room)
    return Panel(y=axis, marks=_marks(modes, value), x=across)


def _marks(modes: Sequence[Mode], value: FloatArray, half: FloatArray | None = None) -> list[Mark]:
    found: list[Mark] = []
    for plane in PLANES:
        own = [place for place, mode in enumerate(modes) if mode.plane == plane]
        if own:
            found.append(
                Points(
                    x=[modes[place].frequency_hz for place in own], y=value[own],
                    low=None if half is None else (value - half)[own],
                    high=None if half is None else (value + half)[own],
                    symbol=PLANE_SYMBOLS[plane], colour=PLANE_HUES[plane], name=plane,
                    texts=[f"{plane} {modes[place].order}" for place in own],
                    hover="%{text}: %{x:.4g} Hz, %{y:.3g} %",
                )
            )  # fmt: skip
    return found


def _caption(shown: Shown) -> str:
    known = any(math.isfinite(mode.damping_sd) for mode in shown.sheet.modes)
    bars = "bars are 90 % intervals" if known else "its uncertainty is not known"
    return (
        f"Damping of each mode, {bars}. A mode damped quite unlike its neighbours, or one whose "
        "frequency is far less sure than theirs, deserves a second look."
    )


def _alt(shown: Shown) -> str:
    percent = [100 * mode.damping_ratio for mode in shown.sheet.modes]
    return (
        f"Damping ratios of {len(percent)} modes between {min(percent):.2g} and "
        f"{max(percent):.2g} %, by frequency and plane."
    )


FIGURE = Member("damping", "Damping and uncertainty", _draw, _caption, _alt)
