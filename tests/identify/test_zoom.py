"""A window of the band leaves decaying sines what they are, and shows pairs that the band hides."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shm.identify import IdentifyOptions
from shm.identify.contract import Measurement
from shm.identify.estimation.hankel import Window, windows
from shm.identify.estimation.ssi import through_windows
from shm.values import FloatArray, ResponsePoint
from tests.benchmarks.recordings_limit import ring_down_covariance
from tests.worlds.recordings import ModeTruth

RATE_HZ = 256.0


def _decay(seed: int, pairs: int, noise: float) -> FloatArray:
    """Return a free decay of 12 s at four points: `pairs` of modes half a bandwidth apart."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(12 * RATE_HZ)) / RATE_HZ
    motion = noise * rng.standard_normal((4, len(t)))
    for n in range(1, pairs + 1):
        for hz, shape in ((2.1 * n, (1, 0.6, 0, 0)), (2.1 * n * 1.003, (0, 0, 1, 0.7))):
            phase = rng.uniform(0, 2 * np.pi)
            wave = np.exp(2 * np.pi * hz * (1j - 0.003) * t + 1j * phase).imag
            motion += np.outer(shape, wave)
    return motion


def _measurement(decays: tuple[FloatArray, ...]) -> Measurement:
    points = tuple(ResponsePoint(f"p{n}") for n in range(len(decays[0])))
    return Measurement("t", points, decays, RATE_HZ, None)


def test_a_decaying_sine_passes_a_window_as_one_lowered_by_its_shift() -> None:
    """exp(s t) through a filter that runs backwards is H(s) exp(s t): three samples foretell it."""
    window = Window(26.0, 38.0)
    pole = 2 * np.pi * 31.0 * (1j - 0.004)
    t = np.arange(int(8 * RATE_HZ)) / RATE_HZ
    slow = window.through(np.exp(pole * t).imag[np.newaxis], RATE_HZ)[0]
    step = 1 / window.rate_hz(RATE_HZ)
    lowered = np.exp((pole - 2j * np.pi * window.shift_hz) * step)
    rule = np.array([1.0, -2 * lowered.real, abs(lowered) ** 2])
    error = np.convolve(slow, rule, mode="valid")
    assert np.max(np.abs(error)) < 3e-4 * np.max(np.abs(slow))


def test_windows_cover_the_band_side_by_side() -> None:
    every = list(windows(RATE_HZ, IdentifyOptions(2.0, 100.0)))
    assert [w.high_hz for w in every[:-1]] == [w.low_hz for w in every[1:]]
    assert (every[0].low_hz, every[-1].high_hz) == (2.0, 100.0)


def test_windows_find_close_pairs_of_a_single_decay() -> None:
    """Twelve pairs 0.3 % apart, 60 dB above the noise: every one within 0.05 %."""
    measurement = _measurement((_decay(1, 12, 1e-3), _decay(2, 12, 1e-3)))
    options = IdentifyOptions(2.0, 50.0)
    found = through_windows(measurement, options, windows(RATE_HZ, options))
    frequencies = np.array([mode.frequency_hz for mode in found.modes])
    for n in range(1, 13):
        for hz in (2.1 * n, 2.1 * n * 1.003):
            assert np.min(np.abs(frequencies / hz - 1)) < 5e-4, hz


def test_a_short_ring_down_among_long_ones_does_not_shorten_the_lags() -> None:
    long = tuple(_decay(seed, 12, 1e-3) for seed in (1, 2, 3))
    options = IdentifyOptions(2.0, 14.0)
    found, without = (
        through_windows(_measurement(each), options, windows(RATE_HZ, options)).modes
        for each in ((*long, long[0][:, :400]), long)
    )
    assert [mode.frequency_hz for mode in found] == [mode.frequency_hz for mode in without]
    assert len(found) == 12


def test_the_bound_of_one_decay_is_the_closed_one() -> None:
    """A exp(-s t) cos(w t + p) in noise of density S for ever: var w = 8 s^3 S / A^2."""
    hz, damping, density, amplitude = 10.0, 0.004, 1e-6, 0.5
    mode = ModeTruth(
        "x", 1, hz, hz, 0.0, hz, damping, 60.0, (1.0,), (density,), (complex(amplitude),)
    )
    (covariance,) = ring_down_covariance((mode,), np.array([200.0]))
    decay = 2 * math.pi * hz * damping
    assert covariance[0, 0] == pytest.approx(8 * decay**3 * density / amplitude**2, rel=1e-3)
