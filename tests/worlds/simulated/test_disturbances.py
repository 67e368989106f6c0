"""Each disturbance changes what it says, where it says, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import find_peaks

from shm.errors import UsageError
from shm.simulate import HammerPlan, HangerState
from shm.values import FloatArray, Hanger
from tests.helpers.comparing import assert_same
from tests.worlds.simulated.disturbances.base import Planted
from tests.worlds.simulated.disturbances.registry import DISTURBANCES
from tests.worlds.simulated.elements import natural_frequencies
from tests.worlds.simulated.hammer import SimulatedTest, simulated_test

STATE = HangerState(711e3, 1e7, 1e6, 1e7, 1e8)
PLAN = HammerPlan(hits=4, seconds_per_hit=5.0, acceleration_noise_m_s2=0.001)
RATE = PLAN.sampling_rate_hz
SEEDS = (1, 2, 3, 4)


@cache
def simulate(hanger: Hanger, *disturbances: str, seed: int = 1) -> SimulatedTest:
    rng = np.random.default_rng(seed)
    return simulated_test(hanger, STATE, PLAN, rng, disturbances=disturbances)


def planted(made: SimulatedTest) -> Planted:
    (only,) = made.planted
    return only


def changed(made: SimulatedTest, plain: SimulatedTest) -> dict[str, FloatArray]:
    """The samples of each channel that differ; channels that do not are left out."""
    pairs = zip(made.recording.channels, plain.recording.channels, strict=True)
    places = {a.name: np.flatnonzero(~(a.values == b.values)) for a, b in pairs}
    return {name: found for name, found in places.items() if len(found)}


def slots(places: FloatArray) -> set[int]:
    """Hits in whose seconds the samples lie."""
    return set((places // PLAN.samples_per_hit).tolist())


def amplitude(values: FloatArray, frequency_hz: float) -> float:
    """Of a steady line in a signal, by projection under a Hann window."""
    window = np.hanning(len(values))
    turns = np.exp(-2j * np.pi * frequency_hz * np.arange(len(values)) / RATE)
    return float(2 * abs(np.sum(window * turns * values)) / np.sum(window))


@pytest.mark.parametrize("name", DISTURBANCES)
def test_the_same_generator_gives_the_same_record_and_truth(hanger: Hanger, name: str) -> None:
    first = simulate(hanger, name)
    again = simulated_test(hanger, STATE, PLAN, np.random.default_rng(1), disturbances=[name])
    assert_same(first.planted, again.planted)
    assert first.strikes == again.strikes
    for one, other in zip(first.recording.channels, again.recording.channels, strict=True):
        np.testing.assert_array_equal(one.values, other.values)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_a_disturbance_is_told_by_its_name_and_changes_the_record(
    hanger: Hanger, name: str
) -> None:
    made, plain = simulate(hanger, name), simulate(hanger)
    assert planted(made).disturbance == name
    shorter = made.recording.samples < plain.recording.samples
    assert shorter or changed(made, plain)
    assert DISTURBANCES[name].help


@pytest.mark.parametrize("name", DISTURBANCES)
def test_before_the_first_hit_that_is_disturbed_nothing_differs(hanger: Hanger, name: str) -> None:
    """Noise and earlier hits are those of the sound test."""
    made, plain = simulate(hanger, name), simulate(hanger)
    if not planted(made).hits or made.recording.samples < plain.recording.samples:
        pytest.skip("in all of the record, or the record is cut")
    quiet = int((plain.strikes[planted(made).hits[0]].start_s - 0.1) * RATE)
    for one, other in zip(made.recording.channels, plain.recording.channels, strict=True):
        np.testing.assert_array_equal(one.values[:quiet], other.values[:quiet])


@pytest.mark.parametrize("seed", SEEDS)
def test_a_bouncing_hammer_strikes_again_and_the_hanger_answers(hanger: Hanger, seed: int) -> None:
    made, plain = simulate(hanger, "double_hit", seed=seed), simulate(hanger, seed=seed)
    (hit,) = planted(made).hits
    strike = made.strikes[hit]
    first, second = strike.hits
    assert 0.015 <= second.start_s - first.start_s <= 0.2
    assert 0.1 <= second.peak_n / first.peak_n <= 0.6
    later = int((second.start_s - 0.1) * RATE)  # the logger's filter is 0.06 s long
    for name, places in changed(made, plain).items():
        assert places[0] > later, name
    assert set(changed(made, plain)) == {channel.name for channel in plain.recording.channels}
    force, usual = made.recording.force, plain.recording.force
    assert force is not None
    assert usual is not None
    impulse = np.sum(force.values - usual.values) / RATE
    assert impulse == pytest.approx(2 / math.pi * second.peak_n * second.seconds, rel=0.02)


@pytest.mark.parametrize(
    ("name", "quantity"), [("clipping", "acceleration"), ("overload", "force")]
)
def test_a_saturated_channel_has_flat_tops_and_is_untouched_below(
    hanger: Hanger, name: str, quantity: str
) -> None:
    made, plain = simulate(hanger, name), simulate(hanger)
    (channel,) = planted(made).channels
    differing = changed(made, plain)
    assert set(differing) == {channel}
    (values,) = (c.values for c in made.recording.channels if c.name == channel)
    (found,) = (c.quantity for c in made.recording.channels if c.name == channel)
    assert found == quantity
    limit = np.abs(values).max()
    np.testing.assert_array_equal(np.abs(values[differing[channel]]), limit)
    assert set(planted(made).hits) == slots(differing[channel])


@pytest.mark.parametrize("seed", SEEDS)
def test_a_bad_cable_disturbs_one_accelerometer_after_the_hits_it_names(
    hanger: Hanger, seed: int
) -> None:
    made, plain = simulate(hanger, "cable", seed=seed), simulate(hanger, seed=seed)
    (channel,) = planted(made).channels
    differing = changed(made, plain)
    assert set(differing) == {channel}
    assert channel.startswith("acc_")
    first = {hit: int(plain.strikes[hit].start_s * RATE) for hit in planted(made).hits}
    assert slots(differing[channel]) >= set(planted(made).hits)
    assert differing[channel][0] > min(first.values())


def test_lost_samples_are_not_a_number_or_repeated_in_one_channel(hanger: Hanger) -> None:
    kinds = set()
    for seed in range(8):
        made, plain = simulate(hanger, "drop_out", seed=seed), simulate(hanger, seed=seed)
        ((channel, places),) = changed(made, plain).items()
        assert planted(made).channels == (channel,)
        assert slots(places) == set(planted(made).hits)
        (values,) = (c.values for c in made.recording.channels if c.name == channel)
        gap = values[places[0] - 1 : places[-1] + 1]
        frozen = bool(np.ptp(gap) == 0)
        assert frozen or np.all(np.isnan(gap[1:]))
        assert 8 <= len(gap) <= 0.5 * RATE + 1
        kinds.add(frozen)
    assert kinds == {True, False}


def test_without_pre_trigger_the_record_begins_within_the_pulse(hanger: Hanger) -> None:
    made, plain = simulate(hanger, "no_pre_trigger"), simulate(hanger)
    missing = plain.recording.samples - made.recording.samples
    first = plain.strikes[0]
    assert first.start_s <= missing / RATE <= first.start_s + first.seconds
    assert made.strikes[0].start_s == pytest.approx(first.start_s - missing / RATE)
    for one, other in zip(made.recording.channels, plain.recording.channels, strict=True):
        np.testing.assert_array_equal(one.values, other.values[missing:])


def test_a_ring_down_is_cut_by_the_end_of_the_record_or_by_the_next_hit(hanger: Hanger) -> None:
    kinds = set()
    for seed in range(8):
        made, plain = simulate(hanger, "cut_off", seed=seed), simulate(hanger, seed=seed)
        (hit,) = planted(made).hits
        starts = [strike.start_s for strike in made.strikes]
        stop = starts[hit + 1] if hit < 3 else made.recording.duration_s
        assert 0.59 < stop - starts[hit] < 0.61
        assert (made.recording.samples < plain.recording.samples) == (hit == 3)
        kinds.add(hit == 3)
    assert kinds == {True, False}


def test_a_soft_hit_leaves_the_upper_band_without_force(hanger: Hanger) -> None:
    made, plain = simulate(hanger, "soft_hit"), simulate(hanger)
    spectra = []
    for test in (made, plain):
        assert test.recording.force is not None
        spectra.append(np.abs(np.fft.rfft(test.recording.force.values)))
    lines = np.fft.rfftfreq(made.recording.samples, 1 / RATE)
    upper, lower = (lines > 75) & (lines < 100), lines < 5
    soft, hard = (np.median(s[upper]) / np.median(s[lower]) for s in spectra)
    assert soft < 0.1
    assert hard > 0.6
    assert planted(made).hits == (0, 1, 2, 3)


def test_mains_hum_in_all_channels_at_fifty_hertz_and_its_harmonics(hanger: Hanger) -> None:
    made, plain = simulate(hanger, "mains"), simulate(hanger)
    assert planted(made).frequency_hz == pytest.approx(50, abs=0.06)
    pairs = zip(made.recording.channels, plain.recording.channels, strict=True)
    for disturbed, usual in pairs:
        hum = disturbed.values - usual.values
        lines = [amplitude(hum, k * planted(made).frequency_hz) for k in (1, 2, 3, 4)]
        level = np.std(usual.values)
        assert 0.01 * level < lines[0] < 0.21 * level
        assert lines[1] > 0.05 * lines[0]
        assert lines[2] > 0.05 * lines[0]
        assert lines[3] < 0.01 * lines[0]


def test_a_machine_is_one_steady_line_in_the_accelerations_alone(hanger: Hanger) -> None:
    made, plain = simulate(hanger, "machine"), simulate(hanger)
    frequency = planted(made).frequency_hz
    assert abs(frequency - 50) > 3
    differing = changed(made, plain)
    assert set(differing) == set(planted(made).channels) == {"acc_1", "acc_2", "acc_3", "acc_4"}
    for disturbed, usual in zip(
        made.recording.accelerations, plain.recording.accelerations, strict=True
    ):
        added = disturbed.values - usual.values
        assert np.std(added) * math.sqrt(2) == pytest.approx(amplitude(added, frequency), rel=0.02)


@pytest.mark.parametrize("seed", range(6))
def test_an_outlier_hit_has_another_place_direction_or_damping(hanger: Hanger, seed: int) -> None:
    made, plain = simulate(hanger, "outlier_hit", seed=seed), simulate(hanger, seed=seed)
    (hit,) = planted(made).hits
    odd, usual = made.strikes[hit], plain.strikes[hit]
    differing = [
        abs(odd.x_m - usual.x_m) > 1.0,
        abs(odd.angle_deg - usual.angle_deg) >= 60,
        odd.damping_ratio > STATE.damping_ratio,
    ]
    assert sum(differing) == 1
    assert (odd.start_s, odd.peak_n) == (usual.start_s, usual.peak_n)
    assert "force" not in changed(made, plain)


def test_a_held_hanger_loses_its_vibration_sooner(hanger: Hanger) -> None:
    held = next(
        made
        for made in (simulate(hanger, "outlier_hit", seed=seed) for seed in range(6))
        if made.strikes[planted(made).hits[0]].damping_ratio > 0
    )
    (hit,) = planted(held).hits
    parts = held.recording.accelerations[0].values.reshape(PLAN.hits, -1)
    late = np.std(parts[:, -512:], axis=1)
    assert late[hit] < 0.3 * late.max()


def test_with_noise_only_nothing_stands_out(hanger: Hanger) -> None:
    made = simulate(hanger, "noise_only")
    assert made.strikes == ()
    for channel in made.recording.channels:
        noise = PLAN.force_noise_n if channel.quantity == "force" else PLAN.acceleration_noise_m_s2
        assert np.std(channel.values) == pytest.approx(noise, rel=0.05)
        assert np.abs(channel.values).max() < 6 * noise


def test_the_harmonic_of_a_mode_rings_at_twice_its_frequency(hanger: Hanger) -> None:
    made, plain = simulate(hanger, "harmonic"), simulate(hanger)
    own = natural_frequencies(hanger, STATE, 6)
    assert np.abs(planted(made).frequency_hz / (2 * own) - 1).min() < 1e-6
    added = made.recording.accelerations[0].values - plain.recording.accelerations[0].values
    if not np.abs(added).max():
        added = made.recording.accelerations[1].values - plain.recording.accelerations[1].values
    lines = np.fft.rfftfreq(len(added), 1 / RATE)
    peak = lines[np.abs(np.fft.rfft(added)).argmax()]
    assert peak == pytest.approx(planted(made).frequency_hz, abs=0.1)
    assert np.abs(added).max() <= 1.05 * planted(made).acceleration_m_s2


def test_the_deck_moves_all_sensors_as_one_rigid_swing(hanger: Hanger) -> None:
    """About the arch end: in proportion to the distance from it."""
    made, plain = simulate(hanger, "deck"), simulate(hanger)
    own = natural_frequencies(hanger, STATE, 6)
    assert np.abs(planted(made).frequency_hz / own - 1).min() > 0.02
    assert own.min() < planted(made).frequency_hz < own.max()
    pairs = zip(made.recording.accelerations, plain.recording.accelerations, strict=True)
    added = {(a.plane, a.x_m): a.values - b.values for a, b in pairs}
    (low, high) = PLAN.sensor_places_m(hanger)
    upper, lower = added["transverse", high], added["transverse", low]
    ratio = np.dot(upper, lower) / np.dot(lower, lower)
    assert ratio == pytest.approx((hanger.length_m - high) / (hanger.length_m - low), rel=1e-3)
    spectrum = np.abs(np.fft.rfft(lower))
    peaks, _ = find_peaks(spectrum, height=0.5 * spectrum.max())
    lines = np.fft.rfftfreq(len(lower), 1 / RATE)[peaks]
    np.testing.assert_allclose(lines, planted(made).frequency_hz, atol=1.0)


def test_several_disturbances_go_together(hanger: Hanger) -> None:
    both = simulate(hanger, "double_hit", "mains")
    assert [each.disturbance for each in both.planted] == ["double_hit", "mains"]
    alone = simulate(hanger, "double_hit")
    assert_same(both.planted[0], alone.planted[0])


def test_an_unknown_disturbance_is_refused_with_the_known_ones(hanger: Hanger) -> None:
    with pytest.raises(UsageError, match="no disturbance") as refused:
        simulate(hanger, "gremlins")
    assert "double_hit" in str(refused.value.remedy)


def test_what_needs_hits_does_not_go_with_noise_alone(hanger: Hanger) -> None:
    with pytest.raises(UsageError, match="cable needs hits"):
        simulate(hanger, "noise_only", "cable")
    assert len(simulate(hanger, "noise_only", "machine").planted) == 2


def test_one_hit_alone_can_carry_every_disturbance(hanger: Hanger) -> None:
    plan = replace(PLAN, hits=1, seconds_per_hit=2.0, sensors_x_m=(2.0,))
    for name in DISTURBANCES:
        made = simulated_test(hanger, STATE, plan, np.random.default_rng(3), disturbances=[name])
        assert planted(made).disturbance == name
