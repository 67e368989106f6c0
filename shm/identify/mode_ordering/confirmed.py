"""Modes that a closer look shows where the bar of the sure ones has a mode.

A narrow window shows modes that the whole band does not. A weak mode, or one beside another,
changes by more from hit to hit than is asked of a mode that nothing else speaks for. Where the sure
modes are a bar's to a thousandth, they say where the missing orders are: what moves there, in that
plane, is one, though one hit or one model order leave it in doubt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from shm.identify.contract import FoundMode, Tone
from shm.identify.mode_ordering.bar_fit import LEAST_MODES, PLAIN_BAR, fitted_bar
from shm.identify.mode_ordering.order import TOLERANCES, Expected
from shm.identify.mode_ordering.placement import Placement, placed
from shm.identify.mode_ordering.planes import planes_of, principal_angle
from shm.values import PLANES, Hanger, Mode, Plane, ResponsePoint

_NEAR = 3 * PLAIN_BAR
"""Of the bar's frequency: three standard deviations of a hanger that is but a bar. In 125 tests of
tests/worlds/recordings.py (seeds 9400, 9401, 9500 to 9502) 1643 of 1960 identifiable modes are
found without this module, 1727 with it; 4 false ones with and without."""

_FAR = max(tolerance.frequency for tolerance in TOLERANCES)
"""Of the bar's frequency: no mode of a hanger that is less of a bar is farther from it."""

Look: TypeAlias = Callable[[Sequence[float]], tuple[Sequence[FoundMode], Sequence[FoundMode]]]
"""What a closer look shows at the given frequencies in Hz: modes, and modes in doubt."""


def placed_with_doubtful(
    found: Sequence[FoundMode],
    look: Look,
    points: Sequence[ResponsePoint],
    hanger: Hanger | None,
    tones: Sequence[Tone] = (),
) -> Placement:
    """As `placed`, with what a closer `look` shows in the gaps, where all other orders stay."""
    first = placed(found, points, hanger, tones)
    if hanger is None or not hanger.as_hanger:
        return first
    gaps, plain = _gaps(first.modes, hanger)
    if not gaps:
        return first
    modes, doubtful = look(list(gaps.values()))
    modes = [*modes, *doubtful] if plain else modes
    planes = planes_of(modes, points, principal_angle(found, points))
    wanted = _nearest(gaps, list(zip(modes, planes, strict=True)), _NEAR if plain else _FAR)
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


def _gaps(sure: Sequence[Mode], hanger: Hanger) -> tuple[dict[tuple[Plane, int], float], bool]:
    """The frequencies in Hz of the orders that the bar of the sure modes has beside them, and
    whether it is one to a thousandth."""
    groups = [[mode for mode in sure if mode.plane == plane] for plane in PLANES]
    planes = [(plane, own) for plane, own in zip(PLANES, groups, strict=True) if own]
    if len(sure) < LEAST_MODES:
        return {}, False
    highest = max(mode.order for mode in sure)
    orders = tuple(tuple(mode.order for mode in own) for _, own in planes)
    if all(len(own) == highest for own in orders):
        return {}, False
    frequency_hz = [np.array([mode.frequency_hz for mode in own]) for _, own in planes]
    bar = fitted_bar(frequency_hz, orders, Expected.of(hanger))
    gaps = {
        (plane, order): hz
        for number, (plane, _) in enumerate(planes)
        for order, hz in enumerate(bar.frequencies_hz(number, highest).tolist(), 1)
        if order not in orders[number]
    }
    return gaps, bar.fits


def _nearest(
    gaps: dict[tuple[Plane, int], float], modes: Sequence[tuple[FoundMode, Plane]], reach: float
) -> dict[tuple[Plane, int], FoundMode]:
    """Of each gap the mode nearest to it, in its plane, where one is near and sure enough."""
    found = {}
    for (plane, order), hz in gaps.items():
        near = [
            mode
            for mode, moves_in in modes
            if moves_in == plane
            and abs(mode.frequency_hz - hz) < reach * hz
            and mode.frequency_sd_hz < _NEAR * hz
        ]
        if near:
            found[plane, order] = min(near, key=lambda mode: abs(mode.frequency_hz - hz))
    return found
