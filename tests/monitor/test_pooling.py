"""Windows pooled: against closed forms where errors are independent, and where they are not."""

from __future__ import annotations

import math
from datetime import timedelta

import numpy as np
import pytest

from shm.monitor import as_modal_test, pooled
from shm.values import FloatArray, Mode, ShapePoint
from shm.values.stream import Period, Window, WindowReading
from tests.helpers.ambient_stream import START

SD = 2e-4


def _readings(
    hz: FloatArray, level: FloatArray | None = None, temperature: FloatArray | None = None
) -> list[WindowReading]:
    """Return a window each ten minutes, with a mode near 5 Hz and one near 10 Hz."""
    number = len(hz)
    levels = np.full(number, 0.01) if level is None else level
    warm = np.full(number, 10.0) if temperature is None else temperature
    made = []
    for step in range(number):
        window = Window(
            "h3", 3, START + timedelta(minutes=10 * step), 600.0, "wind", float(levels[step]),
            temperature_c=float(warm[step]), wind_m_s=4.0,
        )  # fmt: skip
        shape = (ShapePoint(2.0, 0.5, 0.01, 0.01), ShapePoint(4.0, 1.0, 0.02, 0.01))
        modes = tuple(
            Mode("transverse", order, order * float(hz[step]), order * 5 * SD, 2e-3, 4e-4,
                 shape, float(levels[step]))
            for order in (1, 2)
        )  # fmt: skip
        made.append(WindowReading(window, modes, "tracked"))
    return made


def test_independent_windows_give_the_mean_and_its_standard_deviation() -> None:
    rng = np.random.default_rng(1)
    hz = 5 + 5 * SD * rng.normal(size=6)
    reading = pooled(_readings(hz), "hour", START)
    assert reading is not None
    first = reading.modes[0]
    assert first.frequency_hz == pytest.approx(np.mean(hz), rel=1e-9)
    scatter = np.std(hz, ddof=1) / math.sqrt(6)
    formal = 5 * SD / math.sqrt(6)
    repeats = 6e-5 * 5
    assert first.frequency_sd_hz == pytest.approx(
        math.hypot(max(scatter, formal), repeats), rel=1e-4
    )
    assert (reading.windows, reading.left_out, reading.level_m_s2) == (6, 0, 0.01)
    assert first.shape[1].value == 1.0


@pytest.mark.parametrize(("period", "number"), [("hour", 6), ("six hours", 36), ("day", 144)])
def test_intervals_hold_what_they_say(period: Period, number: int) -> None:
    """Of 120 periods with independent errors, the mean of a 90 % interval holds the truth."""
    rng = np.random.default_rng(2)
    held = []
    for _ in range(120):
        reading = pooled(_readings(5 + 5 * SD * rng.normal(size=number)), period, START)
        assert reading is not None
        mode = reading.modes[0]
        held.append(abs(mode.frequency_hz - 5) < 1.645 * mode.frequency_sd_hz)
    assert 0.80 < np.mean(held) <= 1.0


def test_a_window_that_is_off_is_left_out_and_counted() -> None:
    rng = np.random.default_rng(4)
    hz = 5 + 5 * SD * rng.normal(size=6)
    hz[2] = 5.2
    readings = _readings(hz)
    readings[4] = WindowReading(readings[4].window, (), "none", "too short")
    reading = pooled(readings, "hour", START)
    assert reading is not None
    assert (reading.windows, reading.left_out) == (4, 2)
    assert reading.modes[0].frequency_hz == pytest.approx(5, abs=0.003)


def test_a_frequency_is_that_of_the_mean_level_and_temperature() -> None:
    """It falls by 1e-3 per 0.01 m/s^2 and 2e-4 per degree; the loud windows are the vague ones."""
    rng = np.random.default_rng(5)
    level = np.exp(rng.normal(-4.6, 0.6, 144))
    warm = 10 + 5 * np.sin(2 * np.pi * np.arange(144) / 144)
    clean = 5 * (1 - 0.1 * level - 2e-4 * (warm - 10))
    hz = clean + 5 * SD * rng.normal(size=144)
    reading = pooled(_readings(hz, level, warm), "day", START)
    assert reading is not None
    mode = reading.modes[0]
    assert abs(mode.frequency_hz - clean.mean()) < 3 * mode.frequency_sd_hz
    # no wider than by the errors alone, though the temperature moves it ten times as much
    assert mode.frequency_sd_hz < 1.5 * math.hypot(5 * SD / 12, 3e-4)


@pytest.mark.parametrize(
    ("period", "name", "middle_h"),
    [
        ("day", "h3-2026-11-25", 12.0),
        ("six hours", "h3-2026-11-25T00-6h", 3.0),
        ("hour", "h3-2026-11-25T00", 0.5),
    ],
)
def test_a_reading_is_a_test_like_any_other(period: Period, name: str, middle_h: float) -> None:
    reading = pooled(_readings(np.full(6, 5.0)), period, START)
    assert reading is not None
    test = as_modal_test(reading)
    assert test.id == name
    assert test.time == START + timedelta(hours=middle_h)
    assert (test.hanger, test.temperature_c) == (3, 10.0)
    assert math.isnan(test.amplitude)
    assert [mode.order for mode in test.modes] == [1, 2]
