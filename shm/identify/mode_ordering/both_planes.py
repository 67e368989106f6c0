"""Modes that stand for one of each plane because the two were not told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import FoundMode
from shm.identify.mode_ordering.planes import is_close, transverse_share
from shm.values import PLANES, Plane, ResponsePoint

LEAST_SHARE = 0.15
"""Of the energy that a mode must have in its weaker plane to stand for both."""
BLUR = 0.1
"""Of the bandwidth: what is not resolved over several hits lies nearer than 0.15 of it (measured:
71 pairs in heavy noise, damping 0.1 to 1 %; the errors' root mean square was 0.035)."""


def with_both_planes(
    modes: Sequence[FoundMode],
    planes: Sequence[Plane],
    points: Sequence[ResponsePoint],
    turned_rad: float = 0.0,
) -> tuple[list[FoundMode], list[Plane]]:
    """`modes` and their `planes` with each mode that may be an unresolved pair in either plane.

    Two modes much nearer than their half-power bandwidth may ring down as one, in the direction of
    the hammer. A mode with a near neighbour is no such pair. `turned_rad`: see `transverse_share`.
    """
    both: list[tuple[FoundMode, Plane]] = []
    single = bool(set(PLANES) - {point.plane for point in points})
    for mode, plane in zip(modes, planes, strict=True):
        twice = not single and _stands_for_both(mode, modes, points, turned_rad)
        both += [(mode, each) for each in PLANES] if twice else [(mode, plane)]
    return [mode for mode, _ in both], [plane for _, plane in both]


def _stands_for_both(
    mode: FoundMode, modes: Sequence[FoundMode], points: Sequence[ResponsePoint], turned_rad: float
) -> bool:
    share = transverse_share(mode.shape, points, turned_rad)
    alone = not any(
        is_close(mode.frequency_hz, other.frequency_hz) for other in modes if other is not mode
    )
    return alone and LEAST_SHARE <= share <= 1 - LEAST_SHARE


def moves_in_one_plane(mode: FoundMode, points: Sequence[ResponsePoint], turned_rad: float) -> bool:
    """Whether it is seen to: on one axis the other plane's modes are heard, too."""
    if set(PLANES) - {point.plane for point in points}:
        return False
    share = transverse_share(mode.shape, points, turned_rad)
    return not LEAST_SHARE <= share <= 1 - LEAST_SHARE


def blurred(mode: FoundMode) -> FoundMode:
    """An unresolved pair's mode: either of the two has its frequency to a tenth of the bandwidth.

    That part of twice damping ratio times frequency is added to the standard deviation.
    """
    bandwidth = 2 * mode.damping_ratio * mode.frequency_hz
    sd = float(np.hypot(np.nan_to_num(mode.frequency_sd_hz), BLUR * bandwidth))
    return replace(mode, frequency_sd_hz=sd)


def pair_note(mode: FoundMode) -> str:
    """What a reader should know of an unresolved pair."""
    return (
        f"the mode at {mode.frequency_hz:.2f} Hz moves in both planes: it stands for one of each, "
        "uncertain by a tenth of its bandwidth"
    )
