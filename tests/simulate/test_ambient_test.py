"""A hanger in wind and traffic: stationary, with the poles and shapes of its modes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks, welch

from shm.errors import UsageError
from shm.simulate import AmbientPlan, HangerState, ambient_test, spread_places_m
from shm.values import Hanger, Recording
from tests.worlds.simulated.elements import natural_frequencies

STATE = HangerState(711e3, 1e7, 1e6, 1e7, 1e8, damping_ratio=0.01)
PLAN = AmbientPlan(seconds=200.0)


def simulate(hanger: Hanger, plan: AmbientPlan = PLAN, seed: int = 1) -> Recording:
    return ambient_test(hanger, STATE, plan, np.random.default_rng(seed))


def test_nobody_hits_so_there_is_no_force(hanger: Hanger) -> None:
    recording = simulate(hanger)
    assert recording.force is None
    assert [c.name for c in recording.channels] == ["acc_1", "acc_2", "acc_3", "acc_4"]
    assert recording.duration_s == 200.0


def test_the_spectrum_peaks_at_the_natural_frequencies_of_the_plane(hanger: Hanger) -> None:
    recording = simulate(hanger)
    for plane, own in enumerate(natural_frequencies(hanger, STATE, 5)):
        lines, density = welch(recording.accelerations[plane].values, 512, nperseg=4096)
        for frequency in own:
            near = np.abs(lines / frequency - 1) < 0.06
            peak = lines[near][density[near].argmax()]
            assert peak == pytest.approx(frequency, rel=0.02)


def test_a_mode_falls_off_with_its_own_damping(hanger: Hanger) -> None:
    """The correlation of a band-passed record decays as exp(-zeta w t)."""
    own = natural_frequencies(hanger, STATE, 1)[0, 0]
    values = simulate(hanger, AmbientPlan(seconds=1000.0)).accelerations[0].values
    lines = np.fft.rfftfreq(len(values), 1 / 512)
    spectrum = np.abs(np.fft.rfft(values)) ** 2 * np.exp(-0.5 * ((lines - own) / 0.7) ** 2)
    correlation = np.fft.irfft(spectrum)[: 5 * 512]
    peaks, _ = find_peaks(correlation)
    late = peaks[(peaks > 512) & (peaks < 3 * 512)] / 512
    rate = -np.polyfit(late, np.log(correlation[(late * 512).round().astype(int)]), 1)[0]
    assert rate / (2 * np.pi * own) == pytest.approx(0.01, rel=0.35)


def test_a_plan_that_cannot_be_is_refused(hanger: Hanger) -> None:
    with pytest.raises(UsageError, match="positive"):
        simulate(hanger, AmbientPlan(seconds=0.0))
    with pytest.raises(UsageError, match="between 0 and 12 m"):
        simulate(hanger, AmbientPlan(sensors_x_m=(13.0,)))


def test_sensors_are_spread_over_what_can_be_reached(hanger: Hanger) -> None:
    for sensors in range(1, 9):
        places = spread_places_m(hanger, sensors)
        assert len(set(places)) == sensors
        assert list(places) == sorted(places)
        assert max(places) < hanger.length_m / 2
    with pytest.raises(UsageError, match="1 to 8"):
        spread_places_m(hanger, 9)
