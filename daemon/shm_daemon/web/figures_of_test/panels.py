"""Panels one below the other in one plotly figure, and the values that go into it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shm.values import FloatArray
from shm_daemon.web import plotting

_GAP = 0.045
_APART = 0.13
"""Between two panels: of one horizontal axis, and of an axis each; shares of the height."""
_DIGITS = 6


@dataclass(frozen=True)
class Panel:
    """One panel: its vertical axis, and its horizontal one where it has one of its own.

    `height` is relative to the other panels'; `title` stands above the panel on the right, in
    `colour`.
    """

    y_label: str
    height: float = 1.0
    y: dict[str, Any] = field(default_factory=dict)
    x_label: str | None = None
    x: dict[str, Any] = field(default_factory=dict)
    title: str = ""
    colour: str = ""


def axis(letter: str, number: int) -> str:
    """`y`, `y2`: how a trace names the axis of a panel, which counts from 1."""
    return letter if number == 1 else f"{letter}{number}"


def named_axis(letter: str, number: int) -> str:
    """`yaxis`, `yaxis2`: how the layout names that axis."""
    return f"{letter}axis" if number == 1 else f"{letter}axis{number}"


def stacked(panels: Sequence[Panel], x_label: str, **x: Any) -> dict[str, Any]:
    """The layout of panels over one horizontal axis `x`."""
    layout: dict[str, Any] = {"annotations": [], **_uprights(panels, _GAP)}
    last = axis("y", len(panels))
    layout["xaxis"] = {"title": {"text": x_label}, "anchor": last, **x}
    return layout


def apart(panels: Sequence[Panel]) -> dict[str, Any]:
    """The layout of panels that each have a horizontal axis of their own."""
    layout: dict[str, Any] = {"annotations": [], **_uprights(panels, _APART)}
    for number, panel in enumerate(panels, 1):
        across = {"title": {"text": panel.x_label}, "anchor": axis("y", number), **panel.x}
        layout[named_axis("x", number)] = across
        layout[named_axis("y", number)]["anchor"] = axis("x", number)
    return layout


def _uprights(panels: Sequence[Panel], gap: float) -> dict[str, Any]:
    room = 1 - gap * (len(panels) - 1)
    unit = room / sum(panel.height for panel in panels)
    layout: dict[str, Any] = {}
    titles: list[dict[str, Any]] = []
    top = 1.0
    for number, panel in enumerate(panels, 1):
        bottom = max(0.0, top - unit * panel.height)
        upright = {"title": {"text": panel.y_label}, "domain": [bottom, top], **panel.y}
        layout[named_axis("y", number)] = upright
        if panel.title:
            titles.append(_title(panel, top))
        top = bottom - gap
    return {**layout, "annotations": titles}


def _title(panel: Panel, top: float) -> dict[str, Any]:
    font: dict[str, Any] = {"size": 11}
    if panel.colour:
        font["color"] = panel.colour
    return {
        "text": escaped(panel.title), "xref": "paper", "yref": "paper", "x": 1, "y": top,
        "xanchor": "right", "yanchor": "bottom", "showarrow": False, "font": font,
    }  # fmt: skip


def drawn(traces: Sequence[dict[str, Any]], layout: dict[str, Any]) -> dict[str, Any]:
    """The document of a figure whose layout labels its axes itself."""
    return plotting.figure(traces, "", "", **layout)


def log_axis(low: float, high: float) -> dict[str, Any]:
    """A logarithmic axis of few decades, numbered in full at 1, 2 and 5 of each."""
    decades = range(math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1)
    ticks = [step * 10.0**decade for decade in decades for step in (1, 2, 5)]
    return {
        "type": "log", "range": [math.log10(low), math.log10(high)], "tickvals": numbers(ticks),
        "ticktext": [f"{tick:g}" for tick in ticks],
    }  # fmt: skip


def escaped(text: str) -> str:
    """Text that plotly shall not take for its own markup: names come from files."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def numbers(values: FloatArray | Iterable[float]) -> list[float | None]:
    """Six digits of each value, None where it is unknown: nobody sees more in a figure."""
    known = np.asarray(list(values) if not isinstance(values, np.ndarray) else values, float)
    return [
        float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in known.tolist()
    ]
