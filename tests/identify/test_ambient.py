"""A hanger that wind moves: white noise on each mode, no hammer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shm.errors import NotIdentifiable
from shm.identify import Identification, IdentifyOptions, identify
from shm.identify.measuring.ambient import ambient_measurement
from shm.values import Recording
from tests.identify.planted import with_samples
from tests.identify.signals import Planted, Sensor, as_recording, response

RATE_HZ = 128.0
OPTIONS = IdentifyOptions(3.0, 40.0)
MODES = (
    Planted(6.0, 0.004, (1.0, 0.2, 0.6)),
    Planted(6.3, 0.004, (-0.2, 1.0, -0.1)),
    Planted(13.5, 0.003, (0.8, 0.1, -0.7)),
    Planted(23.0, 0.003, (0.1, -0.9, 0.1)),
)
SENSORS = (Sensor("transverse", 2.0), Sensor("longitudinal", 2.0), Sensor("transverse", 3.5))


def record_of(
    modes: tuple[Planted, ...] = MODES, seconds: float = 900.0, seed: int = 0, noise: float = 0.02
) -> Recording:
    """Return a record of modes that wind moves, each by a noise of its own."""
    rng = np.random.default_rng(seed)
    samples = round(seconds * RATE_HZ)
    total = np.zeros((3, samples))
    for mode in modes:
        wind = rng.standard_normal(samples)
        total += response([mode], wind, RATE_HZ) - np.outer(mode.shape, wind)
    total += noise * np.std(total) * rng.standard_normal(total.shape)
    record = as_recording(np.zeros(samples), total, RATE_HZ, SENSORS)
    return replace(record, channels=record.channels[1:])


RECORD = record_of()


@pytest.fixture(scope="module")
def identified() -> Identification:
    return identify([RECORD], OPTIONS, test_id="wind")


def test_what_needs_a_hit_is_unknown(identified: Identification) -> None:
    assert identified.frequency_response is None
    assert identified.fit is None
    assert identified.hits == ()
    assert np.isnan(identified.test.amplitude)
    assert all(np.isnan(mode.acceleration_m_s2) for mode in identified.test.modes)


def test_a_dead_or_mostly_unknown_channel_is_dropped() -> None:
    for value, reason in ((0.3, "never changes"), (np.nan, "not-a-number")):
        record = with_samples("acc_3", slice(None), value, RECORD)
        measurement = ambient_measurement([record], OPTIONS)
        assert [point.name for point in measurement.points] == ["acc_1", "acc_2"]
        assert reason in measurement.dropped[0].reason


def test_a_short_record_is_not_identifiable_and_says_how_long_it_must_be() -> None:
    with pytest.raises(NotIdentifiable, match="too short") as caught:
        identify([record_of(seconds=20.0)], OPTIONS, test_id="t")
    assert "minutes" in caught.value.remedy


def test_set_ups_are_joined_by_the_sensor_that_they_share() -> None:
    """Sensors 1 and 2, then 1 and 3: three points of one shape."""
    parts = [
        replace(record, channels=(record.channels[0], record.channels[row]))
        for row, record in ((1, RECORD), (2, record_of(seed=1)))
    ]
    result = identify(parts, OPTIONS, test_id="t")
    assert any("sensors that they share" in note for note in result.notes)
    (mode,) = [m for m in result.test.modes if abs(m.frequency_hz - 13.5) < 0.1]
    values = {point.x_m: point.value for point in mode.shape}
    assert values[3.5] / values[2.0] == pytest.approx(-0.7 / 0.8, abs=0.03)
