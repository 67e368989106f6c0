from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from pyoma2.functions.gen import example_data
from scipy.signal import lfilter

from shm.identify import IDENTIFIERS, IdentifyOptions
from shm.identify.contract import Finding, Measurement
from shm.values import FloatArray, ResponsePoint

OPTIONS = IdentifyOptions(2.0, 50.0)
RATE_HZ = 128.0
PARTS = 12
PLACES = (("transverse", 1.2), ("longitudinal", 1.2), ("transverse", 2.9), ("longitudinal", 2.9))
FREQUENCIES_HZ = (6.0, 6.1, 12.4, 12.6, 19.3, 19.6, 27.0, 27.5)
DAMPING_RATIO = 0.003


def _moved_by_noise(
    modes: Sequence[tuple[float, Sequence[float]]], samples: int, damping_ratio: float, seed: int
) -> FloatArray:
    """Return (channels, samples): each mode, a frequency and a shape, moved by its own noise."""
    rng = np.random.default_rng(seed)
    motion = 0.02 * rng.standard_normal((len(PLACES), samples))
    for frequency_hz, shape in modes:
        omega = 2 * np.pi * frequency_hz
        pole = omega * (-damping_ratio + 1j * np.sqrt(1 - damping_ratio**2))
        noise = rng.standard_normal(samples).astype(complex)
        modal = lfilter([1], [1, -np.exp(pole / RATE_HZ)], noise).imag
        motion += np.outer(shape, modal / modal.std())
    return motion


def _identified(motion: FloatArray, options: IdentifyOptions) -> Finding:
    points = tuple(ResponsePoint("a", plane, x) for plane, x in PLACES)  # type: ignore[arg-type]
    parts = tuple(np.array_split(motion, PARTS, axis=1))
    return IDENTIFIERS["ssi"](Measurement("ambient", points, parts, RATE_HZ, None), options)


def _found(tone_hz: float = 0.0) -> Finding:
    """Modes in pairs of two planes, each moved by white noise for five minutes."""
    samples = int(300 * RATE_HZ)
    modes = []
    for number, frequency_hz in enumerate(FREQUENCIES_HZ):
        shape = np.zeros(4)
        shape[number % 2 :: 2] = np.sin((number // 2 + 1) * np.pi * np.array([1.2, 2.9]) / 10)
        modes.append((frequency_hz, shape))
    motion = _moved_by_noise(modes, samples, DAMPING_RATIO, 8)
    if tone_hz:
        tone = np.sin(2 * np.pi * tone_hz * np.arange(samples) / RATE_HZ)
        motion += np.outer([1.0, 0.5, -0.7, 0.3], tone)
    return _identified(motion, OPTIONS)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_mode_above_the_band_makes_none(seed: int) -> None:
    """On the slope of a window's filter a mode at 42.3 Hz looked like one at 40.5 Hz."""
    above = [(42.3, (1.0, 0.0, -0.6, 0.0)), (42.7, (0.0, 1.0, 0.0, -0.6))]
    inside = [(33.0, (1.0, 0.0, 0.6, 0.0)), (33.3, (0.0, 1.0, 0.0, 0.6))]
    motion = _moved_by_noise([*above, *inside], 30_000, 0.002, seed)
    found = _identified(motion, IdentifyOptions(28.8, 40.9))
    assert [mode.frequency_hz for mode in found.modes] == pytest.approx([33.0, 33.3], rel=1e-3)


def test_motion_without_a_hammer_gives_modes_within_their_intervals() -> None:
    modes = _found().modes
    assert len(modes) == len(FREQUENCIES_HZ)
    for mode, frequency_hz in zip(modes, FREQUENCIES_HZ, strict=True):
        assert mode.frequency_hz == pytest.approx(frequency_hz, rel=1e-3)
        assert abs(mode.frequency_hz - frequency_hz) < 3 * mode.frequency_sd_hz
        assert abs(mode.damping_ratio - DAMPING_RATIO) < 3 * mode.damping_sd


@pytest.mark.parametrize("tone_hz", [16.0, 33.3])
def test_a_steady_tone_is_no_damped_mode_and_does_not_go_unseen(tone_hz: float) -> None:
    """It stays a pole of next to no damping, or its poles are dropped: growing ones, by reason."""
    finding = _found(tone_hz)
    near = [m for m in finding.modes if abs(m.frequency_hz / tone_hz - 1) < 0.002]
    assert all(mode.damping_ratio < 1e-4 for mode in near)
    limit = "damping ratio not between 0 and 0.05"
    assert near or sum(d.count for d in finding.dropped if d.reason == limit) > 0
    assert len(finding.modes) - len(near) == len(FREQUENCIES_HZ)


def test_the_published_frame_gives_all_its_five_modes() -> None:
    """pyOMA2's example: white noise on five storeys, whose first mode hardly accelerates."""
    motion, _, (truth_hz, *_) = example_data()
    parts = tuple(np.array_split(motion.T, PARTS, axis=1))
    points = tuple(ResponsePoint(str(floor), "transverse", floor) for floor in range(5))
    measurement = Measurement("frame", points, parts, 100.0, None)
    found = IDENTIFIERS["ssi"](measurement, IdentifyOptions(0.3, 20.0))
    assert [mode.frequency_hz for mode in found.modes] == pytest.approx(truth_hz, rel=0.01)
