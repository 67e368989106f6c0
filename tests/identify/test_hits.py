from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import firwin, lfilter

from shm.identify.measuring.hits import find_pulses
from shm.values import FloatArray
from tests.identify.signals import force_signal, half_sine


def _force(
    rate_hz: float = 2048.0, hits: int = 4, noise_n: float = 0.5, seed: int = 0
) -> tuple[FloatArray, list[int]]:
    rng = np.random.default_rng(seed)
    starts = [round((0.5 + 3 * hit) * rate_hz) for hit in range(hits)]
    samples = round(3 * hits * rate_hz)
    force = force_signal(starts, samples, rate_hz, rng.uniform(800, 3000, hits))
    return force + noise_n * rng.standard_normal(samples), starts


def _struck_again(force: FloatArray, start: int, share: float, after_s: float) -> FloatArray:
    again = force.copy()
    pulse = half_sine(2048.0, share * float(force.max()))
    begin = start + round(after_s * 2048)
    again[begin : begin + len(pulse)] += pulse
    return again


def test_every_hit_is_found_where_it_begins() -> None:
    force, starts = _force(hits=6)
    found = [pulse.start for pulse in find_pulses(force, 2048.0)]
    assert np.max(np.abs(np.subtract(found, starts))) <= 1


def test_the_peak_force_of_each_hit_is_told() -> None:
    force, starts = _force(noise_n=0.0)
    for pulse, start in zip(find_pulses(force, 2048.0), starts, strict=True):
        sampled = force[start : start + 20].max()
        assert sampled <= pulse.peak_force_n < 1.05 * sampled


def test_the_peak_of_a_short_pulse_does_not_depend_on_where_its_samples_fall() -> None:
    """A Gaussian of 1000 N whose band ends below half the rate: its samples miss up to 16 %."""
    time = np.arange(2048.0)
    found = []
    for late in np.linspace(0, 1, 9):
        force = 1000 * np.exp(-(((time - 700 - late) / 0.85) ** 2) / 2)
        found.append(find_pulses(force, 400.0)[0].peak_force_n)
    np.testing.assert_allclose(found, 1000, rtol=0.03)


def test_a_hammer_wired_the_wrong_way_round_still_hits() -> None:
    force, starts = _force()
    assert [p.start for p in find_pulses(-force, 2048.0)] == [
        p.start for p in find_pulses(force, 2048.0)
    ]
    assert len(starts) == 4


def test_a_hit_on_the_first_sample_is_found() -> None:
    force = np.concatenate((half_sine(25_600, 80.0, 0.0003), np.zeros(20_000)))
    force += 0.05 * np.random.default_rng(1).standard_normal(len(force))
    assert [pulse.start for pulse in find_pulses(force, 25_600.0)] == [0]


def test_slow_drift_of_the_force_sensor_is_not_a_hit() -> None:
    time = np.arange(8192) / 1024
    drift = 40 * np.sin(0.9 * time) + 0.1 * np.random.default_rng(2).standard_normal(8192)
    assert find_pulses(drift, 1024.0) == []


def test_noise_and_machines_are_not_hits() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(16_384) / 1024
    assert find_pulses(rng.standard_normal(16_384), 1024.0) == []
    assert (
        find_pulses(5 * np.sin(2 * np.pi * 50 * time) + rng.standard_normal(16_384), 1024.0) == []
    )
    assert find_pulses(np.zeros(1000), 1024.0) == []
    assert find_pulses(np.full(1000, np.nan), 1024.0) == []


def test_a_soft_knock_among_hard_hits_is_not_a_hit() -> None:
    force, starts = _force()
    force[starts[1] + 3000 : starts[1] + 3010] += 0.05 * force.max()
    assert len(find_pulses(force, 2048.0)) == len(starts)


@pytest.mark.parametrize("after_s", [0.7, 2.0])
def test_a_weak_blow_after_the_swing_ends_the_ring_down_and_is_no_second_blow(
    after_s: float,
) -> None:
    force, starts = _force()
    hit = find_pulses(_struck_again(force, starts[2], 0.05, after_s), 2048.0)[2]
    assert (hit.start, hit.second_peak) == (pytest.approx(starts[2], abs=1), 0.0)
    assert 0 < starts[2] + after_s * 2048 - hit.stop < 0.02 * 2048


@pytest.mark.parametrize("share", [0.04, 0.3, 1.5])
@pytest.mark.parametrize("after_s", [0.015, 0.06, 0.4])
def test_a_second_strike_of_the_same_swing_is_seen(share: float, after_s: float) -> None:
    force, starts = _force()
    double_hits = [
        p.second_peak > 0
        for p in find_pulses(_struck_again(force, starts[2], share, after_s), 2048.0)
    ]
    assert double_hits == [False, False, True, False]


@pytest.mark.parametrize("factor", [4, 8, 16, 32, 64])
def test_the_ringing_of_an_anti_aliasing_filter_is_not_a_second_strike(factor: int) -> None:
    """Hits sampled at 16384 Hz, filtered sharply and thinned to 4096 ... 256 Hz."""
    for seed in range(16):
        fine, _ = _force(16_384.0, hits=3, noise_n=0.0, seed=seed)
        taps = firwin(40 * factor + 1, 0.95 / factor)
        thin = lfilter(taps, [1.0], fine)[seed * factor // 16 :: factor]
        thin += 0.1 * np.random.default_rng(seed).standard_normal(len(thin))
        pulses = find_pulses(thin, 16_384.0 / factor)
        assert [pulse.second_peak for pulse in pulses] == [0.0, 0.0, 0.0]
