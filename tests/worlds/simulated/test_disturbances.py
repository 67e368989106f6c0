"""Each disturbance changes what it says, where it says, and nothing else."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.signal import find_peaks

from shm.simulate import HammerPlan, HangerState
from shm.values import FloatArray, Hanger
from tests.helpers.comparing import assert_same
from tests.worlds.simulated.disturbances.base import Planted
from tests.worlds.simulated.disturbances.registry import DISTURBANCES
from tests.worlds.simulated.elements import natural_frequencies
from tests.worlds.simulated.hammer import SimulatedTest, simulated_test

pytestmark = pytest.mark.trial  # of the simulated world alone, not of the product

STATE = HangerState(711e3, 1e7, 1e6, 1e7, 1e8)
PLAN = HammerPlan(hits=4, seconds_per_hit=5.0, acceleration_noise_m_s2=0.001)
RATE = PLAN.sampling_rate_hz


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
