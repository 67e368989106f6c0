"""Damping and uncertainty of the modes over frequency."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from shm.report import words
from shm.report.content import NORMAL_90
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.sheet.content import TestSheet
from shm.report.sheet.spectra import shown_range
from shm.values import PLANES, Mode, Plane

_LEAST_SPAN = 30.0
"""Of the axis of intervals: equal ones shall look equal."""


def _draw(sheet: TestSheet) -> Figure | None:
    if not sheet.modes:
        return None
    sure = any(math.isfinite(mode.frequency_sd_hz) for mode in sheet.modes)
    figure = style.new_figure(4.6 if sure else 2.9)
    panels = style.stacked(figure, [1.0] * (1 + sure))
    low, high = shown_range(sheet)
    panels[0].set_xlim(low, high)
    _damping(panels[0], sheet)
    if sure:
        _uncertainty(panels[1], sheet)
    style.dress(panels[-1], "frequency (Hz)", panels[-1].get_ylabel())
    style.legend_of_figure(figure, panels[:1])
    return figure


def _of(sheet: TestSheet, plane: Plane) -> list[Mode]:
    return [mode for mode in sheet.modes if mode.plane == plane]


def _damping(axes: Axes, sheet: TestSheet) -> None:
    style.dress(axes, "", "damping ratio (%)")
    for plane in PLANES:
        modes = _of(sheet, plane)
        if not modes:
            continue
        halves = [NORMAL_90 * mode.damping_sd for mode in modes]
        axes.errorbar(
            [mode.frequency_hz for mode in modes],
            [100 * mode.damping_ratio for mode in modes],
            yerr=[100 * half if math.isfinite(half) else 0.0 for half in halves],
            fmt=style.PLANE_MARKERS[plane],
            color=style.PLANE_COLOURS[plane],
            markersize=4.5,
            elinewidth=1.1,
            capsize=2.5,
            label=plane,
        )
    axes.set_ylim(0, 1.06 * axes.get_ylim()[1])


def _uncertainty(axes: Axes, sheet: TestSheet) -> None:
    style.dress(axes, "", "90 % interval of\nthe frequency (± %)")
    axes.set_yscale("log")
    for plane in PLANES:
        modes = [m for m in _of(sheet, plane) if m.frequency_sd_hz > 0]
        axes.plot(
            [mode.frequency_hz for mode in modes],
            [100 * NORMAL_90 * mode.frequency_sd_hz / mode.frequency_hz for mode in modes],
            linestyle="none",
            marker=style.PLANE_MARKERS[plane],
            markersize=4.5,
            color=style.PLANE_COLOURS[plane],
        )
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, high / _LEAST_SPAN), max(high, low * _LEAST_SPAN))
    axes.yaxis.set_major_formatter(lambda value, _: words.plain(value))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _caption(sheet: TestSheet) -> str:
    known = any(math.isfinite(mode.damping_sd) for mode in sheet.modes)
    bars = "bars are 90 % intervals" if known else "its uncertainty is not known"
    return (
        f"Damping of each mode, {bars}. A mode damped quite unlike its neighbours, or one whose "
        "frequency is far less sure than theirs, deserves a second look."
    )


def _alt(sheet: TestSheet) -> str:
    percent = [100 * mode.damping_ratio for mode in sheet.modes]
    return (
        f"Damping ratios of {len(percent)} modes between {min(percent):.2g} and "
        f"{max(percent):.2g} %, by frequency and plane."
    )


FIGURE = Member("damping", "Damping and uncertainty", _draw, _caption, _alt)
