"""Modes that stand for one of each plane because the two were not told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.contract import FoundMode
from shm.identify.planes import is_close, transverse_share
from shm.values import PLANES, Plane, ResponsePoint

LEAST_SHARE = 0.15
"""Of the energy that a mode must have in its weaker plane to stand for both."""


def with_both_planes(
    modes: Sequence[FoundMode], planes: Sequence[Plane], points: Sequence[ResponsePoint]
) -> tuple[list[FoundMode], list[Plane], tuple[str, ...]]:
    """`modes` and their `planes` with each unresolved pair once in either plane, and notes of them.

    Two modes nearer than their half-power bandwidth may ring down as one, in the direction of the
    hammer. Each of them then has this frequency to within half the bandwidth: damping ratio times
    frequency is added to the standard deviation. A mode with a near neighbour is no such pair.
    """
    if set(PLANES) - {point.plane for point in points}:
        return list(modes), list(planes), ()
    placed, notes = [], []
    for mode, plane in zip(modes, planes, strict=True):
        placed.append((mode, plane))
        if _stands_for_both(mode, modes, points):
            blurred = _blurred(mode)
            placed[-1:] = [(blurred, each) for each in PLANES]
            notes.append(_note(mode))
    return [mode for mode, _ in placed], [plane for _, plane in placed], tuple(notes)


def _stands_for_both(
    mode: FoundMode, modes: Sequence[FoundMode], points: Sequence[ResponsePoint]
) -> bool:
    share = transverse_share(mode.shape, points)
    alone = not any(
        is_close(mode.frequency_hz, other.frequency_hz) for other in modes if other is not mode
    )
    return alone and LEAST_SHARE <= share <= 1 - LEAST_SHARE


def _blurred(mode: FoundMode) -> FoundMode:
    half_bandwidth = mode.damping_ratio * mode.frequency_hz
    sd = float(np.hypot(np.nan_to_num(mode.frequency_sd_hz), half_bandwidth))
    return replace(mode, frequency_sd_hz=sd)


def _note(mode: FoundMode) -> str:
    return (
        f"the mode at {mode.frequency_hz:.2f} Hz moves in both planes: it stands for one of each, "
        "uncertain by half its bandwidth"
    )
