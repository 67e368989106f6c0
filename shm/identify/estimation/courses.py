"""Follow amplitude and phase of each mode through each ring-down.

In each stretch the found poles and shapes are fitted to all channels by least squares.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from shm.identify.contract import FoundMode, poles_of_modes
from shm.values import ComplexArray, FloatArray

_LEAK = 0.01
"""Of a neighbour's motion, at least: comes into a mode's by the error of its shape."""
_RESOLUTION_HZ = 2.0  # one over the half second of a stretch
OVERLAP = math.sqrt(41 / 35)
"""Stretches overlap by half: noise in two neighbours has the correlation 3/35 (the integral of
sin^4 cos^4 over that of sin^8), which makes the variance of a mean 1 + 6/35 times larger."""
_STRETCH_SECONDS = 0.5  # judgement: some periods of most modes; phases turn by little in it
_MOST_STRETCHES = 40  # technical: time
_GROWS = 1.3  # judgement: more than beats of a weak neighbour make
_LEAST_RATIO = 2.0
"""Of an amplitude to its standard deviation: its phase is known to half a radian. With 4 the
median error is a fifth larger."""
_PHASE_SD = 1e-4  # rad, technical: no weight without bound
_RIDGE = 1e-9  # technical: keeps the normal equations solvable
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class RingDownCourse:
    """One ring-down in stretches, whose middles are at `middle_s`.

    `motion` (stretches, modes): complex amplitudes referred to its beginning, with standard
    deviations `sd`.
    """

    middle_s: FloatArray
    motion: ComplexArray
    sd: FloatArray


def course_of(decay: FloatArray, modes: Sequence[FoundMode], rate_hz: float) -> RingDownCourse:
    samples = decay.shape[1]
    hop = max(int(_STRETCH_SECONDS * rate_hz) // 2, samples // _MOST_STRETCHES, 1)
    length = min(2 * hop, samples)
    shapes = np.array([mode.shape for mode in modes])  # (modes, channels)
    poles = poles_of_modes(modes)
    waves = np.exp(np.outer(poles, np.arange(length) / rate_hz))  # (modes, length)
    # Columns Re and -Im of shape times wave, for all channels: the same in every stretch.
    window = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
    basis = (shapes[:, :, np.newaxis] * (window * waves)[:, np.newaxis, :]).reshape(len(modes), -1)
    columns = np.vstack([basis.real, -basis.imag])
    gram = columns @ columns.T
    scale = np.sqrt(np.diag(gram))
    inverse = np.linalg.inv(gram / np.outer(scale, scale) + _RIDGE * np.eye(len(gram)))
    inverse /= np.outer(scale, scale)
    parts = sliding_window_view(decay, length, axis=1)[:, ::hop] * window
    flat = parts.transpose(1, 0, 2).reshape(parts.shape[1], -1)
    solved = flat @ columns.T @ inverse  # (stretches, 2 modes)
    rest = flat - solved @ columns
    noise = _noise(rest.reshape(len(flat), -1, length), min(len(columns), rest.shape[1] - 1))
    variance = np.diag(inverse)
    half = len(modes)
    motion = solved[:, :half] + 1j * solved[:, half:]
    begin_s = np.arange(len(flat)) * hop / rate_hz
    hertz = np.array([mode.frequency_hz for mode in modes])
    unresolved = np.abs(hertz[:, np.newaxis] - hertz) < _RESOLUTION_HZ
    np.fill_diagonal(unresolved, False)
    sd = np.sqrt(np.outer(noise, variance[:half] + variance[half:]) / 2)
    sd = np.hypot(sd, np.sqrt(np.abs(motion * _leaks(modes)) ** 2 @ unresolved))
    turned = np.exp(-np.outer(begin_s, poles))
    middle_s = begin_s + length / (2 * rate_hz)
    return RingDownCourse(middle_s, motion * turned, sd * np.abs(turned))


def _noise(rest: FloatArray, columns: int) -> FloatArray:
    """Return the noise in each stretch, (stretches,): the median line of what is left there.

    `rest` is (stretches, channels, samples) without `columns` that were fitted, which empty as many
    lines. The mean would take a mode that is not fitted well for noise of all the others.
    """
    samples = rest.shape[-1]
    power = np.mean(np.abs(np.fft.rfft(rest, axis=-1)) ** 2, axis=1) / samples
    return np.asarray(np.quantile(power, (1 + columns / rest[0].size) / 2, axis=1))


def _leaks(modes: Sequence[FoundMode]) -> FloatArray:
    """Return the error of each mode's shape over it, (modes,)."""
    shares = [np.linalg.norm(mode.shape_sd) / np.linalg.norm(mode.shape) for mode in modes]
    return np.fmax(np.array(shares), _LEAK)


Row = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Times, phases, their standard deviations; amplitudes referred to the beginning."""


def phases_of(course: RingDownCourse, index: int, decay: float) -> Row | None:
    """Return the stretches from the start in which the mode is above the rest; None for few."""
    motion, sd = course.motion[:, index], course.sd[:, index]
    now = np.abs(motion) * np.exp(-decay * course.middle_s)
    # What grows again is no free decay: something else was heard at its frequency.
    falls = now < _GROWS * np.minimum.accumulate(now)
    clear = falls & (np.abs(motion) > _LEAST_RATIO * sd)
    last = int(np.argmin(clear)) if not np.all(clear) else len(clear)
    if last < 4:
        return None
    phase, size = np.unwrap(np.angle(motion[:last])), np.abs(motion[:last])
    sd = np.maximum(sd[:last] / np.maximum(size, TINY), _PHASE_SD)
    smooth = np.polynomial.Polynomial.fit(course.middle_s[:last], np.log(size), 2, w=1 / sd)
    return course.middle_s[:last], phase, sd, np.exp(smooth(course.middle_s[:last]))
