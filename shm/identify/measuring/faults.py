"""Faults of one signal that a logger or its connectors make: clipped, or standing still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shm.values import BoolArray, FloatArray

LEAST_REPEATS = 3
FULL_SCALE_SHARE = 0.999
"""A converter's largest code lies below its full scale: by 1/2048 of it for 12 bits."""
FROZEN_SAMPLES = 16
_LEVELS_BELOW = 10
_TOP = 200
_CROWDED = 8.0
_MOVES = 30.0
_FINE = 4000.0
"""Levels up to the peak: forces of hits differ by tens of percent, a thousand levels, so that two
are hardly the same by chance."""


def clipped(parts: Sequence[FloatArray], full_scale: float) -> BoolArray:
    """Which parts of one signal, each (samples,), reach what its logger can record.

    Where nobody says what that is: an extreme value is a limit if three samples have it, and more
    than the values next to it make likely.
    """
    if np.isfinite(full_scale):
        tops = [np.max(np.abs(part), initial=0.0) for part in parts]
        return np.array([top >= FULL_SCALE_SHARE * full_scale for top in tops], dtype=bool)
    return np.asarray(_flat_topped(parts) | _flat_topped([-part for part in parts]))


def _flat_topped(parts: Sequence[FloatArray]) -> BoolArray:
    tops = np.array([part.max(initial=-np.inf) for part in parts])
    top = float(tops.max(initial=-np.inf))
    reaches = tops == top
    repeats = sum(int(np.sum(part == top)) for part, at in zip(parts, reaches, strict=True) if at)
    if repeats < LEAST_REPEATS or not _is_crowded(np.concatenate(parts), repeats):
        return np.zeros(len(parts), dtype=bool)
    return np.asarray(reaches)


def _is_crowded(values: FloatArray, repeats: int) -> bool:
    """Is the largest value met far more often than each of the ten levels below it?

    The crest of a sine, quantised, has its top level 3 to 4 times as often as those; a clipped one
    tens of times. A signal of one level is not clipped, it is dead.
    """
    highest = np.sort(np.partition(values, -_TOP)[-_TOP:] if len(values) > _TOP else values)
    steps = np.diff(highest)
    if not np.any(steps > 0):
        return len(values) > _TOP and float(values.min()) < highest[-1]
    step = float(steps[steps > 0].min())
    below = np.sum(
        (highest < highest[-1]) & (highest >= highest[-1] - (_LEVELS_BELOW + 0.5) * step)
    )
    return bool(repeats > _CROWDED * max(1, below) / _LEVELS_BELOW)


def same_peaks(parts: Sequence[FloatArray]) -> BoolArray:
    """Which parts of one signal, each (samples,), share their largest value to the last bit.

    No two hits are alike: what two have in common is the limit of the logger, even where a pulse
    of few samples reaches it once. False where levels are so coarse that chance does it.
    """
    tops = np.array([part.max(initial=-np.inf) for part in parts])
    top = float(tops.max(initial=-np.inf))
    reaches = tops == top
    if np.sum(reaches) < 2:
        return np.zeros(len(parts), dtype=bool)
    steps = np.diff(np.unique(np.concatenate(parts)))
    return np.asarray(reaches & (top > _FINE * float(steps.min(initial=np.inf))))


def frozen(signals: FloatArray) -> BoolArray:
    """Which signals, (channels, samples), stand still for 16 samples while they ought to move."""
    stride = FROZEN_SAMPLES // 2
    # Sixteen equal samples hold two equal ones that are eight apart: only those are looked into.
    thin = signals[:, ::stride]
    suspects = np.flatnonzero(np.any(thin[:, 1:] == thin[:, :-1], axis=1))
    found = np.zeros(len(signals), dtype=bool)
    found[suspects] = [_stands_still(signals[row]) for row in suspects]
    return found


def _stands_still(signal: FloatArray) -> bool:
    steps = np.abs(np.diff(signal))
    edges = np.flatnonzero(np.diff(np.concatenate(([0], steps == 0, [0]))))
    runs = [(a, b) for a, b in edges.reshape(-1, 2) if b - a + 1 >= FROZEN_SAMPLES]
    if not runs or not np.any(steps > 0):
        return False
    # A slow or weak signal rests on one level of its converter for long: there the samples around
    # move by a few levels (nine around a crest). Where they move by 30, it cannot have rested.
    level = float(steps[steps > 0].min())
    return any(_moves_around(signal, a, b + 1, _MOVES * level) for a, b in runs)


def _moves_around(signal: FloatArray, first: int, stop: int, least: float) -> bool:
    length = stop - first
    sides = signal[max(0, first - length) : first], signal[stop : stop + length]
    moves = [float(np.ptp(side)) for side in sides if len(side) >= min(length, FROZEN_SAMPLES)]
    return bool(moves) and min(moves) >= least
