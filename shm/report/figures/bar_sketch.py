"""The bar of a hanger lying along the page: its fittings, the sensors, where it was hit."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shm.report import formatting
from shm.report.figures import specification as spec
from shm.values import PLANES, Plane, ResponsePoint
from shm.values.bar_description import BarDescription

# Layout: heights within the panel, in its own units from -1 to 1, and of the figure in inches.
_HEIGHTS = {"transverse": 0.45, "longitudinal": -0.45, None: 0.45}
_HIT_HEIGHT = 0.85
_INCHES = 1.25
_BAR, _FITTING = 4.0, 9.0


def specify(bar: BarDescription) -> spec.Specification | None:
    """Return the sketch; None without a length, or where no place is known."""
    points = [*_placed(bar.sensors), *_placed(bar.hits)]
    if not (math.isfinite(bar.length_m) and points):
        return None
    length_m = bar.length_m
    marks: list[spec.Mark] = [
        spec.Line(x=[0.0, length_m], y=[0.0, 0.0], width=_BAR, colour="quiet"),
        *_fittings(bar),
        *(mark for plane in (*PLANES, None) for mark in _sensors(bar.sensors, plane)),
        *_hits(bar.hits),
    ]
    room = 0.02 * length_m
    panel = spec.Panel(
        y=spec.Axis(range=(-1.0, 1.2), ticks=(), tick_labels=(), grid=False),
        marks=marks,
        x=spec.Axis(
            label="distance from the deck end (m)", range=(-room, length_m + room), grid=False
        ),
    )
    return spec.stacked([panel], _INCHES, 5)


def _placed(points: Sequence[ResponsePoint]) -> list[ResponsePoint]:
    return [each for each in points if math.isfinite(each.x_m)]


def _fittings(bar: BarDescription) -> list[spec.Mark]:
    deck_m, arch_m = bar.fittings_m or (0.0, 0.0)
    ends = [(0.0, deck_m), (bar.length_m - arch_m, bar.length_m)]
    found: list[spec.Mark] = [
        spec.Line(x=list(end), y=[0.0, 0.0], width=_FITTING, name="fitting")
        for end in ends
        if end[1] > end[0]
    ]
    if bar.turnbuckles:
        places = [each.x_m for each in bar.turnbuckles]
        found.append(
            spec.Points(x=places, y=[0.0] * len(places), symbol="square", size=8, name="turnbuckle")
        )
    return found


def _sensors(sensors: Sequence[ResponsePoint], plane: Plane | None) -> list[spec.Mark]:
    placed = [each for each in _placed(sensors) if each.plane == plane]
    if not placed:
        return []
    symbol = spec.PLANE_SYMBOLS[plane] if plane else "diamond"
    return [
        spec.Points(
            x=[each.x_m for each in placed],
            y=[_HEIGHTS[plane]] * len(placed),
            symbol=symbol,
            colour=spec.plane_colour(plane),
            size=6,
            name=f"sensor, {plane or 'plane not stated'}",
            texts=[formatting.place(each.name, each.plane, each.x_m) for each in placed],
        )
    ]


def _hits(hits: Sequence[ResponsePoint]) -> list[spec.Mark]:
    placed = _placed(hits)
    if not placed:
        return []
    return [
        spec.Points(
            x=[each.x_m for each in placed],
            y=[_HIT_HEIGHT] * len(placed),
            symbol="triangle down",
            colour="red",
            size=8,
            name="hit",
            texts=[formatting.place("hit", each.plane, each.x_m) for each in placed],
        )
    ]


def _caption(bar: BarDescription) -> str:
    hits = "" if _placed(bar.hits) else " The place of the hits is not stated."
    return f"The bar from the deck end (left) to the arch end, not to scale across.{hits}"


def _alt(bar: BarDescription) -> str:
    return (
        f"Bar of {bar.length_m:g} m with {formatting.counted(len(_placed(bar.sensors)), 'sensor')} "
        f"and {formatting.counted(len(_placed(bar.hits)), 'place')} of hits."
    )


FIGURE = spec.FigureSpec[BarDescription]("sketch", "Sensors and hits", specify, _caption, _alt)
