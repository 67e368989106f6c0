"""Where responses were measured and hits fell."""

from __future__ import annotations

import math
from typing import TypeAlias

from shm.values import Channel, Plane, ResponsePoint

Place: TypeAlias = tuple[Plane | None, float | None, str]
"""Plane, position in m where stated, else the name: equal for one point in several set-ups."""


def point_of(channel: Channel) -> ResponsePoint:
    """Where a channel's sensor sits, or its hammer hits."""
    return ResponsePoint(channel.name, channel.plane, channel.x_m)


def place_of(point: ResponsePoint) -> Place:
    """What makes the point the same in several set-ups."""
    if math.isnan(point.x_m):
        return point.plane, None, point.name
    return point.plane, point.x_m, ""
