"""Copies of a recording that somebody altered a little."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import signal

from shm.values import Channel, FloatArray, Recording

Alter = Callable[[Recording], Recording]


def noisy(recording: Recording, share: float, seed: int = 9) -> Recording:
    """With noise of a share of each channel's standard deviation."""
    rng = np.random.default_rng(seed)

    def with_noise(values: FloatArray) -> FloatArray:
        return np.asarray(values + share * values.std() * rng.standard_normal(len(values)))

    return _each(recording, with_noise)


def rotated(recording: Recording, angle_rad: float) -> Recording:
    """The two axes of each biaxial accelerometer turned, which follow each other."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    turned: dict[str, FloatArray] = {}
    responses = recording.accelerations
    for one, two in zip(responses[::2], responses[1::2], strict=True):
        turned[one.name] = cos * one.values - sin * two.values
        turned[two.name] = sin * one.values + cos * two.values
    channels = (replace(c, values=turned.get(c.name, c.values)) for c in recording.channels)
    return replace(recording, channels=tuple(channels))


def drifting(recording: Recording) -> Recording:
    """With a line that climbs by the standard deviation of each channel."""
    return _each(recording, lambda v: np.asarray(v + v.std() * np.linspace(0, 1, len(v))))


def cut(recording: Recording, first: float, last: float) -> Recording:
    """A part of it, between two shares of its length."""
    return _each(recording, lambda v: v[int(first * len(v)) : int(last * len(v))])


def _each(recording: Recording, alter: Callable[[FloatArray], FloatArray]) -> Recording:
    def of(channel: Channel) -> Channel:
        return replace(channel, values=alter(channel.values))

    return replace(recording, channels=tuple(map(of, recording.channels)))


def _rounded(values: FloatArray, digits: int) -> FloatArray:
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


_LOW_PASS = signal.butter(4, 0.4)

ALTERED: dict[str, Alter] = {
    "noise of 1e-4": lambda r: noisy(r, 1e-4),
    "noise of 1 %": lambda r: noisy(r, 0.01),
    "a drift": drifting,
    "axes turned by 0.02 rad": lambda r: rotated(r, 0.02),
    "axes turned by 0.2 rad": lambda r: rotated(r, 0.2),
    "three digits": lambda r: _each(r, lambda v: _rounded(v, 3)),
    "two digits": lambda r: _each(r, lambda v: _rounded(v, 2)),
    "low-passed at 0.4 of its band": lambda r: _each(
        r, lambda v: np.asarray(signal.lfilter(*_LOW_PASS, v))
    ),
    "noise of 1 %, a drift, axes turned": lambda r: noisy(rotated(drifting(r), 0.02), 0.01),
    "noise of 2 %": lambda r: noisy(r, 0.02),
    "noise of 5 %": lambda r: noisy(r, 0.05),
    "cut to 70 %, noise of 1 %": lambda r: noisy(cut(r, 0.2, 0.9), 0.01),
    "one hit of three, noise of 1 %": lambda r: noisy(cut(r, 0, 1 / 3), 0.01),
    "every other sample": lambda r: replace(
        _each(r, lambda v: v[::2]), sampling_rate_hz=r.sampling_rate_hz / 2
    ),
    "resampled by 100/99": lambda r: _each(
        r, lambda v: np.asarray(signal.resample_poly(v, 100, 99))
    ),
}
"""Ways to alter the samples themselves."""
