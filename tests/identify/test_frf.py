from __future__ import annotations

import math

import numpy as np
import pytest

from shm.identify import IdentifyOptions, identify
from shm.identify.measuring.frf import (
    END_LEVEL,
    AveragedResponse,
    HitRecord,
    Window,
    averaged_response,
)
from shm.identify.measuring.hits import find_pulses
from shm.values import FrequencyResponse, Recording, ResponsePoint
from tests.identify.signals import Planted, Sensor, recording

RATE_HZ = 1024.0
MODES = (Planted(12.0, 0.02, (1.0,)), Planted(31.0, 0.02, (-0.5,)))


def _average(record: Recording) -> AveragedResponse:
    return averaged_response(_hits(record), record.sampling_rate_hz, 60.0)


def _hits(record: Recording) -> list[HitRecord]:
    force = record.force
    assert force is not None
    signals = np.array([channel.values for channel in record.accelerations])
    return [
        HitRecord(force.values, signals, pulse)
        for pulse in find_pulses(force.values, record.sampling_rate_hz)
    ]


def _record(modes: tuple[Planted, ...] = MODES, **changes: float) -> Recording:
    keywords = {"hits": 4, "seconds": 8.0, "rate_hz": RATE_HZ, **changes}
    return recording(modes, (Sensor(),), **keywords)  # type: ignore[arg-type]


def _accelerance(frequency_hz: np.ndarray) -> np.ndarray:
    """-w^2 sum phi / (w_r^2 - w^2 + 2 i zeta w_r w) for unit modal mass."""
    omega = 2 * np.pi * frequency_hz[:, np.newaxis]
    natural = 2 * np.pi * np.array([mode.frequency_hz for mode in MODES])
    damping = np.array([mode.damping_ratio for mode in MODES])
    shape = np.array([mode.shape[0] for mode in MODES])
    modal = shape / (natural**2 - omega**2 + 2j * damping * natural * omega)
    return np.asarray(-(omega[:, 0] ** 2) * modal.sum(axis=1))


def test_h1_is_the_accelerance_of_the_planted_modes() -> None:
    average = _average(_record())
    band = (average.frequency_hz > 5) & (average.frequency_hz < 40)
    expected = _accelerance(average.frequency_hz[band])
    error = np.abs(average.accelerance[0, band] - expected)
    assert np.max(error) < 0.02 * np.max(np.abs(expected))


def test_coherence_is_one_without_noise_and_falls_with_it() -> None:
    clean, noisy = _average(_record()), _average(_record(noise=150.0))
    assert clean.coherence is not None
    assert noisy.coherence is not None
    assert np.all(clean.coherence[0, 40:300] > 0.999)
    assert np.median(noisy.coherence[0, 40:300]) < 0.9


def test_a_long_ring_down_is_brought_to_a_hundredth_by_its_window() -> None:
    slow = (Planted(12.0, 0.001, (1.0,)),)
    average = _average(_record(slow, hits=1))
    own = math.exp(-0.001 * 2 * math.pi * 12.0 * 7.0)
    window = math.exp(-7.7 / average.window_time_constant_s)
    assert own * window == pytest.approx(END_LEVEL, rel=0.15)


def test_the_window_adds_just_the_damping_that_its_time_constant_says() -> None:
    """Identified from its windowed response and told the window, a mode has its own damping."""
    slow = (Planted(12.0, 0.001, (1.0,)),)
    average = _average(_record(slow, hits=1, seconds=20.0))
    tau = average.window_time_constant_s
    response = FrequencyResponse(
        "windowed", (ResponsePoint("a"),), average.frequency_hz, average.accelerance
    )
    (mode,) = identify([response], IdentifyOptions(2.0, 60.0), test_id="t").test.modes
    assert mode.damping_ratio == pytest.approx(0.001 + 1 / (2 * np.pi * 12.0 * tau), rel=0.03)
    told = IdentifyOptions(2.0, 60.0, window_time_constant_s=tau)
    (mode,) = identify([response], told, test_id="t").test.modes
    assert mode.damping_ratio == pytest.approx(0.001, rel=0.05)


@pytest.mark.parametrize("estimator", ["h1", "h2", "hv"])
def test_the_window_shifts_the_accelerance_alike_in_every_estimator(estimator: str) -> None:
    """An exponential window of time constant tau turns H(s) into H(s + 1/tau) (closed form)."""
    slow = Planted(12.0, 0.002, (1.0,))
    record = _record((slow,), hits=1, seconds=20.0)
    force = record.channels[0].values
    signals = np.array([channel.values for channel in record.accelerations])
    hits = [HitRecord(force, signals, pulse) for pulse in find_pulses(force, RATE_HZ)]
    window = Window(20, 19 * 1024, 2.0)
    average = averaged_response(hits, RATE_HZ, 60.0, estimator, window)
    s = 2j * np.pi * average.frequency_hz + 1 / 2.0
    omega = 2 * np.pi * slow.frequency_hz
    expected = s**2 / (s**2 + 2 * slow.damping_ratio * omega * s + omega**2)
    band = (average.frequency_hz > 5) & (average.frequency_hz < 30)
    error = np.abs(average.accelerance[0] - expected)[band]
    assert np.max(error) < 0.02 * np.max(np.abs(expected))
