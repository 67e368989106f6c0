"""Frequency response of the latest test: magnitude, coherence, identified modes."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shm.report.content import HangerReport
from shm.report.figures import style
from shm.report.figures.member import Member
from shm.values import PLANES, FloatArray, FrequencyResponse, Mode, ResponsePoint

_POINTS_SHOWN = 4
_HEADROOM = 1.12
_LONGEST_NAME = 14


def _draw(data: HangerReport) -> Figure | None:
    response = data.frequency_response
    if response is None or not response.points:
        return None
    shown = _shown(response, data.latest.modes)
    magnitude = np.abs(response.accelerance[:, shown])
    if response.coherence is None:
        figure = style.new_figure(3.6)
        _magnitude(figure.subplots(), response, shown, magnitude, data.latest.modes)
        return figure
    figure = style.new_figure(4.8)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    _magnitude(upper, response, shown, magnitude, data.latest.modes)
    _curves(lower, response, shown, response.coherence[:, shown])
    upper.set_xlabel("")
    style.dress(lower, "frequency (Hz)", "coherence")
    lower.set_ylim(0, 1.05)
    return figure


def _shown(response: FrequencyResponse, modes: tuple[Mode, ...]) -> slice:
    """The lines above 0 Hz and a little past the highest identified mode."""
    highest = max((mode.frequency_hz for mode in modes), default=np.inf)
    stop = int(np.searchsorted(response.frequency_hz, _HEADROOM * highest))
    return slice(1, max(stop, 3))


def _magnitude(
    axes: Axes,
    response: FrequencyResponse,
    shown: slice,
    magnitude: FloatArray,
    modes: tuple[Mode, ...],
) -> None:
    style.dress(axes, "frequency (Hz)", "accelerance (m/s²/N)")
    _curves(axes, response, shown, magnitude)
    axes.set_yscale("log")
    _marks(axes, modes)
    axes.set_xlim(response.frequency_hz[shown][0], response.frequency_hz[shown][-1])
    style.legend_above(axes, columns=3)


def _curves(axes: Axes, response: FrequencyResponse, shown: slice, values: FloatArray) -> None:
    for index, point in enumerate(response.points[:_POINTS_SHOWN]):
        axes.plot(
            response.frequency_hz[shown],
            values[index],
            color=style.PLANE_COLOURS[point.plane] if point.plane else style.PURPLE,
            linestyle="-" if index < 2 else "--",
            linewidth=0.9,
            label=_label(point),
        )


def _label(point: ResponsePoint) -> str:
    name = textwrap.shorten(point.name, _LONGEST_NAME, placeholder="…")
    return name if np.isnan(point.x_m) else f"{name} at {point.x_m:.2f} m"


def _marks(axes: Axes, modes: tuple[Mode, ...]) -> None:
    """A mark above the curves at each identified mode, a row for each plane."""
    for plane, height in zip(PLANES, (0.98, 0.93), strict=True):
        found = [mode.frequency_hz for mode in modes if mode.plane == plane]
        if not found:
            continue
        axes.plot(
            found,
            [height] * len(found),
            transform=axes.get_xaxis_transform(),
            linestyle="none",
            marker=style.PLANE_MARKERS[plane],
            markersize=4.5,
            color=style.PLANE_COLOURS[plane],
            label=f"{plane} mode",
        )
        for frequency_hz in found:
            axes.axvline(frequency_hz, color=style.PLANE_COLOURS[plane], linewidth=0.5, alpha=0.6)


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


FIGURE = Member("response", "Frequency response and identified modes", _draw, _caption, _alt)
