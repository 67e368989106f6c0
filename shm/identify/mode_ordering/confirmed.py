"""Modes that one hit or one model order leaves in doubt, where the bar of the sure ones has a mode.

A weak mode, or one beside another, changes by more from hit to hit than is asked of a mode that
nothing else speaks for. Where the sure modes are a bar's to a thousandth, they say where the missing
orders are: what moves there, in that plane, is one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from shm.identify.contract import FoundMode, Tone
from shm.identify.mode_ordering.bar_fit import LEAST_MODES, fitted_bar
from shm.identify.mode_ordering.order import Expected
from shm.identify.mode_ordering.placement import Placement, placed
from shm.identify.mode_ordering.planes import planes_of, principal_angle
from shm.values import PLANES, Hanger, Mode, Plane, ResponsePoint

_NEAR = 0.003
"""Of the bar's frequency."""


def placed_with_doubtful(
    found: Sequence[FoundMode],
    doubtful: Sequence[FoundMode],
    points: Sequence[ResponsePoint],
    hanger: Hanger | None,
    tones: Sequence[Tone] = (),
) -> Placement:
    """As `placed`, with those of `doubtful` that fill a gap and leave all other orders."""
    first = placed(found, points, hanger, tones)
    if not doubtful or hanger is None or not hanger.as_hanger:
        return first
    turned_rad = principal_angle(found, points)
    planes = planes_of(doubtful, points, turned_rad)
    wanted = dict(_wanted(first.modes, list(zip(doubtful, planes, strict=True)), hanger))
    known = {(mode.plane, mode.order): mode.frequency_hz for mode in first.modes}
    while wanted:
        every = sorted([*found, *wanted.values()], key=lambda mode: mode.frequency_hz)
        again = placed(every, points, hanger, tones)
        given = {(mode.plane, mode.order): mode.frequency_hz for mode in again.modes}
        if not known.items() <= given.items():
            return first
        kept = {at: m for at, m in wanted.items() if given.get(at) == m.frequency_hz}
        if len(kept) == len(wanted):
            return again
        wanted = kept
    return first


def _wanted(
    sure: Sequence[Mode], doubtful: Sequence[tuple[FoundMode, Plane]], hanger: Hanger
) -> Iterator[tuple[tuple[Plane, int], FoundMode]]:
    """The nearest doubtful mode to each order that the bar of the sure ones has beside them."""
    groups = [[mode for mode in sure if mode.plane == plane] for plane in PLANES]
    planes = [(plane, own) for plane, own in zip(PLANES, groups, strict=True) if own]
    if len(sure) < LEAST_MODES:
        return
    frequency_hz = [np.array([mode.frequency_hz for mode in own]) for _, own in planes]
    orders = tuple(tuple(mode.order for mode in own) for _, own in planes)
    bar = fitted_bar(frequency_hz, orders, Expected.of(hanger))
    if not bar.fits:
        return
    highest = max(mode.order for mode in sure)
    for number, (plane, own) in enumerate(planes):
        for order, hz in enumerate(bar.frequencies_hz(number, highest).tolist(), 1):
            near = [
                mode
                for mode, moves_in in doubtful
                if moves_in == plane
                and abs(mode.frequency_hz - hz) < _NEAR * hz
                and mode.frequency_sd_hz < _NEAR * hz
            ]
            if near and all(mode.order != order for mode in own):
                yield (plane, order), min(near, key=lambda m: abs(m.frequency_hz - hz))
