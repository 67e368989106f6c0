"""The channels of a recording over time, one panel each."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle

import numpy as np

from shm.report import formatting
from shm.report.figures import specification as spec
from shm.values import Channel, FloatArray, Recording

_BINS = 1500  # technical: columns of pixels of a figure; no peak is lost
_PANEL_INCHES, _REST_INCHES = 1.1, 0.8
_COLOURS = ("ink", "blue", "orange", "green", "purple", "red")
_UNITS = {"force": "N", "acceleration": "m/s²"}


def specify(recording: Recording) -> spec.Specification | None:
    """Return a panel for each channel; None without any."""
    if not recording.channels:
        return None
    panels = [_panel(recording, channel) for channel in recording.channels]
    across = spec.Axis(label="time (s)", range=(0.0, recording.duration_s))
    panels[-1] = replace(panels[-1], x=across)
    return spec.stacked(panels, _PANEL_INCHES * len(panels) + _REST_INCHES)


def specify_together(recording: Recording) -> spec.Specification | None:
    """Return one panel with all channels, each over its largest value; None without any."""
    if not recording.channels:
        return None
    lines = [_line(recording, channel) for channel in recording.channels]
    scaled = [
        replace(line, y=line.y / _largest(line.y), colour=colour, name=channel.name, opacity=0.8)
        for channel, line, colour in zip(recording.channels, lines, cycle(_COLOURS), strict=False)
    ]
    panel = spec.Panel(
        x=spec.Axis(label="time (s)", range=(0.0, recording.duration_s)),
        y=spec.Axis(label="fraction of the channel's largest value", range=(-1.05, 1.05)),
        marks=scaled,
    )
    return spec.stacked([panel], 3.0)


def _largest(values: FloatArray) -> float:
    found = float(np.nanmax(np.abs(values), initial=0.0))
    return found if found > 0 else 1.0


def _panel(recording: Recording, channel: Channel) -> spec.Panel:
    return spec.Panel(
        y=spec.Axis(label=f"{channel.quantity}\n({_UNITS[channel.quantity]})", most_ticks=3),
        marks=[_line(recording, channel)],
        title=formatting.place(channel.name, channel.plane, channel.x_m),
        title_side="left",
    )


def _line(recording: Recording, channel: Channel) -> spec.Line:
    places = spec.envelope_places(np.asarray(channel.values, np.float64), _BINS)
    return spec.Line(
        x=places / recording.sampling_rate_hz,
        y=np.asarray(channel.values, np.float64)[places],
        width=0.6,
        colour="ink" if channel.quantity == "force" else spec.plane_colour(channel.plane),
    )


def _caption(recording: Recording) -> str:
    return f"Each channel over {recording.duration_s:.4g} s, as recorded; every peak is drawn."


def _alt(recording: Recording) -> str:
    names = formatting.listed([channel.name for channel in recording.channels])
    return f"Time histories of {names} over {recording.duration_s:.4g} s."


FIGURE = spec.FigureSpec[Recording]("recording", "Channels over time", specify, _caption, _alt)
TOGETHER = spec.FigureSpec[Recording](
    "recording", "Channels over time", specify_together, _caption, _alt
)
