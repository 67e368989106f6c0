"""What a reader should know of how planes and orders were decided."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shm.identify.mode_ordering.order import Numbering
from shm.values import Hanger, ResponsePoint

_NOTED_DEGREES = 5.0  # judgement: a sensor clamped on by eye; it sees 0.8 % of the other plane


def plane_notes(points: Sequence[ResponsePoint], turned_rad: float) -> list[str]:
    """Where planes are not stated, or not the sensors' axes."""
    if not any(point.plane for point in points):
        return ["no channel states its plane: all modes are taken as transverse"]
    degrees = abs(math.degrees(turned_rad))
    if degrees >= _NOTED_DEGREES:
        return [
            f"the hanger's planes are turned by {degrees:.0f} degrees from the sensors' axes: each "
            "mode has the name of the nearer plane"
        ]
    return []


def support_notes(hanger: Hanger | None) -> list[str]:
    """Where a description does not help."""
    if hanger is None or hanger.as_hanger:
        return []
    return [
        "the hanger is not clamped at both ends and in tension: its description does not help to "
        "number the modes"
    ]


def basis_notes(
    numbering: Numbering, hanger: Hanger | None, points: Sequence[ResponsePoint]
) -> list[str]:
    """Where something else than description and shapes numbers the modes."""
    if numbering.basis == "counting":
        return ["the modes fit no tensioned beam: they are counted, so orders may be off"]
    if hanger and numbering.basis == "pattern":
        return [
            "the modes do not fit the hanger's description: they are numbered by the pattern of "
            "their frequencies alone"
        ]
    if hanger and not any(np.isfinite(point.x_m) for point in points):
        return ["no sensor states its position: shapes do not help to number the modes"]
    return []
