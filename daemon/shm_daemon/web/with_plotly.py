"""Draws the specification of a figure for the screen: a plotly document, in plain dictionaries.

`static/charts.js` turns the colours for a dark screen.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np

from shm.report.figures import specification as spec
from shm.report.figures.style import PALETTE
from shm.values import FloatArray
from shm_daemon.web.models import plain

_GAP, _GAP_NUMBERED, _GAP_COLUMNS, _GAP_GRID = 0.045, 0.13, 0.08, 0.03
"""Between two panels, as shares of the figure: over one horizontal axis, over one each, side by
side, of a grid."""
_SHARE_OF_ROW = 0.74
"""Height of a panel of a grid; its title takes the rest."""
# 96 px and 72 points an inch; marks look as large as matplotlib's (judgement, by eye).
_PX_A_POINT, _PX_A_POINT_OF_MARKS = 4 / 3, 1.65
_ABOVE_PX, _BELOW_PX = 76, 26
"""Room for a legend above a title that begins where it does; for the numbers below a grid."""
_DIGITS = 6  # technical: frequencies to their identification, 1e-5; half of the bytes of a double
_LONGEST_LINE = 60  # judgement: characters that are read with ease, and fit beside a cursor
_SYMBOLS = {
    "circle": "circle", "square": "square", "diamond": "diamond", "cross": "x",
    "thin cross": "x-thin", "triangle": "triangle-up", "triangle down": "triangle-down",
    "tick": "line-ns",
}  # fmt: skip


def document(figure: spec.Specification) -> dict[str, Any]:
    """Return the plotly document `{"data", "layout"}`: lists and texts, null for unknown."""
    return _Drawing(figure).document()


def with_words(figure: spec.Specification, caption: str, alt: str) -> dict[str, Any]:
    """Return its document with caption and text for blind readers."""
    return {**document(figure), "caption": caption, "alt": alt}


class _Drawing:
    """Gathers the traces and the layout of one figure, panel by panel."""

    def __init__(self, figure: spec.Specification) -> None:
        self.figure = figure
        self.traces: list[dict[str, Any]] = []
        self.layout: dict[str, Any] = {
            "annotations": [],
            "shapes": [],
            "hovermode": "closest",
            "barmode": "overlay",
        }
        self.named: set[str] = set()
        self.overlays = 0
        self.first = "y"
        """The vertical axis of the first panel of a row, or of the row above."""
        self.columns: dict[int, str] = {}
        """The horizontal axis that the panels of a grid's column share."""

    def document(self) -> dict[str, Any]:
        upright, number, across = _heights(self.figure), 0, 1
        for line, (row, domain) in enumerate(zip(self.figure.rows, upright, strict=True)):
            for column, (panel, width) in enumerate(zip(row, self._widths(row), strict=True)):
                number += 1
                x, y = ("x" if across == 1 else f"x{across}", "y" if number == 1 else f"y{number}")
                self._place(panel, (x, y), domain, column)
                if panel.x is not None:
                    self.layout[_key(x)] = {**_axis_of(panel.x), "anchor": y, "domain": width}
                    across += 1
                if self.figure.is_grid:
                    rows = self.figure.rows
                    is_last = line == len(rows) - 1 or column >= len(rows[line + 1])
                    self._quieten(x, y, column == 0, is_last)
                    if self.columns.setdefault(column, x) != x:
                        self.layout[_key(x)]["matches"] = self.columns[column]
                for mark in panel.marks:
                    self._draw(mark, panel, x, y)
        if self.figure.x_label:
            self.layout["annotations"].append({
                "text": self.figure.x_label, "xref": "paper", "yref": "paper", "x": 0.5, "y": 0,
                "yshift": -_BELOW_PX, "yanchor": "top", "showarrow": False,
            })  # fmt: skip
        if not self.named:
            self.layout["showlegend"] = False
        elif not self.figure.is_grid and _begins_left(self.figure.rows[0]):
            self.layout["legend"] = {"y": 1, "yref": "container", "yanchor": "top"}
            self.layout["margin"] = {"t": _ABOVE_PX}
        return {"data": self.traces, "layout": plain(self.layout)}

    def _widths(self, row: Sequence[spec.Panel]) -> list[list[float]]:
        if not self.figure.is_grid:
            return _shares([panel.width for panel in row], [_GAP_COLUMNS] * (len(row) - 1))
        columns = max(len(each) for each in self.figure.rows)
        return _shares([1.0] * columns, [_GAP_GRID] * (columns - 1))[: len(row)]

    def _place(
        self,
        panel: spec.Panel,
        axes: tuple[str, str],
        domain: list[float],
        column: int,
    ) -> None:
        """Return the vertical axis of a panel, its title and its words."""
        x, y = axes
        upright = {**_axis_of(panel.y), "domain": domain, "anchor": x}
        if panel.shares_y:
            upright["matches"] = self.first
        elif column == 0:
            self.first = y
        if len(self.figure.rows) > 1 and panel.y.ticks is None and panel.y.scale == "linear":
            upright["nticks"] = 5
        self.layout[_key(y)] = upright
        if panel.title:
            at_right = panel.title_side == "right"
            size = 11 if at_right or self.figure.is_grid else 13
            self.layout["annotations"].append({
                "text": escaped(panel.title), "xref": f"{x} domain", "yref": f"{y} domain",
                "x": 1 if at_right else 0, "y": 1, "xanchor": panel.title_side,
                "yanchor": "bottom", "showarrow": False,
                "font": {"size": size, "color": colour_of(panel.title_colour)},
            })  # fmt: skip

    def _quieten(self, x: str, y: str, is_first: bool, is_last: bool) -> None:
        for axis, has_numbers in ((x, is_last), (y, is_first)):
            found = self.layout[_key(axis)]
            found |= {"tickfont": {"size": 10}, "showticklabels": has_numbers}
            found["title"] |= {"font": {"size": 11}, "standoff": 6}
            found["fixedrange"] = "tickvals" in found  # which would not follow

    def _overlay(self, y: str) -> str:
        """Return an axis from 0 to 1 without numbers over the panel of the axis `y`."""
        key = f"yaxis{len(self.figure.panels) + self.overlays}"
        if self.layout.get(key, {}).get("overlaying") != y:
            self.overlays += 1
            key = f"yaxis{len(self.figure.panels) + self.overlays}"
            self.layout[key] = {
                "overlaying": y, "range": [0, 1], "visible": False, "fixedrange": True
            }  # fmt: skip
        return key.replace("yaxis", "y")

    def _draw(self, mark: spec.Mark, panel: spec.Panel, x: str, y: str) -> None:
        if isinstance(mark, spec.Rule) and mark.hover:
            shown = [x for each in panel.marks if hasattr(each, "x") for x in each.x]
            mark = spec.Line(
                x=[min(shown), max(shown)], y=[mark.at] * 2, width=mark.width, dash=mark.dash,
                colour=mark.colour, opacity=mark.opacity, name=mark.name, hover=mark.hover,
            )  # fmt: skip
        if isinstance(mark, spec.Rule | spec.Span):
            self._shape(mark, x, y)
            return
        axes = {"xaxis": x, "yaxis": self._overlay(y) if mark.in_shares else y}
        colour = colour_of(mark.colour)
        for trace in _TRACES[type(mark)](mark, colour):
            self.traces.append({**axes, **_hover(mark), **self._legend(mark, trace), **trace})

    def _legend(self, mark: spec.Mark, trace: dict[str, Any]) -> dict[str, Any]:
        if not mark.name:
            return {"showlegend": False}
        is_first = mark.name not in self.named and trace.get("showlegend", True)
        if is_first:
            self.named.add(mark.name)
        name = escaped(mark.name)
        return {"name": name, "legendgroup": name, "showlegend": is_first}

    def _shape(self, mark: spec.Rule | spec.Span, x: str, y: str) -> None:
        low, high = (mark.at, mark.at) if isinstance(mark, spec.Rule) else (mark.low, mark.high)
        along, other = (x, y) if mark.axis == "x" else (y, x)
        letter, opposite = mark.axis, "y" if mark.axis == "x" else "x"
        shape: dict[str, Any] = {
            f"{letter}ref": along, f"{opposite}ref": f"{other} domain", f"{letter}0": _one(low),
            f"{letter}1": _one(high), f"{opposite}0": 0, f"{opposite}1": 1, "layer": "below",
        }  # fmt: skip
        colour = colour_of(mark.colour)
        if isinstance(mark, spec.Rule):
            line = {"color": colour, "width": _PX_A_POINT * mark.width, "dash": mark.dash}
            shape |= {"type": "line", "line": line, "opacity": mark.opacity}
            place = {"textposition": "start", "yanchor": "top"}
        else:
            shape |= {"type": "rect", "fillcolor": colour_of(mark.colour, mark.opacity)}
            shape["line"] = {"width": 0}
            place = {"textposition": f"top {mark.label_side}"}
        if mark.label:
            lower = 0 if isinstance(mark, spec.Rule) else mark.label_line
            shape["label"] = {
                "text": "<br>" * lower + escaped(mark.label),
                "font": {"color": colour, "size": 11},
                **place,
            }
        if mark.name:
            shape |= {"name": mark.name, "legendgroup": mark.name}
            shape["showlegend"] = mark.name not in self.named
            self.named.add(mark.name)
        self.layout["shapes"].append(shape)


def _heights(figure: spec.Specification) -> list[list[float]]:
    """Return start and end of each row, from the uppermost to the lowest."""
    rows = figure.rows
    if figure.is_grid:
        each = 1 / len(rows)
        tops = [1 - each * (i + 1) for i in range(len(rows))]
        share = _SHARE_OF_ROW if any(panel.title for panel in figure.panels) else 1 - _GAP_GRID
        return [[top, top + share * each] for top in tops]
    gaps = [_GAP if row[0].x is None else _GAP_NUMBERED for row in rows[:-1]]
    gaps = [gap + _GAP * _begins_left(row) for gap, row in zip(gaps, rows[1:], strict=True)]
    found = _shares([row[0].height for row in rows], gaps)
    return [[max(0.0, 1 - high), 1 - low] for low, high in found]


def _begins_left(row: Sequence[spec.Panel]) -> bool:
    """Return True if a title is where the legend starts."""
    return any(panel.title and panel.title_side == "left" for panel in row)


def _shares(sizes: Sequence[float], gaps: Sequence[float]) -> list[list[float]]:
    unit = (1 - sum(gaps)) / sum(sizes)
    found, at = [], 0.0
    for size, gap in zip(sizes, [*gaps, 0.0], strict=True):
        found.append([at, min(1.0, at + unit * size)])
        at += unit * size + gap
    return found


def _key(axis: str) -> str:
    """Return the layout's name of an axis: `yaxis2` of `y2`."""
    return f"{axis[0]}axis{axis[1:]}"


def _axis_of(axis: spec.Axis) -> dict[str, Any]:
    found: dict[str, Any] = {"title": {"text": axis.label.replace("\n", "<br>")}}
    if axis.scale != "linear":
        found["type"] = axis.scale
    if axis.range is not None:
        log = axis.scale == "log"
        found["range"] = [math.log10(end) if log else _one(end) for end in axis.range]  # type: ignore[arg-type]
    if axis.most_ticks is not None:
        found |= {"nticks": axis.most_ticks, "tickangle": 0}
    if axis.ticks is not None:
        found["tickvals"] = list(axis.ticks)
        if axis.tick_labels is not None:
            found["ticktext"] = [each.replace("\n", "<br>") for each in axis.tick_labels]
    elif axis.scale == "log":
        found |= {"exponentformat": "power", "dtick": 1}
    if not axis.grid:
        found |= {"showgrid": False, "zeroline": False}
    return found


def _hover(mark: spec.Mark) -> dict[str, Any]:
    if not mark.hover and not len(mark.texts):
        return {"hoverinfo": "skip"}
    hover = {"hovertemplate": (mark.hover or "%{text}") + "<extra></extra>"}
    if len(mark.texts):
        hover["text"] = [wrapped(escaped(each)) for each in mark.texts]  # type: ignore[assignment]
    return hover


def _line(mark: spec.Line, colour: str) -> list[dict[str, Any]]:
    line = {"color": colour, "width": _PX_A_POINT * mark.width, "dash": mark.dash}
    return [
        {
            "type": "scatter", "mode": "lines+markers" if mark.dots else "lines",
            "x": numbers(mark.x), "y": numbers(mark.y), "line": line, "opacity": mark.opacity,
        }
    ]  # fmt: skip


def _points(mark: spec.Points, colour: str) -> list[dict[str, Any]]:
    symbol = _SYMBOLS[mark.symbol]
    is_open = not mark.filled or symbol in ("x-thin", "line-ns")
    trace: dict[str, Any] = {
        "type": "scatter", "mode": "markers", "x": numbers(mark.x), "y": numbers(mark.y),
        "marker": {
            "symbol": f"{symbol}-open" if is_open else symbol, "color": colour,
            "size": _PX_A_POINT_OF_MARKS * mark.size,
        },
        "opacity": mark.opacity,
    }  # fmt: skip
    if mark.low is not None and mark.high is not None:
        y = np.asarray(mark.y, float)
        trace["error_y"] = {
            "type": "data", "symmetric": False, "array": numbers(np.asarray(mark.high) - y),
            "arrayminus": numbers(y - np.asarray(mark.low)), "thickness": 1.5,
            "width": 2 if mark.caps else 0, "color": colour_of(mark.colour, 0.8),
        }  # fmt: skip
    if not len(mark.labels):
        return [trace]
    side = {"right": "middle right", "left": "middle left", "top": "top center"}
    trace |= {
        "mode": "markers+text", "text": list(mark.labels), "textposition": side[mark.label_side],
        "textfont": {"size": 10, "color": colour},
    }  # fmt: skip
    if len(mark.texts):
        trace["hovertext"] = [wrapped(escaped(each)) for each in mark.texts]
        trace["hovertemplate"] = "%{hovertext}<extra></extra>"
    return [trace]


def _band(mark: spec.Band, colour: str) -> list[dict[str, Any]]:
    edge = {"type": "scatter", "mode": "lines", "x": numbers(mark.x), "line": {"width": 0}}
    fill = {"fill": "tonexty", "fillcolor": colour_of(mark.colour, mark.opacity)}
    return [
        {**edge, "y": numbers(mark.low), "showlegend": False},
        {**edge, "y": numbers(mark.high), **fill},
    ]


def _bars(mark: spec.Bars, colour: str) -> list[dict[str, Any]]:
    x, y = numbers(mark.x), numbers(mark.y)
    return [
        {
            "type": "bar", "orientation": "h" if mark.lying else "v", "base": numbers(mark.base),
            "x": y if mark.lying else x, "y": x if mark.lying else y, "width": mark.width,
            "marker": {"color": colour_of(mark.colour, mark.opacity), "line": {"width": 0}},
            "textposition": "auto" if len(mark.labels) else "none", "textangle": 0,
            "cliponaxis": False, **({"text": list(mark.labels)} if len(mark.labels) else {}),
        }
    ]  # fmt: skip


def _heat(mark: spec.Heat, colour: str) -> list[dict[str, Any]]:
    z = [numbers(row) for row in np.asarray(mark.z, float)]
    shades = [[0, colour_of(mark.colour, 0.0)], [1, colour]]
    place = {"x": numbers(mark.x), "y": numbers(mark.y), "z": z}
    return [{"type": "heatmap", **place, "colorscale": shades, "showscale": False}]


_TRACES: dict[type[spec.Mark], Any] = {
    spec.Line: _line, spec.Points: _points, spec.Band: _band, spec.Bars: _bars, spec.Heat: _heat
}  # fmt: skip


def colour_of(name: str, opacity: float = 1.0) -> str:
    """Return a colour of the palette (`blue`, `orange`, ..., `ink`), as plotly takes it."""
    code = PALETTE[name]
    if opacity >= 1:
        return code
    red, green, blue = (int(code[at : at + 2], 16) for at in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def escaped(text: str) -> str:
    """Escape text that plotly would take for markup: names come from files."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def wrapped(text: str) -> str:
    """Break lines of a text, as plotly does not."""
    if len(text) <= _LONGEST_LINE and text.isprintable():  # as nearly all of some thousand are
        return text.strip()
    return "<br>".join(textwrap.wrap(text, _LONGEST_LINE))


def numbers(values: FloatArray | Iterable[Any]) -> Any:
    """Return six digits of each value, None where it is unknown; more is not visible.

    Times are in UTC, without the zone, which plotly would ignore; texts stay.
    """
    if isinstance(values, int | float):
        return values
    if not isinstance(values, np.ndarray):
        values = list(values)
        if len(values) and isinstance(values[0], datetime | str):
            return [_one(value) for value in values]
    known = np.asarray(values, float)
    return [
        float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None for value in known.tolist()
    ]


def _one(value: Any) -> Any:
    if isinstance(value, datetime):
        return f"{value.astimezone(UTC):%Y-%m-%d %H:%M:%S}"
    return value
