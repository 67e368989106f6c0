"""A frequency that depends on amplitude is given for small amplitude, with its slope.

The phase of a mode whose frequency is f (1 + c A / A_hit), A falling as exp(-s t), is
2 pi f (t + c (1 - exp(-s t)) / s).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.contract import FoundMode
from shm.identify.estimation.courses import course_of
from shm.values import Channel, Recording

RATE_HZ, SLOT_S, HITS = 512.0, 6.0, 4
FREQUENCIES_HZ, DAMPING_RATIO = (9.0, 21.0, 34.0), 0.003
SHAPES = ((1.0, 0.7), (0.8, -0.6), (0.5, 1.0))


def _recording(slope: float, half: float = math.inf, seed: int = 5) -> Recording:
    """Return the change goes with A, or where `half` is finite with (1 + half) A / (A + half)."""
    rng = np.random.default_rng(seed)
    slot, before = int(SLOT_S * RATE_HZ), int(0.4 * RATE_HZ)
    motion = 1e-3 * rng.standard_normal((2, before + HITS * slot))
    force = 0.1 * rng.standard_normal(before + HITS * slot)
    for hit in range(HITS):
        begin = hit * slot + before
        strength = 1.0 + 0.1 * (hit - 1.5)
        force[begin : begin + 4] += 1000 * strength * np.array([0.4, 1.0, 1.0, 0.4])
        t = np.arange(slot) / RATE_HZ
        for frequency_hz, shape in zip(FREQUENCIES_HZ, SHAPES, strict=True):
            decay = 2 * np.pi * frequency_hz * DAMPING_RATIO
            grown = strength * -np.expm1(-decay * t) / decay
            if math.isfinite(half):
                fallen = (strength + half) / (strength * np.exp(-decay * t) + half)
                grown = (1 + half) / decay * np.log(fallen)
            late = t + slope * grown
            ring = strength * np.exp(-decay * t) * np.sin(2 * np.pi * frequency_hz * late)
            motion[:, begin : begin + slot] += np.outer(shape, ring)
    channels = [Channel("force", "force", force, None, 1.0)] + [
        Channel(f"acc_{row}", "acceleration", values, "transverse", 1.0 + row)
        for row, values in enumerate(motion)
    ]
    return Recording("made.csv", tuple(channels), RATE_HZ)


def _identified(slope: float, half: float = math.inf, seed: int = 5) -> Identification:
    return identify([_recording(slope, half, seed)], IdentifyOptions(2.0, 50.0), test_id="t")


@pytest.mark.parametrize("slope", [-1e-3, -2e-4, 5e-4])
def test_the_slope_is_told_and_the_frequency_is_that_of_small_amplitude(slope: float) -> None:
    """Six records: beside what noise does to one, they share what the average over laws leaves."""
    found, *others = (_identified(slope, seed=seed) for seed in range(5, 11))
    assert len(found.test.modes) == len(FREQUENCIES_HZ)
    off: dict[float, list[float]] = {frequency_hz: [] for frequency_hz in FREQUENCIES_HZ}
    for mode in (mode for each in (found, *others) for mode in each.test.modes):
        frequency_hz = min(FREQUENCIES_HZ, key=lambda hz, at=mode: abs(hz - at.frequency_hz))
        assert mode.amplitude_slope == pytest.approx(slope, rel=0.3)
        assert abs(mode.amplitude_slope - slope) < 4 * mode.amplitude_slope_sd
        assert abs(mode.frequency_hz - frequency_hz) < 3 * mode.frequency_sd_hz
        off[frequency_hz].append(mode.frequency_hz / frequency_hz - 1)
    assert sum(map(len, off.values())) >= 17
    assert all(abs(np.mean(each)) < 0.1 * abs(slope) for each in off.values())
    (check,) = [check for check in found.quality if check.name == "amplitude"]
    assert check.verdict == "warning"
    assert ("lower" if slope < 0 else "higher") in check.found


@pytest.mark.parametrize("half", [0.2, 0.7])
def test_where_a_ring_down_ends_before_its_law_shows_the_interval_is_wide(half: float) -> None:
    """The mode of 9 Hz ends at a third of its amplitude, where more than half of 0.2 % is left."""
    found = _identified(-2e-3, half)
    assert len(found.test.modes) == len(FREQUENCIES_HZ)
    for mode, frequency_hz in zip(found.test.modes, FREQUENCIES_HZ, strict=True):
        assert abs(mode.frequency_hz - frequency_hz) < 2 * mode.frequency_sd_hz
        assert mode.frequency_sd_hz < 1e-3 * frequency_hz


def test_a_linear_hanger_has_no_slope_and_no_warning() -> None:
    found = _identified(0.0)
    for mode in found.test.modes:
        assert abs(mode.amplitude_slope) < 1e-5
    (check,) = [check for check in found.quality if check.name == "amplitude"]
    assert check.verdict == "good"


def test_course_noise_of_another_frequency() -> None:
    """What rings at 60 Hz and is no known mode leaves a mode of 9 Hz as sure as it was."""
    shape, rng = np.array(SHAPES[0]), np.random.default_rng(3)
    t = np.arange(int(SLOT_S * RATE_HZ)) / RATE_HZ
    ring = np.outer(shape, np.exp(-0.17 * t) * np.sin(2 * np.pi * 9.0 * t))
    ring += 0.01 * rng.standard_normal(ring.shape)
    loud = ring + 3.0 * np.outer([0.4, 1.0], np.sin(2 * np.pi * 60.0 * t))
    mode = FoundMode(9.0, 0.001, 0.003, 1e-4, shape, np.zeros(2))
    alone, beside = (course_of(decay, [mode], RATE_HZ).sd[:, 0] for decay in (ring, loud))
    np.testing.assert_allclose(beside, alone, rtol=0.2)
