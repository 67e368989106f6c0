"""Panels in one figure: where they stand, and what their axes are called."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

_GAP = 0.1
_LEGEND_PX = 76


def axis(letter: str, number: int) -> str:
    """What a trace calls the axis of panel `number`, which counts from 0: `y`, `y2`."""
    return letter if number == 0 else f"{letter}{number + 1}"


def layout_name(letter: str, number: int) -> str:
    """What the layout calls it: `yaxis`, `yaxis2`."""
    return f"{letter}axis" if number == 0 else f"{letter}axis{number + 1}"


def domains(count: int, gap: float = _GAP) -> list[list[float]]:
    """Shares of the figure (low, high) of so many panels of one size, from low to high."""
    size = (1 - gap * (count - 1)) / count
    return [[i * (size + gap), min(1.0, i * (size + gap) + size)] for i in range(count)]


def stacked(titles: Sequence[str], y_label: str, **axes: Any) -> dict[str, Any]:
    """The layout of panels one below the other over one horizontal axis, each with its title."""
    count = len(titles)
    spans = domains(count)[::-1]
    layout: dict[str, Any] = {
        layout_name("y", i): {"domain": spans[i], "title": {"text": y_label}, **axes}
        for i in range(count)
    }
    return {
        **layout,
        "annotations": headings(titles, [0.0] * count, [s[1] for s in spans]),
        "legend": {"y": 1, "yref": "container", "yanchor": "top"},
        "margin": {"t": _LEGEND_PX},
    }


def headings(titles: Sequence[str], x: Sequence[float], y: Sequence[float]) -> list[dict[str, Any]]:
    """A title above the left corner of each panel."""
    return [
        {
            "text": title, "x": left, "y": top, "xref": "paper", "yref": "paper",
            "xanchor": "left", "yanchor": "bottom", "showarrow": False, "font": {"size": 13},
        }
        for title, left, top in zip(titles, x, y, strict=True)
    ]  # fmt: skip
