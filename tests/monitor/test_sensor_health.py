"""Faults of sensors that stay, planted one at a time."""

from __future__ import annotations

import numpy as np
import pytest

from shm.monitor import offsets, sensor_faults
from shm.values import FloatArray
from tests.helpers.ambient_stream import Motion, drawn, piece, stream, values

RNG = np.random.default_rng(1)
MOTION: Motion = drawn(RNG, orders=4)
SAMPLES: FloatArray = values(MOTION, RNG, 300.0)
EARLIER = [
    {channel.name: 0.01 + 1e-4 * float(RNG.normal()) for channel in stream().channels}
    for _ in range(12)
]


def _dead(samples: FloatArray) -> FloatArray:
    samples[1] = 0.3
    return samples


def _saturated(samples: FloatArray) -> FloatArray:
    samples[2, ::200] = 20.0
    return samples


def _drifted(samples: FloatArray) -> FloatArray:
    samples[3] += 0.05
    return samples


def _crossed(samples: FloatArray) -> FloatArray:
    return samples[[1, 0, 2, 3]]


def _turned(samples: FloatArray) -> FloatArray:
    samples[2] *= -1
    return samples


@pytest.mark.parametrize(
    ("fault", "kind", "channel", "detail"),
    [
        (_dead, "dead", "l0", "never changes (0.31 m/s^2)"),
        (_saturated, "saturated", "t1", "0.5% of its samples are at full scale"),
        (_drifted, "drifting", "l1", "+0.05 from its median before"),
        (_crossed, "swapped", "t", "are exchanged (that explains 1.00"),
        (_turned, "swapped", "t", "has the opposite sign"),
    ],
)
def test_a_fault_is_told_with_its_channel(
    fault: object, kind: str, channel: str, detail: str
) -> None:
    assert callable(fault)
    samples = fault(SAMPLES.copy()) + 0.01
    (event,) = sensor_faults([piece(samples)], stream(), MOTION.known(), EARLIER)
    assert event.kind == kind
    assert event.channel.startswith(channel)
    assert detail in event.detail
    assert (event.end - event.start).total_seconds() == 300


def test_sound_sensors_are_not_accused() -> None:
    now = [piece(SAMPLES + 0.01)]
    assert sensor_faults(now, stream(), MOTION.known(), EARLIER) == ()
    assert sensor_faults(now, stream(), (), ()) == ()
    assert sensor_faults([], stream(), (), ()) == ()


def test_offsets_are_medians_and_know_of_no_samples() -> None:
    samples = SAMPLES + 0.02
    samples[0] = np.nan
    found = offsets([piece(samples)])
    assert set(found) == {"l0", "t1", "l1"}
    assert found["l1"] == pytest.approx(0.02, abs=1e-3)
