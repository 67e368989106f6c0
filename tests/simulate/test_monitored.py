"""A bridge that lives: frequencies are those of the planted tension, chunks have no seam."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
import scipy

from shm.simulate import HangerState
from shm.simulate.ambient import Loss, MonitoringPlan, Weather, described_stream, streamed
from shm.values import Hanger
from tests.worlds.simulated.elements import natural_frequencies

START = datetime(2026, 6, 1, 12, tzinfo=UTC)
QUIET = MonitoringPlan(trains_a_day=0.0, knocks_a_day=0.0, per_kelvin=0.0)


def samples(hanger: Hanger, plan: MonitoringPlan, seconds: float, seed: int = 5) -> np.ndarray:
    chunks = streamed(hanger, described_stream(hanger), plan, START, seconds, seed)
    return np.concatenate([chunk.values for chunk in chunks], axis=1).astype(float)


def first_peak_hz(values: np.ndarray) -> float:
    """By the centre of the power within 0.1 Hz of the first mode's peak."""
    frequency_hz, power = scipy.signal.welch(values, 200.0, nperseg=24_000)
    near = (frequency_hz > 4.5) & (frequency_hz < 6.5)
    summed = np.where(near, power.sum(axis=0), 0.0)
    close = np.abs(frequency_hz - frequency_hz[summed.argmax()]) < 0.1
    return float((summed * frequency_hz)[close].sum() / summed[close].sum())


def test_the_spectrum_peaks_at_the_natural_frequency_of_the_planted_tension(hanger: Hanger) -> None:
    expected_hz = natural_frequencies(hanger, HangerState(711e3), 1).mean(axis=0)[0]
    # The planes lie 0.4 % apart.
    found_hz = first_peak_hz(samples(hanger, QUIET, 1200))
    assert found_hz == pytest.approx(expected_hz * 1.002, rel=0.002)


def test_a_loss_of_tension_lowers_the_frequency_as_a_beam_in_tension_has_it(hanger: Hanger) -> None:
    lost = MonitoringPlan(
        trains_a_day=0.0, knocks_a_day=0.0, per_kelvin=0.0, losses=(Loss(3, 0.1, START),)
    )
    before, after = (natural_frequencies(hanger, HangerState(t), 1)[0, 0] for t in (711e3, 639.9e3))
    ratio = first_peak_hz(samples(hanger, lost, 1200)) / first_peak_hz(samples(hanger, QUIET, 1200))
    assert ratio == pytest.approx(after / before, rel=0.002)


def test_the_same_seed_gives_the_same_samples_however_they_are_cut(hanger: Hanger) -> None:
    assert np.array_equal(samples(hanger, QUIET, 120), samples(hanger, QUIET, 120))
    assert not np.array_equal(samples(hanger, QUIET, 120), samples(hanger, QUIET, 120, seed=6))


def test_summer_is_warmer_than_winter_and_the_weather_is_the_same_for_all() -> None:
    weather, again = (Weather(7, QUIET) for _ in range(2))
    days = [START + timedelta(hours=n) for n in range(0, 24 * 20, 7)]
    winter = [day - timedelta(days=150) for day in days]
    summer_c = np.mean([weather.temperature_c(day) for day in days])
    assert summer_c > 8 + np.mean([weather.temperature_c(day) for day in winter])
    assert [weather.wind_m_s(day) for day in days] == [again.wind_m_s(day) for day in days]
