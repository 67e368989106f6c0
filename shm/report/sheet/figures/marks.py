"""How modes, and what is not one, are marked over frequency in every figure."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes

from shm.report.figures import style
from shm.report.sheet.content import TestSheet
from shm.values import PLANES, Mode

_ROWS = {"transverse": 0.93, "longitudinal": 0.82}
_SET_ASIDE_ROW = 0.71
_ROOM = 0.026
"""Least distance of two numbers, as a share of the axis."""
HEADROOM = 0.36
"""Share of the axes' height that the marks take."""


def mark_modes(axes: Axes, sheet: TestSheet) -> None:
    """A marker and a line at each mode, a row for each plane, orders where there is room."""
    low, high = axes.get_xlim()
    for plane in PLANES:
        modes = [m for m in sheet.modes if m.plane == plane and low <= m.frequency_hz <= high]
        if not modes:
            continue
        colour = style.PLANE_COLOURS[plane]
        _markers(
            axes,
            [mode.frequency_hz for mode in modes],
            _ROWS[plane],
            marker=style.PLANE_MARKERS[plane],
            colour=colour,
            label=f"{plane} mode",
        )
        for mode in _last_of_each_crowd(modes, _ROOM * (high - low)):
            _number(axes, mode, _ROWS[plane], colour)
    _mark_set_aside(axes, sheet)


def _mark_set_aside(axes: Axes, sheet: TestSheet) -> None:
    low, high = axes.get_xlim()
    found = [
        f.frequency_hz for f in sheet.identification.set_aside if low <= f.frequency_hz <= high
    ]
    if found:
        label = "set aside: not a mode of the hanger"
        _markers(axes, found, _SET_ASIDE_ROW, marker="X", colour=style.RED, label=label)


def _markers(
    axes: Axes, found: Sequence[float], height: float, *, marker: str, colour: str, label: str
) -> None:
    axes.plot(
        found,
        [height] * len(found),
        transform=axes.get_xaxis_transform(),
        linestyle="none",
        marker=marker,
        markersize=4.0,
        color=colour,
        label=label,
    )
    axes.vlines(
        found,
        0,
        height,
        transform=axes.get_xaxis_transform(),
        color=colour,
        linewidth=0.5,
        alpha=0.45,
        linestyle=":" if marker == "X" else "-",
    )


def _last_of_each_crowd(modes: Sequence[Mode], distance_hz: float) -> list[Mode]:
    """The modes whose number, to the right of the marker, does not run into the next marker."""
    rising = sorted(modes, key=lambda mode: mode.frequency_hz)
    following = [*(mode.frequency_hz for mode in rising[1:]), math.inf]
    pairs = zip(rising, following, strict=True)
    return [mode for mode, after in pairs if after - mode.frequency_hz >= distance_hz]


def _number(axes: Axes, mode: Mode, height: float, colour: str) -> None:
    axes.annotate(
        str(mode.order),
        (mode.frequency_hz, height),
        xycoords=axes.get_xaxis_transform(),
        xytext=(3.2, 0),
        textcoords="offset points",
        va="center",
        fontsize=style.TINY,
        color=colour,
    )
