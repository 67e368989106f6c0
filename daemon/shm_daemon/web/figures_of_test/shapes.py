"""Mode shapes along the hanger, a small panel for each mode, plane by plane."""

from __future__ import annotations

import math
from typing import Any

from shm.report import TestSheet
from shm.report.content import NORMAL_90
from shm.report.figures.style import PLANE_COLOURS
from shm.report.sheet.figures.shapes import FIGURE as PRINTED
from shm.report.sheet.shapes import (
    ROOM,
    Guide,
    extent_m,
    guide,
    guide_name,
    panel_title,
    shown_modes,
)
from shm.values import PLANES, Mode
from shm_daemon.web import plotting
from shm_daemon.web.figures_of_test.contract import Shown, TestFigure
from shm_daemon.web.figures_of_test.marks import SYMBOLS
from shm_daemon.web.figures_of_test.panels import axis, drawn, named_axis, numbers

_MOST_COLUMNS = 4
_ROW_PX, _REST_PX = 118, 90
_GAP_X, _SHARE_OF_ROW = 0.04, 0.74
"""Between two panels, as a share of the width; height of a panel, as a share of its row's."""


def _draw(shown: Shown) -> dict[str, Any] | None:
    sheet = shown.sheet
    if not shown_modes(sheet):
        return None
    rows = _rows(sheet)
    low, high = extent_m(sheet)
    layout: dict[str, Any] = {"annotations": [], "margin": {"t": 30}}
    traces: list[dict[str, Any]] = []
    seen: set[str] = set()
    number = 0
    for line, row in enumerate(rows):
        for column, mode in enumerate(row):
            number += 1
            is_last = line + 1 == len(rows) or column >= len(rows[line + 1])
            _place(layout, number, (line / len(rows), 1 / len(rows)), (column, _columns(sheet)))
            _scale(layout, number, (low, high), column == 0, is_last)
            layout["annotations"].append(_title(mode, number))
            traces += _panel(sheet, mode, number, seen)
    return drawn(traces, layout)


def _rows(sheet: TestSheet) -> list[list[Mode]]:
    """The modes row by row: a plane begins a new row."""
    modes, columns = shown_modes(sheet), _columns(sheet)
    planes = [[mode for mode in modes if mode.plane == plane] for plane in PLANES]
    return [own[i : i + columns] for own in planes for i in range(0, len(own), columns)]


def _columns(sheet: TestSheet) -> int:
    """So many, up to four, that the rows of a plane are about equally full."""
    modes = shown_modes(sheet)
    longest = max((sum(mode.plane == plane for mode in modes) for plane in PLANES), default=0)
    return math.ceil(longest / math.ceil(longest / _MOST_COLUMNS)) if longest else 1


def _place(
    layout: dict[str, Any], number: int, row: tuple[float, float], column: tuple[int, int]
) -> None:
    """Where a panel is: its row as start from the top and height, its column as which of many."""
    width = (1 - _GAP_X * (column[1] - 1)) / column[1]
    left, bottom = column[0] * (width + _GAP_X), max(0.0, 1 - row[0] - row[1])
    layout[named_axis("x", number)] = {"domain": [left, min(1.0, left + width)]}
    layout[named_axis("y", number)] = {"domain": [bottom, bottom + _SHARE_OF_ROW * row[1]]}


def _scale(
    layout: dict[str, Any], number: int, extent_m: tuple[float, float], is_first: bool,
    is_last: bool,
) -> None:  # fmt: skip
    """Numbers stand at the left column, and below the last panel of a column."""
    low, high = extent_m
    margin = 0.03 * (high - low)
    layout[named_axis("x", number)] |= {
        "anchor": axis("y", number), "range": [low - margin, high + margin],
        "tickvals": [low, high], "ticktext": [f"{low:.3g}", f"{high:.3g} m"],
        "showticklabels": is_last, "tickfont": {"size": 10}, "fixedrange": True,
    }  # fmt: skip
    layout[named_axis("y", number)] |= {
        "anchor": axis("x", number), "range": [-ROOM, ROOM], "tickvals": [-1, 0, 1],
        "showticklabels": is_first, "tickfont": {"size": 10}, "zeroline": True,
        "fixedrange": True,
    }  # fmt: skip


def _title(mode: Mode, number: int) -> dict[str, Any]:
    return {
        "text": panel_title(mode), "showarrow": False,
        "xref": f"{axis('x', number)} domain", "yref": f"{axis('y', number)} domain",
        "x": 0, "y": 1, "xanchor": "left", "yanchor": "bottom", "font": {"size": 11},
    }  # fmt: skip


def _panel(sheet: TestSheet, mode: Mode, number: int, seen: set[str]) -> list[dict[str, Any]]:
    points = [p for p in mode.shape if math.isfinite(p.x_m)]
    x_m = [p.x_m for p in points]
    axes = {"xaxis": axis("x", number), "yaxis": axis("y", number), "type": "scatter"}
    colour = PLANE_COLOURS[mode.plane]
    halves = numbers(NORMAL_90 * p.sd for p in points)
    own = {
        **axes, "mode": "markers", "x": numbers(x_m), "y": numbers(p.value for p in points),
        "marker": {"symbol": SYMBOLS[mode.plane], "size": 7, "color": colour},
        "error_y": {"type": "data", "array": halves, "color": colour, "width": 2}, **_named(
            mode.plane, seen
        ),
    }  # fmt: skip
    other = {
        **axes, "mode": "markers", "x": numbers(x_m), "y": numbers(p.cross for p in points),
        "marker": {"symbol": "diamond-open", "size": 7, "color": plotting.colour("ink")},
    }  # fmt: skip
    traces = [*_guide(sheet, mode, axes, seen), own]
    if any(math.isfinite(p.cross) for p in points):
        traces.append({**other, **_named("other plane", seen)})
    return traces


def _named(name: str, seen: set[str]) -> dict[str, Any]:
    """In the legend once."""
    first = name not in seen
    seen.add(name)
    return {"name": name, "legendgroup": name, "showlegend": first}


def _guide(
    sheet: TestSheet, mode: Mode, axes: dict[str, Any], seen: set[str]
) -> list[dict[str, Any]]:
    found = guide(sheet, mode)
    return [_thin(found, axes, _named(guide_name(sheet), seen))] if found else []


def _thin(drawn_guide: Guide, axes: dict[str, Any], named: dict[str, Any]) -> dict[str, Any]:
    line = {"color": plotting.colour("quiet"), "width": 1}
    return {
        **axes, "mode": "lines", "x": numbers(drawn_guide.x_m),
        "y": numbers(drawn_guide.value), "line": line,
        "hoverinfo": "skip", **named,
    }  # fmt: skip


FIGURE = TestFigure(
    "shapes", PRINTED.title, "store", _draw, lambda shown: PRINTED.caption(shown.sheet),
    lambda shown: PRINTED.alt(shown.sheet),
    height_px=lambda sheet: _REST_PX + _ROW_PX * len(_rows(sheet)),
    is_wide=True,
)  # fmt: skip
