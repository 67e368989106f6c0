"""Force and accelerations over the whole test, every hit marked."""

from __future__ import annotations

from typing import Any

import numpy as np

from shm.identify import Hit
from shm.report import TestSheet, words
from shm.report.figures.style import PLANE_COLOURS
from shm.report.sheet.channels import shown_rows
from shm.report.sheet.figures.time_history import FIGURE as PRINTED
from shm.report.sheet.timeline import (
    borders_s,
    channel_of,
    hit_time_s,
    located_hits,
    offsets_s,
    thinned,
    unknown_times_s,
)
from shm.values import FloatArray
from shm_daemon.web import plotting
from shm_daemon.web.figures_of_test.contract import Shown, TestFigure
from shm_daemon.web.figures_of_test.panels import Panel, axis, drawn, escaped, numbers, stacked

_MOST_CHANNELS = 4
_MOST_NUMBERS = 40
_LEAD = 0.012
"""Room before the first record, as a share of all: a hit may begin with it."""
_MARKS_AT, _ROOM = 1.18, 1.4
"""Where the marks of the hits stand in the uppermost panel, and its end, over the largest value."""
_NEAR_FULL_SCALE = 0.5


def _draw(shown: Shown) -> dict[str, Any] | None:
    sheet = shown.sheet
    if not sheet.recordings or not sheet.recordings[0].accelerations:
        return None
    rows = _rows(sheet)
    curves = [thinned(sheet.recordings, row) for row in rows]
    panels = [_panel(sheet, row, values) for row, (_, values) in zip(rows, curves, strict=True)]
    end_s = offsets_s(sheet.recordings)[-1] + sheet.recordings[-1].duration_s
    several = len(sheet.recordings) > 1
    label = "time, the records one after the other (s)" if several else "time (s)"
    largest = _largest(curves[0][1])
    panels[0].y["range"] = [-largest if rows[0] is not None else -0.1 * largest, _ROOM * largest]
    layout = stacked(panels, label, range=[-_LEAD * end_s, end_s])
    traces = [
        _signal(sheet, row, curve, axis("y", number))
        for number, (row, curve) in enumerate(zip(rows, curves, strict=True), 1)
    ]
    for number, row in enumerate(rows, 1):
        traces += _unknown(unknown_times_s(sheet.recordings, row), axis("y", number))
    traces += _hits(sheet, _MARKS_AT * largest)
    layout["shapes"] = [*_hit_lines(sheet, len(rows)), *_limits(sheet, rows, curves)]
    return drawn(traces, layout)


def _rows(sheet: TestSheet) -> list[int | None]:
    """The force where there is one, and the accelerations that are drawn."""
    rows: list[int | None] = list(shown_rows(sheet, _MOST_CHANNELS))
    return rows if sheet.recordings[0].force is None else [None, *rows]


def _largest(values: FloatArray) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0)) or 1.0


def _panel(sheet: TestSheet, row: int | None, values: FloatArray) -> Panel:
    """Named after its channel, in red where the channel was left out."""
    channel = channel_of(sheet.recordings[0], row)
    assert channel is not None
    title = words.place(channel.name, channel.plane, _place_m(sheet, row))
    fault = sheet.channel_faults.get(channel.name)
    if fault:
        title += f", left out: {fault}"
    label = "force (N)" if row is None else "m/s²"
    height, colour = (1.3 if row is None else 1.0), plotting.colour("red") if fault else ""
    return Panel(label, height, {"nticks": 5}, title=title, colour=colour)


def _place_m(sheet: TestSheet, row: int | None) -> float:
    """Where a channel was in all records; NaN where it was moved."""
    channels = [channel_of(record, row) for record in sheet.recordings]
    places = {c.x_m for c in channels if c is not None and np.isfinite(c.x_m)}
    return places.pop() if len(places) == 1 else np.nan


def _signal(
    sheet: TestSheet, row: int | None, curve: tuple[FloatArray, FloatArray], y: str
) -> dict[str, Any]:
    channel = channel_of(sheet.recordings[0], row)
    assert channel is not None
    colour = plotting.colour("ink" if row is None else "purple")
    if channel.plane and row is not None:
        colour = PLANE_COLOURS[channel.plane]
    unit = "N" if row is None else "m/s²"
    return {
        "type": "scatter", "mode": "lines", "x": numbers(curve[0]), "y": numbers(curve[1]),
        "yaxis": y, "line": {"color": colour, "width": 0.9}, "showlegend": False,
        "name": escaped(channel.name), "connectgaps": False,
        "hovertemplate": f"%{{x:.3f}} s: %{{y:.4g}} {unit}<extra></extra>",
    }  # fmt: skip


def _unknown(times_s: FloatArray, y: str) -> list[dict[str, Any]]:
    if not len(times_s):
        return []
    return [
        {
            "type": "scatter", "mode": "markers", "x": numbers(times_s), "y": [0] * len(times_s),
            "yaxis": y, "name": "not a number", "legendgroup": "unknown", "showlegend": y == "y",
            "marker": {"symbol": "line-ns-open", "size": 8, "color": plotting.colour("red")},
        }
    ]  # fmt: skip


def _hits(sheet: TestSheet, height: float) -> list[dict[str, Any]]:
    """A row of marks for the hits that were used, and one for each reason to drop some."""
    groups: dict[str, list[tuple[int, Hit]]] = {}
    located = located_hits(sheet)
    for number, hit in located:
        groups.setdefault("" if hit.used else hit.reason, []).append((number, hit))
    numbered = len(located) <= _MOST_NUMBERS
    return [_hit_marks(sheet, reason, hits, height, numbered) for reason, hits in groups.items()]


def _hit_marks(
    sheet: TestSheet, reason: str, hits: list[tuple[int, Hit]], height: float, numbered: bool
) -> dict[str, Any]:
    symbol, colour = ("x", "red") if reason else ("triangle-down", "green")
    counted = words.counted(len(hits), "hit")
    return {
        "type": "scatter", "mode": "markers+text" if numbered else "markers",
        "name": escaped(f"{counted} dropped: {reason}" if reason else f"{counted} used"),
        "x": numbers([hit_time_s(sheet, hit) for _, hit in hits]), "y": [height] * len(hits),
        "text": [str(number) for number, _ in hits], "textposition": "top center",
        "textfont": {"size": 10, "color": plotting.colour(colour)},
        "marker": {"symbol": symbol, "size": 9, "color": plotting.colour(colour)},
        "hovertext": [escaped(_told(number, hit)) for number, hit in hits], "hoverinfo": "text",
    }  # fmt: skip


def _told(number: int, hit: Hit) -> str:
    what = "used" if hit.used else f"dropped: {hit.reason}"
    return f"hit {number}, {hit.start_s:.3f} s, {words.plain(hit.peak_force_n, 4)} N, {what}"


def _hit_lines(sheet: TestSheet, panels: int) -> list[dict[str, Any]]:
    """Every hit in every panel below the uppermost; and where a record ends."""
    lines = [
        _upright(hit_time_s(sheet, hit), "green" if hit.used else "red", number, not hit.used)
        for _, hit in located_hits(sheet)
        for number in range(2, panels + 1)
    ]
    borders = borders_s(sheet.recordings)
    numbers_ = range(1, panels + 1)
    return lines + [_upright(at, "quiet", number, True) for at in borders for number in numbers_]


def _upright(time_s: float, colour: str, panel: int, dashed: bool) -> dict[str, Any]:
    line = {"color": plotting.colour(colour), "width": 0.8, "dash": "dash" if dashed else "solid"}
    return {
        "type": "line", "xref": "x", "yref": f"{axis('y', panel)} domain", "x0": time_s,
        "x1": time_s, "y0": 0, "y1": 1, "line": line, "opacity": 0.7, "layer": "below",
    }  # fmt: skip


def _limits(
    sheet: TestSheet, rows: list[int | None], curves: list[tuple[FloatArray, FloatArray]]
) -> list[dict[str, Any]]:
    """Lines at the largest value that can be recorded, where the signal comes near."""
    found = []
    for number, (row, (_, values)) in enumerate(zip(rows, curves, strict=True), 1):
        channel = channel_of(sheet.recordings[0], row)
        assert channel is not None
        if _largest(values) > _NEAR_FULL_SCALE * channel.full_scale:
            found += [_level(level, number) for level in (-channel.full_scale, channel.full_scale)]
    return found


def _level(value: float, panel: int) -> dict[str, Any]:
    return {
        "type": "line", "xref": "paper", "yref": axis("y", panel), "x0": 0, "x1": 1, "y0": value,
        "y1": value, "line": {"color": plotting.colour("red"), "width": 1, "dash": "dash"},
    }  # fmt: skip


FIGURE = TestFigure(
    "time_history", PRINTED.title, "file", _draw, lambda shown: PRINTED.caption(shown.sheet),
    lambda shown: PRINTED.alt(shown.sheet), height_px=lambda sheet: 680,
)  # fmt: skip
