"""Windows: what moved the hanger, which part is used, and what is no window at all."""

from __future__ import annotations

from datetime import timedelta

import numpy as np
import pytest

from shm.monitor.windows import judged
from shm.values import FloatArray
from tests.helpers.ambient_stream import RATE_HZ, START, Motion, drawn, piece, stream, values

SECONDS = 300.0
RNG = np.random.default_rng(3)
MOTION: Motion = drawn(RNG, orders=3)
WIND: FloatArray = values(MOTION, RNG, SECONDS)


def _ring(at_s: float, size: float, tau_s: float) -> FloatArray:
    """Return a decaying motion of the first mode that starts at once."""
    since = np.arange(WIND.shape[1]) / RATE_HZ - at_s
    hz = MOTION.frequency_hz["transverse", 1]
    ring = size * np.exp(-since / tau_s) * np.sin(2 * np.pi * hz * since)
    return np.where(since > 0, ring, 0.0)


def _train(at_s: float, seconds: float) -> FloatArray:
    since = np.arange(WIND.shape[1]) / RATE_HZ - at_s
    shape = np.exp(-0.5 * ((since - seconds / 2) / (seconds / 5)) ** 2)
    rumble = np.random.default_rng(4).normal(size=WIND.shape[1])
    return shape * (0.3 * rumble + 0.3 * np.sin(2 * np.pi * 0.4 * since))


def test_wind_is_used_as_a_whole() -> None:
    window = judged([piece(WIND)], stream(), MOTION.known()).window
    assert window.kind == "wind"
    assert window.duration_s == pytest.approx(SECONDS)
    assert window.signal_to_noise_db > 10
    assert window.temperature_c == 10.0
    assert 0 < window.unrest < 5
    inside = np.sqrt(np.mean(WIND**2))  # the noise outside of the band is small
    assert window.level_m_s2 == pytest.approx(inside, rel=0.1)


@pytest.mark.parametrize(
    ("kind", "motion"), [("knock", _ring(100.0, 0.5, 2.0)), ("traffic", _train(100.0, 15.0))]
)
def test_what_disturbs_a_part_is_set_apart_and_the_rest_is_used(
    kind: str, motion: FloatArray
) -> None:
    found = judged([piece(WIND + motion)], stream(), MOTION.known())
    assert found.window.kind == kind
    assert found.window.unrest > 5
    used = sum(part.shape[1] for part in found.parts) / RATE_HZ
    assert 0.8 * SECONDS < used < SECONDS - 3
    assert f"set apart: {kind}" in found.reason
    calm = judged([piece(WIND)], stream(), MOTION.known())
    assert found.window.level_m_s2 == pytest.approx(calm.window.level_m_s2, rel=0.1)


def test_noise_of_the_sensors_alone_is_quiet() -> None:
    noise = 2e-3 * np.random.default_rng(5).normal(size=WIND.shape)
    window = judged([piece(noise)], stream(), MOTION.known()).window
    assert window.kind == "quiet"
    assert window.signal_to_noise_db < 5


def test_a_gap_divides_a_window_and_takes_nothing_else() -> None:
    half = WIND.shape[1] // 2
    later = START + timedelta(seconds=half / RATE_HZ + 30)
    parts = [piece(WIND[:, :half]), piece(WIND[:, half:], later)]
    found = judged(parts, stream(), MOTION.known())
    assert found.window.duration_s == pytest.approx(SECONDS + 30)
    assert found.window.temperature_c == 10.0
    longer = [piece(WIND[:, : half + 1]), piece(WIND[:, half:], later, -127.0)]
    assert judged(longer, stream(), MOTION.known()).window.temperature_c == 10.0
    assert [part.shape[1] for part in found.parts] == [half, half]


@pytest.mark.parametrize(
    ("samples", "why"),
    [
        (WIND[:, : int(60 * RATE_HZ)], "less than 120 s without a gap"),
        (np.zeros_like(WIND), "no channel can be used"),
        (np.full_like(WIND, np.nan), "no channel can be used"),
    ],
)
def test_what_is_unusable_says_why(samples: FloatArray, why: str) -> None:
    found = judged([piece(samples)], stream(), MOTION.known())
    assert found.window.kind == "unusable"
    assert found.parts == ()
    assert why in found.reason


def test_a_dead_channel_does_not_cost_the_others() -> None:
    samples = WIND.copy()
    samples[1] = 0.1
    found = judged([piece(samples)], stream(), MOTION.known())
    assert found.window.kind == "wind"
    assert [channel.name for channel in found.channels] == ["t0", "t1", "l1"]
    assert "l0: its value never changes" in found.reason
