"""Draws the specification of a figure for paper."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.ticker import MaxNLocator, NullFormatter, NullLocator, ScalarFormatter

from shm.report.figures import specification as spec
from shm.report.figures import style

# Layout: points of dash and gap.
_DASHES: dict[spec.Dash, Any] = {
    "solid": "-",
    "dash": "--",
    "dot": ":",
    "dashdot": "-.",
    "longdash": (0, (7, 2)),
}
_SYMBOLS = {
    "circle": "o", "square": "s", "diamond": "D", "cross": "X", "thin cross": "x",
    "triangle": "^", "triangle down": "v", "tick": "|",
}  # fmt: skip


def draw(figure: spec.Specification) -> Figure:
    """Return the figure in the width of a page."""
    made = style.new_figure(figure.height_inches)
    places = list(_placed(made, figure))
    for axes, panel in places:
        _panel(axes, panel, figure)
    if figure.x_label:
        made.supxlabel(
            figure.x_label,
            fontsize=style.TINY + 1,
            color=style.INK,
            y=0.06 / figure.height_inches,
        )
    where = "upper left" if figure.is_grid else "outside upper left"
    shared = [axes for axes, panel in places if not panel.has_separate_legend]
    style.legend_of_figure(made, shared, figure.legend_columns, where)
    return made


def draw_on(figure: spec.Specification, axes: Sequence[Axes]) -> None:
    """Draw the panels in reading order on axes that somebody else made."""
    for each, panel in zip(axes, figure.panels, strict=True):
        _panel(each, panel, figure)
        if each.get_legend_handles_labels()[1]:
            style.legend_above(each)


def _placed(made: Figure, figure: spec.Specification) -> Iterable[tuple[Axes, spec.Panel]]:
    """Return the axes of each panel; those over one horizontal axis share it."""
    height, rows = figure.height_inches, figure.rows
    if figure.is_grid:
        # Twenty-four panels by constrained layout take seconds; these are all of one size.
        made.set_layout_engine("none")
        columns = max(len(row) for row in rows)
        labelled = any(panel.y.label for panel in figure.panels)
        grid = made.add_gridspec(
            len(rows), columns, left=0.11 if labelled else 0.065, right=0.99, bottom=0.5 / height,
            top=1 - (0.1 if labelled else 0.45) / height, hspace=0.14 if labelled else 0.5,
            wspace=0.14,
        )  # fmt: skip
    else:
        grid = made.add_gridspec(len(rows), 1, height_ratios=[row[0].height for row in rows])
    first: Axes | None = None  # of the row, or of the row above
    above: Axes | None = None
    for number, row in enumerate(rows):
        is_whole = len(row) == 1 or figure.is_grid
        cells = (
            [grid[number, column] for column in range(len(row))]
            if is_whole
            else _adjacent(grid, number, row)
        )
        for column, (cell, panel) in enumerate(zip(cells, row, strict=True)):
            axes = made.add_subplot(cell, sharex=above, sharey=first if panel.shares_y else None)
            first = axes if column == 0 and not panel.shares_y else first
            above = (above or axes) if panel.x is None else None
            if figure.is_grid:
                is_last = number == len(rows) - 1 or column >= len(rows[number + 1])
                axes.tick_params(labelleft=column == 0, labelbottom=is_last)
            elif panel.x is None:
                axes.tick_params(labelbottom=False)
            yield axes, panel


def _adjacent(grid: GridSpec, number: int, row: Any) -> list[Any]:
    widths = [panel.width for panel in row]
    parts = grid[number, 0].subgridspec(1, len(row), width_ratios=widths)
    return [parts[0, column] for column in range(len(row))]


def _panel(axes: Axes, panel: spec.Panel, figure: spec.Specification) -> None:
    style.dress(axes, panel.x.label if panel.x else "", panel.y.label)
    for mark in panel.marks:
        _DRAWN[type(mark)](axes, mark)
    if panel.title:
        colour = style.PALETTE[panel.title_colour]
        size = style.TINY + (0 if figure.is_grid else 0.5 if panel.title_side == "right" else 1.5)
        axes.set_title(panel.title, fontsize=size, color=colour, loc=panel.title_side, pad=2)
    if figure.is_grid:
        axes.tick_params(labelsize=style.TINY - 0.5, length=2, pad=1.5)
        for axis in (axes.xaxis, axes.yaxis):
            axis.label.set_fontsize(style.TINY)
    _scale(axes, "y", panel.y)
    if panel.x is not None:
        _scale(axes, "x", panel.x)
    if panel.has_separate_legend:
        style.legend_above(axes, columns=2)


def _scale(axes: Axes, letter: str, wanted: spec.Axis) -> None:
    axis = axes.xaxis if letter == "x" else axes.yaxis
    if wanted.scale == "log":
        (axes.set_xscale if letter == "x" else axes.set_yscale)("log")
        axis.set_minor_formatter(NullFormatter())
    if wanted.scale == "date":
        locator = AutoDateLocator(tz=UTC, minticks=3, maxticks=8)  # type: ignore[no-untyped-call]
        axis.set_major_locator(locator)
        concise = ConciseDateFormatter(locator, tz=UTC)  # type: ignore[no-untyped-call]
        axis.set_major_formatter(concise)
        axis.get_offset_text().set_color(style.INK)
    if isinstance(formatter := axis.get_major_formatter(), ScalarFormatter):
        formatter.set_useOffset(False)
    if wanted.range is not None:
        (axes.set_xlim if letter == "x" else axes.set_ylim)(*wanted.range)  # type: ignore[arg-type]
    if wanted.most_ticks is not None:
        axis.set_major_locator(MaxNLocator(wanted.most_ticks - 1))
    if wanted.ticks is not None:
        axis.set_ticks(list(wanted.ticks), wanted.tick_labels)
        axis.set_minor_locator(NullLocator())
    if not wanted.grid:
        axis.grid(False)
        if letter == "y":
            axes.tick_params("y", length=0)


def _look(axes: Axes, mark: spec.Mark) -> dict[str, Any]:
    shares = {"transform": axes.get_xaxis_transform()} if mark.in_shares else {}
    colour = style.PALETTE[mark.colour]
    return {"color": colour, "alpha": mark.opacity, "label": mark.name or None, **shares}


def _line(axes: Axes, mark: spec.Line) -> None:
    axes.plot(
        mark.x, mark.y, linewidth=mark.width, linestyle=_DASHES[mark.dash],
        marker="." if mark.dots else "", markersize=3.5, **_look(axes, mark),
    )  # fmt: skip


def _points(axes: Axes, mark: spec.Points) -> None:
    look = {
        **_look(axes, mark), "marker": _SYMBOLS[mark.symbol], "markersize": mark.size,
        "markerfacecolor": None if mark.filled else "none", "linestyle": "none",
        "clip_on": mark.clipped,
    }  # fmt: skip
    if mark.low is None or mark.high is None:
        axes.plot(mark.x, mark.y, **look)
    else:
        y = np.asarray(mark.y, float)
        reach = np.maximum([y - mark.low, np.asarray(mark.high) - y], 0.0)
        axes.errorbar(
            mark.x, y, yerr=reach, elinewidth=1.1, capsize=0.55 * mark.size * mark.caps,
            **look,
        )  # fmt: skip
    for x, y, label in zip(mark.x, mark.y, mark.labels, strict=False):
        if not label:
            continue
        top = mark.label_side == "top"
        axes.annotate(
            label, (_place(x), y), xycoords=look.get("transform", axes.transData),
            xytext={"top": (0, 4), "left": (-7, 0), "right": (3.2, 0)}[mark.label_side],
            textcoords="offset points", va="bottom" if top else "center",
            ha={"top": "center", "left": "right", "right": "left"}[mark.label_side],
            fontsize=style.TINY, color=look["color"],
        )  # fmt: skip


def _band(axes: Axes, mark: spec.Band) -> None:
    axes.fill_between(mark.x, mark.low, mark.high, linewidth=0, **_look(axes, mark))


def _bars(axes: Axes, mark: spec.Bars) -> None:
    look = {**_look(axes, mark), "linewidth": 0}
    if mark.lying:
        bars = axes.barh(mark.x, mark.y, height=mark.width, left=mark.base, **look)
    else:
        bars = axes.bar(mark.x, mark.y, width=mark.width, bottom=mark.base, **look)
    if len(mark.labels):
        axes.bar_label(bars, mark.labels, padding=5, fontsize=style.TINY + 0.5, color=style.INK)


def _heat(axes: Axes, mark: spec.Heat) -> None:
    code = style.PALETTE[mark.colour]
    shades = LinearSegmentedColormap.from_list(mark.colour, [(1, 1, 1, 0), to_rgba(code)])
    axes.pcolormesh(
        mark.x, mark.y, np.asarray(mark.z, float), cmap=shades, shading="nearest", rasterized=True
    )


def _rule(axes: Axes, mark: spec.Rule) -> None:
    draw_it = axes.axvline if mark.axis == "x" else axes.axhline
    look = {**_look(axes, mark), "linewidth": mark.width, "linestyle": _DASHES[mark.dash]}
    draw_it(mark.at, **look)  # type: ignore[arg-type]
    if mark.label:
        axes.annotate(
            mark.label, (0.01, _place(mark.at)), xycoords=axes.get_yaxis_transform(),
            xytext=(0, -2), textcoords="offset points", va="top", fontsize=style.TINY,
            color=look["color"],
        )  # fmt: skip


def _span(axes: Axes, mark: spec.Span) -> None:
    draw_it = axes.axvspan if mark.axis == "x" else axes.axhspan
    draw_it(mark.low, mark.high, linewidth=0, **_look(axes, mark))  # type: ignore[arg-type]
    if mark.label:
        is_left = mark.label_side == "left"
        axes.annotate(
            mark.label,
            (_place(mark.low if is_left else mark.high), 1),
            xycoords=axes.get_xaxis_transform(), ha=mark.label_side, va="top",
            xytext=(2 if is_left else -2, -1 - 10 * mark.label_line), textcoords="offset points",
            fontsize=style.TINY + 0.5, color=style.PALETTE[mark.colour],
        )  # fmt: skip


def _place(value: spec.Place) -> float:
    return float(date2num(value)) if isinstance(value, datetime) else value  # type: ignore[no-untyped-call]


_DRAWN: dict[type[spec.Mark], Any] = {
    spec.Line: _line,
    spec.Points: _points,
    spec.Band: _band,
    spec.Bars: _bars,
    spec.Heat: _heat,
    spec.Rule: _rule,
    spec.Span: _span,
}
