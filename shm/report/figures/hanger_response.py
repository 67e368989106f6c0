"""Frequency response of the latest test: magnitude, coherence, identified modes."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from shm.report.contents import HangerReport
from shm.report.figures.illustration import Member
from shm.report.figures.specification import (
    PLANE_HUES,
    PLANE_SYMBOLS,
    Axis,
    Line,
    Mark,
    Panel,
    Points,
    Rule,
    Specification,
    plane_colour,
    stacked,
)
from shm.values import PLANES, FloatArray, FrequencyResponse, Mode, ResponsePoint

# Layout: curves that can be told apart, room above them for names in rows, and a name that fits.
_POINTS_SHOWN = 4
_HEADROOM = 1.12
_ROWS = {"transverse": 0.98, "longitudinal": 0.93}
_LONGEST_NAME = 14


def specify(data: HangerReport) -> Specification | None:
    response = data.frequency_response
    if response is None or not response.points:
        return None
    shown = _shown(response, data.latest.modes)
    frequency_hz = response.frequency_hz[shown]
    across = Axis(
        label="frequency (Hz)", range=(float(frequency_hz[0]), float(frequency_hz[-1]))
    )  # fmt: skip
    curves = _curves(response, shown, np.abs(response.accelerance))
    magnitude = Axis(label="accelerance (m/s²/N)", scale="log")
    marks = [*curves, *_marks(data.latest.modes)]
    if response.coherence is None:
        return stacked([Panel(y=magnitude, marks=marks, x=across)], 3.6, legend_columns=3)
    below = Panel(
        y=Axis(label="coherence", range=(0, 1.05)), x=across,
        marks=_curves(response, shown, response.coherence),
    )  # fmt: skip
    return stacked([Panel(y=magnitude, marks=marks, height=3), below], 4.8, legend_columns=3)


def _shown(response: FrequencyResponse, modes: Sequence[Mode]) -> slice:
    """The lines above 0 Hz and a little past the highest identified mode."""
    highest = max((mode.frequency_hz for mode in modes), default=np.inf)
    stop = int(np.searchsorted(response.frequency_hz, _HEADROOM * highest))
    return slice(1, max(stop, 3))


def _curves(response: FrequencyResponse, shown: slice, values: FloatArray) -> list[Mark]:
    return [
        Line(
            x=response.frequency_hz[shown], y=values[index, shown], width=0.9, name=_label(point),
            colour=plane_colour(point.plane), dash="solid" if index < 2 else "dash",
        )
        for index, point in enumerate(response.points[:_POINTS_SHOWN])
    ]  # fmt: skip


def _label(point: ResponsePoint) -> str:
    name = textwrap.shorten(point.name, _LONGEST_NAME, placeholder="…")
    return name if np.isnan(point.x_m) else f"{name} at {point.x_m:.2f} m"


def _marks(modes: Sequence[Mode]) -> list[Mark]:
    """A mark above the curves at each identified mode, a row for each plane."""
    found: list[Mark] = []
    for plane in PLANES:
        at = [mode.frequency_hz for mode in modes if mode.plane == plane]
        look: dict[str, Any] = {"colour": PLANE_HUES[plane]}
        found += [Rule(at=each, axis="x", width=0.5, opacity=0.6, **look) for each in at]
        if at:
            rows = [_ROWS[plane]] * len(at)
            symbol, name = PLANE_SYMBOLS[plane], f"{plane} mode"
            found.append(Points(x=at, y=rows, in_shares=True, symbol=symbol, name=name, **look))
    return found


def _caption(data: HangerReport) -> str:
    response = data.frequency_response
    points = len(response.points) if response else 0
    some = f" The first {_POINTS_SHOWN} of {points} are drawn." if points > _POINTS_SHOWN else ""
    coherence = (
        "below, coherence (1 where force explains the response)"
        if response and response.coherence is not None
        else "the coherence is not known"
    )
    return (
        "Acceleration per force (accelerance) of the latest test, averaged over the hits; "
        f"{coherence}. Marks and lines: identified modes by plane.{some}"
    )


def _alt(data: HangerReport) -> str:
    modes = sorted(data.latest.modes, key=lambda mode: mode.frequency_hz)
    listed = ", ".join(f"{mode.frequency_hz:.2f} Hz ({mode.plane})" for mode in modes)
    return f"Frequency response with {len(modes)} identified modes: {listed}."


FIGURE = Member("response", "Frequency response and identified modes", specify, _caption, _alt)
