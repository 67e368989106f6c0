"""The background under a recording's motion, by which a copy is known that was altered a little.

Hits of one hanger ring alike, those of a machine nearly to the sample. What never comes again is
what no linear prediction foresees: wind, traffic and the noise of the sensors. A copy with noise, a
drift or slightly rotated axes has it still. Of some windows of each channel the signs of the
prediction errors are kept (as of sounds: Haitsma and Kalker 2002, A highly robust audio
fingerprinting system), where they are near their floor: hits and what follows them say nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from shm.values import BoolArray, Fingerprint, FloatArray, IntArray

_ORDER = 128
"""Of the prediction: two a mode of some 30 in both planes below half the sampling rate, and as many
again. With 64 the ring-down of a machine's hits is left over, and correlates by 0.1."""

_WINDOW = 2728
"""Samples: 8 kB a recording of four channels in three windows, a multiple of whole bytes. Signs by
chance correlate by 0.011 in all windows of a channel."""

_WINDOWS = 3
"""A channel. Of five hits of one strength noise may make any three the strongest, but two such
choices have one in common."""

_MOST = 24 * _WINDOWS
"""Windows a recording, of its first channels where they are more: 48 kB."""

_ROUNDS = 3
"""Of the prediction, from the second on without the hits: a dozen samples of a hit that nothing
foresees would weigh more than all the ring-down."""

_LOCAL, _FLOOR, _NEAR = 64, 0.2, 2.0
"""The errors over so many samples are near their floor, the lowest fifth, within a factor of two in
amplitude: there the background is, and no hit."""

_RIDGE = 1e-12
"""Of the power: what double precision leaves of it in squares."""

_SHORTEST = 8 * _ORDER
"""Samples: eight a coefficient, or the prediction learns the noise itself."""

_FORESEEN = 1e-6
"""Errors of less than this share of the motion are rounding: a hum without noise."""

_STEPS = np.sqrt(0.5**2 + 1 / 12)
"""Standard deviation of what is recorded of the background, in steps of the converter, at least:
half a step of noise, and rounding. With less the rounding follows from the motion (Widrow and
Kollar 2008, Quantization noise), and comes again where that does."""

ALIKE, BY_CHANCE = 0.15, 7.0
"""Correlation of the signs of copies at least, in at least half of the channels, and by how many
standard deviations of chance. Distinct simulated hits, by hand or by machine, come to 0.07, the
five real ones in shared/data to 0.13, copies with 1 % of noise to 0.18 at least: measured by
`tests/benchmarks/copies.py`."""

_CHANNEL, _LENGTH, _START, _ONSET = 0, 1, 2, 3  # columns of the places, the last for each onset


def traced(records: Sequence[Sequence[FloatArray]]) -> tuple[NDArray[np.uint8], IntArray]:
    """`noise` and `places` of a `Fingerprint`, of the moving channels of each record of a test."""
    noise = [np.zeros((2, 0, _WINDOW // 8), dtype=np.uint8)]
    places = [np.zeros((0, _ONSET + _WINDOWS), dtype=np.int64)]
    channel = 0
    for record in records:
        onsets = _onsets(record)
        for row in record:
            starts = _starts(len(row), onsets)
            has_room = sum(map(len, places)) + len(starts) <= _MOST
            if has_room and (found := _signs(row, starts)).any():
                noise.append(np.packbits(found, axis=2))
                places.append(np.array([(channel, len(row), each, *onsets) for each in starts]))
            channel += 1
    return np.concatenate(noise, axis=1), np.concatenate(places)


def in_common(own: Fingerprint, other: Fingerprint) -> dict[tuple[int, int], int]:
    """The pairs of channels that share their background, and how many samples both have.

    Empty where these are fewer than half of the channels of the one that has fewer.
    """
    if not len(own.places) or not len(other.places):
        return {}
    here, there = _unpacked(own), _unpacked(other)
    fewest = min(len(np.unique(each.places[:, _CHANNEL])) for each in (own, other))
    for lag in _lags(own.places, other.places):
        pairs = _pairs(here, there, own.places, other.places, lag)
        if 2 * len(pairs) >= fewest:
            return pairs
    return {}


def _onsets(record: Sequence[FloatArray]) -> list[int]:
    """Where the motion of all channels together is most sudden, the strongest first."""
    suddenness = np.zeros(min(map(len, record)))
    for row in record:
        step = np.abs(np.diff(row[: len(suddenness)], prepend=row[0]))
        suddenness += step / max(float(step.max()), np.finfo(float).tiny)
    found = []
    for _ in range(_WINDOWS):
        at = int(suddenness.argmax())
        found.append(at)
        suddenness[max(at - _WINDOW, 0) : at + _WINDOW] = 0
    return found


def _starts(length: int, onsets: Sequence[int]) -> list[int]:
    """Of the windows: right before the onsets, where it is quietest, else at the end.

    Not where power is least: noise would choose otherwise.
    """
    if length < _WINDOW:
        return [0] if length >= _SHORTEST else []
    at_end = range(length - _WINDOW, -1, -_WINDOW)
    found: list[int] = []
    for start in (*(each - _WINDOW for each in onsets), *at_end):
        apart = all(abs(start - each) >= _WINDOW for each in found)
        if start >= 0 and apart and len(found) < _WINDOWS:
            found.append(start)
    return found


def _signs(row: FloatArray, starts: Sequence[int]) -> BoolArray:
    """Of the prediction errors (2, windows, samples): whether they are positive; near their floor.

    All false where they say nothing of a background.
    """
    found = np.zeros((2, len(starts), _WINDOW), dtype=bool)
    scale = np.abs(row).max(initial=0)
    if not starts or not 0 < scale < np.inf:
        return found
    parts = np.array([row[each : each + _WINDOW] for each in starts]) / scale
    parts = parts - parts.mean()
    before = sliding_window_view(parts, _ORDER + 1, axis=1)
    near = np.ones(before.shape[:2], dtype=bool)
    for _ in range(_ROUNDS):
        filter_ = np.append(-_prediction(before[near]), 1.0)
        error = np.array([np.correlate(part, filter_, "valid") for part in parts])
        local = np.sqrt(scipy.ndimage.uniform_filter1d(error**2, _LOCAL, axis=1))
        floor = float(np.quantile(local, _FLOOR))
        near = local < _NEAR * floor
        if near.sum() < _SHORTEST:
            return found
    rounding = _STEPS * _step(parts) * float(np.linalg.norm(filter_))
    if floor > max(rounding, _FORESEEN * float(np.std(parts))):
        found[:, :, _ORDER : parts.shape[1]] = error > 0, near
    return found


def _prediction(before: FloatArray) -> FloatArray:
    """Weights (order,) by which the last of each row (rows, order + 1) follows from the others."""
    power = before.T @ before
    ridge = _RIDGE * np.trace(power) * np.eye(_ORDER)
    return np.asarray(np.linalg.solve(power[:-1, :-1] + ridge, power[:-1, -1]))


def _step(values: FloatArray) -> float:
    """The smallest difference of two values: the converter's last bit, if it shows."""
    return float(np.diff(np.unique(values)).min(initial=np.inf))


def _unpacked(print_: Fingerprint) -> FloatArray:
    """Signs (windows, samples): 1, -1, or 0 where the errors say nothing."""
    positive, near = np.unpackbits(print_.noise, axis=2).astype(np.float32)
    return np.asarray((2 * positive - 1) * near)


def _lags(own: IntArray, other: IntArray) -> list[int]:
    """By how many samples the other may begin after the one: none, or as their onsets lie."""
    onsets = (np.unique(each[:, _ONSET:]) for each in (own, other))
    return sorted({0, *np.subtract.outer(*onsets).ravel().tolist()}, key=abs)


def _pairs(
    here: FloatArray, there: FloatArray, own: IntArray, other: IntArray, lag: int
) -> dict[tuple[int, int], int]:
    """Pairs of channels with the same background if the other begins `lag` samples later."""
    size = own[:, _CHANNEL].max() + 1, other[:, _CHANNEL].max() + 1
    agreeing, count = np.zeros(size), np.zeros(size)
    for start in np.unique(own[:, _START]):
        for second in np.unique(other[:, _START]):
            shift = int(start - second - lag)
            if abs(shift) >= _WINDOW:
                continue
            mine, its = own[:, _START] == start, other[:, _START] == second
            one = here[mine, max(0, -shift) : _WINDOW - max(0, shift)]
            two = there[its, max(0, shift) : _WINDOW - max(0, -shift)]
            at = np.ix_(own[mine, _CHANNEL], other[its, _CHANNEL])
            agreeing[at] += one @ two.T
            count[at] += np.abs(one) @ np.abs(two).T
    count = np.maximum(count, 1)
    alike = np.abs(agreeing) / count
    enough = (alike >= np.maximum(ALIKE, BY_CHANCE / np.sqrt(count))) & (count >= _SHORTEST)
    lengths = ({int(c): int(n) for c, n in each[:, :2]} for each in (own, other))
    ours, theirs = lengths
    return {
        (int(i), int(j)): min(ours[int(i)], theirs[int(j)] + lag) - max(0, lag)
        for i, j in zip(*scipy.optimize.linear_sum_assignment(alike, maximize=True), strict=True)
        if enough[i, j]
    }
