"""Estimate how late channels are, by the phases of the modes.

One converter that goes from channel to channel samples the last up to a sample later than the
first, a second board may start late. A mode's phase at a channel that is late by tau falls behind
by 2 pi f tau: at 80 Hz and a sample of 256 Hz by a third of a turn, so that its shape is no longer
real. Delays that make the shapes of all modes real at once are taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.identify.estimation.poles import Candidate, PoleSet
from shm.identify.estimation.shapes import collinearity
from shm.identify.options import IdentifyOptions
from shm.values import ComplexArray, FloatArray

_STAYS = 0.2  # of the spreads that are allowed, as of a mode that orders alone prove
_LEAST_MODES = 6
"""Three of them foretell three others; of two, two channels' phases agree by chance."""
_REAL = 0.9
"""Phase collinearity of most modes, once delays are off that the others gave: of random phases at
three channels it is a half."""
_STEPS, _FINER, _PASSES = 33, 3, 6  # technical: delays to 1e-4 of a period, one channel at a time


def delays_s(candidates: Sequence[Candidate], options: IdentifyOptions) -> FloatArray | None:
    """Return the delay of each channel (channels,), up to half a period of the band's end.

    None where not validated: the delays of every other mode must make the shapes of the rest
    real, and more so than none do. Candidates that orders validate count, as where hits are
    few.
    """
    highest_hz = options.band_high_hz
    candidates = [
        each
        for each in candidates
        if each.frequency_spread < _STAYS * options.max_frequency_spread
        and each.damping_spread < _STAYS * options.max_damping_spread
    ]
    if len(candidates) < _LEAST_MODES or len(candidates[0].poles[-1].shape) < 2:
        return None
    frequency_hz = np.array([each.poles[-1].frequency_hz for each in candidates])
    shapes = np.array([each.poles[-1].shape for each in candidates])
    foretold = np.empty(len(shapes))
    for half in (slice(0, None, 2), slice(1, None, 2)):
        rest = np.ones(len(shapes), dtype=bool)
        rest[half] = False
        late_s = _most_real(frequency_hz[half], shapes[half], highest_hz)
        foretold[rest] = _realness(frequency_hz[rest], shapes[rest], late_s)
    as_given = _realness(frequency_hz, shapes, np.zeros(shapes.shape[1]))
    if np.median(foretold) < _REAL or foretold.mean() <= as_given.mean():
        return None
    return _most_real(frequency_hz, shapes, highest_hz)


def _realness(frequency_hz: FloatArray, shapes: ComplexArray, late_s: FloatArray) -> FloatArray:
    """Return the phase collinearity (modes,) of `shapes` (modes, channels) with delays removed."""
    return collinearity(shapes * np.exp(2j * np.pi * np.outer(frequency_hz, late_s)))


def _most_real(frequency_hz: FloatArray, shapes: ComplexArray, highest_hz: float) -> FloatArray:
    """Return the delays with the largest sum over the modes of |sum of v^2|, the first 0."""
    squares = shapes**2 / np.sum(np.abs(shapes) ** 2, axis=1, keepdims=True)
    late_s = np.zeros(shapes.shape[1])
    reach_s = 1 / (2 * highest_hz)
    for finer in range(_FINER):
        steps_s = np.linspace(-1, 1, _STEPS) * reach_s / (_STEPS // 4) ** finer
        for _ in range(_PASSES):
            for channel in range(1, len(late_s)):
                turned = squares * np.exp(4j * np.pi * np.outer(frequency_hz, late_s))
                others = turned.sum(axis=1) - turned[:, channel]
                tried_s = steps_s + (late_s[channel] if finer else 0.0)
                orders = squares[:, channel] * np.exp(4j * np.pi * np.outer(tried_s, frequency_hz))
                late_s[channel] = tried_s[np.argmax(np.abs(others + orders).sum(axis=1))]
    return late_s


def remove_delays(poles: PoleSet, late_s: FloatArray) -> PoleSet:
    """Return the poles with the shapes that channels without delays have."""
    turns = np.exp(2j * np.pi * np.outer(late_s, poles.frequency_hz))
    return replace(poles, shapes=poles.shapes * turns)
