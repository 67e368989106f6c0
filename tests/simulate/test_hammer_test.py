from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.signal import hilbert

from shm.errors import UsageError
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.values import ComplexArray, FloatArray, Hanger, Recording
from tests.worlds.simulated.elements import natural_frequencies, plane_modes

STATE = HangerState(711e3, 1e7, 1e6, 1e7, 1e8)
QUIET = HammerPlan(
    hits=1, acceleration_noise_m_s2=0, force_noise_n=0, adc_bits=32, acceleration_range_m_s2=50,
    peak_force_scatter=0, hit_time_scatter_s=0,
)  # fmt: skip


def simulate(hanger: Hanger, state: HangerState, plan: HammerPlan, seed: int = 1) -> Recording:
    return hammer_test(hanger, state, plan, np.random.default_rng(seed))


def accelerance(recording: Recording, channel: int) -> tuple[FloatArray, ComplexArray]:
    assert recording.force is not None
    force = np.fft.rfft(recording.force.values)
    response = np.fft.rfft(recording.accelerations[channel].values)
    return np.fft.rfftfreq(recording.samples, 1 / recording.sampling_rate_hz), response / force


def test_a_test_has_force_and_two_channels_a_sensor_over_all_hits(hanger: Hanger) -> None:
    when = datetime(2026, 5, 1, 10, tzinfo=UTC)
    recording = hammer_test(
        hanger, STATE, HammerPlan(), np.random.default_rng(1),
        time=when, temperature_c=12.0, source="s",
    )  # fmt: skip
    assert (recording.hanger, recording.time, recording.temperature_c) == (3, when, 12.0)
    assert recording.source == "s"
    assert recording.duration_s == 100.0
    names = [(c.name, c.quantity, c.plane, round(c.x_m, 9)) for c in recording.channels]
    assert names == [
        ("force", "force", None, 1.92),
        ("acc_1", "acceleration", "transverse", 2.52),
        ("acc_2", "acceleration", "longitudinal", 2.52),
        ("acc_3", "acceleration", "transverse", 4.44),
        ("acc_4", "acceleration", "longitudinal", 4.44),
    ]


@pytest.mark.parametrize("rate", [512.0, 2048.0])
def test_response_over_force_is_the_accelerance_of_the_modes(hanger: Hanger, rate: float) -> None:
    """H = -w^2 sum of phi_s phi_h / (w_n^2 - w^2 + 2 i zeta w_n w), times the plane's share."""
    state = replace(STATE, damping_ratio=0.02)
    recording = simulate(hanger, state, replace(QUIET, sampling_rate_hz=rate))
    modes = plane_modes(hanger, state, "transverse", 60)
    hammer, sensor = modes.at(np.array([1.92, 2.52]))
    frequency, found = accelerance(recording, 0)
    band = (frequency > 3) & (frequency < 200)
    w, wn = 2 * np.pi * frequency[band, None], modes.angular_frequency_rad_s
    terms = -(w**2) * hammer * sensor / (wn**2 - w**2 + 2j * 0.02 * wn * w)
    exact = terms.sum(axis=1) * math.cos(math.pi / 4)
    assert np.abs(found[band] - exact).max() < 1e-3 * np.abs(exact).max()


def test_free_vibration_decays_at_the_given_damping_ratio(hanger: Hanger) -> None:
    """One mode alone (a sensor record band-passed around it) falls as exp(-zeta w t)."""
    state, plan = replace(STATE, damping_ratio=0.003), replace(QUIET, seconds_per_hit=30.0)
    recording = simulate(hanger, state, plan)
    for order, planted in enumerate(natural_frequencies(hanger, state, 3)[0]):
        values = recording.accelerations[0].values
        lines = np.fft.rfftfreq(len(values), 1 / 512)
        spectrum = np.fft.rfft(values) * np.exp(-0.5 * ((lines - planted) / 0.6) ** 2)
        envelope = np.log(np.abs(hilbert(np.fft.irfft(spectrum))))
        seconds = np.arange(len(values)) / 512
        window = (seconds > 2) & (seconds < 12)
        rate = -np.polyfit(seconds[window], envelope[window], 1)[0]
        assert rate / (2 * np.pi * planted) == pytest.approx(0.003, rel=0.01), order


def test_the_noise_has_the_level_that_was_asked_for(hanger: Hanger) -> None:
    plan = replace(QUIET, pre_trigger_s=15.0, acceleration_noise_m_s2=0.01, force_noise_n=3.0)
    recording = simulate(hanger, STATE, plan)
    before = slice(0, 14 * 512)  # at rest, but for noise
    assert recording.force is not None
    assert recording.force.values[before].std() == pytest.approx(3.0, rel=0.05)
    for channel in recording.accelerations:
        assert channel.values[before].std() == pytest.approx(0.01, rel=0.05)


def test_a_hit_beyond_the_range_is_clipped(hanger: Hanger) -> None:
    plan = replace(HammerPlan(), force_range_n=800.0, acceleration_range_m_s2=2.0)
    recording = simulate(hanger, STATE, plan)
    for channel in recording.channels:
        limit = 800.0 if channel.quantity == "force" else 2.0
        assert np.abs(channel.values).max() == pytest.approx(limit, rel=1e-5)
        assert np.sum(np.abs(channel.values) > 0.999 * limit) >= 5


@pytest.mark.parametrize(
    ("state", "plan", "words"),
    [
        (STATE, HammerPlan(hits=0), "at least one hit"),
        (STATE, HammerPlan(sensors_x_m=(2.0, 12.5)), "between 0 and 12 m"),
        (STATE, HammerPlan(hammer_x_m=-1.0), "between 0 and 12 m"),
        (replace(STATE, length_m=3.0), HammerPlan(), "between 0 and 3 m"),
        (STATE, HammerPlan(sampling_rate_hz=0.0), "positive"),
        (STATE, HammerPlan(seconds_per_hit=0.3), "within its own seconds"),
        (STATE, HammerPlan(acceleration_noise_m_s2=-1.0), "noise"),
        (STATE, HammerPlan(adc_bits=1), "bits"),
        (replace(STATE, tension_n=math.nan), HammerPlan(), "tension"),
        (replace(STATE, damping_ratio=1.0), HammerPlan(), "damping"),
        (replace(STATE, k2_n_m_rad=-1.0), HammerPlan(), "springs"),
        (replace(STATE, length_m=-3.0), HammerPlan(), "length"),
    ],
)
def test_a_state_or_plan_that_cannot_be_is_refused(
    hanger: Hanger, state: HangerState, plan: HammerPlan, words: str
) -> None:
    with pytest.raises(UsageError, match=words):
        simulate(hanger, state, plan)
