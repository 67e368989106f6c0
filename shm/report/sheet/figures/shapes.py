"""Mode shapes along the hanger, a small panel for each mode, plane by plane."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report import words
from shm.report.content import NORMAL_90
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.report.sheet.content import TestSheet
from shm.report.sheet.shapes import (
    ROOM,
    extent_m,
    guide,
    guide_name,
    modes_with_shape,
    panel_title,
    shown_modes,
)
from shm.values import PLANES, Mode

_MOST_COLUMNS = 7
_LEAST_COLUMNS = 4
_PANEL_INCHES = 1.12


def _draw(sheet: TestSheet) -> Figure | None:
    modes = shown_modes(sheet)
    if not modes:
        return None
    groups = [[m for m in modes if m.plane == plane] for plane in PLANES]
    columns = _columns(max(len(group) for group in groups))
    rows = [group[i : i + columns] for group in groups for i in range(0, len(group), columns)]
    height = _PANEL_INCHES * len(rows) + 0.85
    figure = style.new_figure(height)
    # Twenty-four panels by constrained layout take seconds; these are all of one size.
    figure.set_layout_engine("none")
    grid = figure.add_gridspec(
        len(rows), columns, left=0.065, right=0.99, bottom=0.5 / height, top=1 - 0.45 / height,
        hspace=0.5, wspace=0.14,
    )  # fmt: skip
    for number, row in enumerate(rows):
        last = number == len(rows) - 1
        for column, mode in enumerate(row):
            axes = figure.add_subplot(grid[number, column])
            _panel(axes, sheet, mode)
            axes.tick_params(labelleft=column == 0, labelbottom=last or column >= len(rows[-1]))
    label = "position from the deck end (m)" if sheet.hanger else "position (m)"
    figure.supxlabel(label, fontsize=style.TINY + 1, color=style.INK, y=0.06 / height)
    _legend(figure)
    return figure


def _columns(longest: int) -> int:
    """So many that the rows of a plane are about equally full."""
    return max(_LEAST_COLUMNS, math.ceil(longest / math.ceil(longest / _MOST_COLUMNS)))


def _panel(axes: Axes, sheet: TestSheet, mode: Mode) -> None:
    style.dress(axes, "", "")
    colour = style.PLANE_COLOURS[mode.plane]
    x_m, value, cross, sd = np.array([(p.x_m, p.value, p.cross, p.sd) for p in mode.shape]).T
    low, high = extent_m(sheet)
    _draw_guide(axes, sheet, mode)
    axes.errorbar(
        x_m, value, yerr=NORMAL_90 * np.nan_to_num(sd), fmt=style.PLANE_MARKERS[mode.plane],
        color=colour, markersize=3.6, elinewidth=1.0, capsize=1.8, label=mode.plane,
    )  # fmt: skip
    axes.plot(
        x_m, cross, linestyle="none", marker="D", markersize=3.2, markerfacecolor="none",
        markeredgewidth=0.8, color=style.INK, label="other plane",
    )  # fmt: skip
    axes.axhline(0, color=style.INK, linewidth=0.5)
    margin = 0.03 * (high - low)
    axes.set_xlim(low - margin, high + margin)
    axes.set_ylim(-ROOM, ROOM)
    axes.set_xticks((low, (low + high) / 2, high))
    axes.xaxis.set_major_formatter(lambda position, _: f"{position:.3g}")
    axes.set_yticks((-1, 0, 1))
    axes.tick_params(labelsize=style.TINY - 0.5, length=2, pad=1.5)
    axes.set_title(panel_title(mode), fontsize=style.TINY, color=colour, pad=2)


def _draw_guide(axes: Axes, sheet: TestSheet, mode: Mode) -> None:
    if found := guide(sheet, mode):
        axes.plot(found.x_m, found.value, color=style.QUIET, linewidth=0.8, label=guide_name(sheet))


def _legend(figure: Figure) -> None:
    named = {}
    for axes in figure.axes:
        named.update({name: h for h, name in zip(*axes.get_legend_handles_labels(), strict=True)})
    figure.legend(
        list(named.values()), list(named), loc="upper left", ncols=4, fontsize=style.TINY + 0.5,
        frameon=False, labelcolor=style.INK, borderaxespad=0.1,
    )  # fmt: skip


def _caption(sheet: TestSheet) -> str:
    line = (
        "The thin line is no measurement: it is the shape of a taut string of that order, brought "
        "to the size of the measured points, and left out where it does not come near them."
        if sheet.hanger is not None
        else "Thin lines only join the measured places."
    )
    some = words.some(len(shown_modes(sheet)), len(modes_with_shape(sheet)), "shapes")
    return (
        "Each panel is a mode: its order and frequency, its component in its own plane with the "
        "90 % interval where it is known, and that in the other plane as diamonds. The deck end "
        f"is on the left. {line}{some}"
    )


def _alt(sheet: TestSheet) -> str:
    shown = shown_modes(sheet)
    places = len({point.x_m for mode in shown for point in mode.shape})
    listed = ", ".join(f"{mode.plane} {mode.order}" for mode in shown)
    return f"Shapes of {len(shown)} modes at {words.counted(places, 'place')}: {listed}."


FIGURE = Member("shapes", "Mode shapes", _draw, _caption, _alt)
