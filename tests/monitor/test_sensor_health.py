"""Faults of sensors that stay, planted one at a time."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from shm.monitor import find_lost_planes, sees_nothing, sensor_faults
from shm.values import FloatArray
from shm.values.stream import Window, WindowReading
from tests.helpers.ambient_stream import Motion, drawn, piece, stream, values
from tests.helpers.nouns import NOW
from tests.helpers.streams import MODES

RNG = np.random.default_rng(1)
MOTION: Motion = drawn(RNG, orders=4)
SAMPLES: FloatArray = values(MOTION, RNG, 300.0)


def _dead(samples: FloatArray) -> FloatArray:
    samples[1] = 0.3
    return samples


def _saturated(samples: FloatArray) -> FloatArray:
    samples[2, ::200] = 20.0
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
        (_crossed, "swapped", "t", "are exchanged (that explains 1.00"),
        (_turned, "swapped", "t", "has the opposite sign"),
    ],
)
def test_a_fault_is_told_with_its_channel(
    fault: object, kind: str, channel: str, detail: str
) -> None:
    assert callable(fault)
    samples = fault(SAMPLES.copy()) + 0.01
    (event,) = sensor_faults([piece(samples)], stream(), MOTION.known())
    assert event.kind == kind
    assert event.channel.startswith(channel)
    assert detail in event.detail
    assert (event.end - event.start).total_seconds() == 300


def test_sound_sensors_are_not_accused() -> None:
    now = [piece(SAMPLES + 0.01)]
    assert sensor_faults(now, stream(), MOTION.known()) == ()
    assert sensor_faults(now, stream(), ()) == ()
    assert sensor_faults([], stream(), ()) == ()


def _hours(*levels: float, modes: bool = True) -> list[WindowReading]:
    """Windows of ten minutes, an hour of each level."""
    found = MODES if modes else ()
    return [
        WindowReading(Window("h3", 3, NOW, 600.0, "wind", level), found, "tracked")
        for level in levels
        for _ in range(6)
    ]


def _in_order(*readings: WindowReading) -> list[WindowReading]:
    starts = (NOW + n * timedelta(minutes=10) for n in range(len(readings)))
    return [
        replace(each, window=replace(each.window, start=start))
        for each, start in zip(readings, starts, strict=True)
    ]


SEEN = _hours(6e-3, 5e-3, 6e-3, 4e-3, 6e-3, 7e-3)


@pytest.mark.parametrize(
    ("then", "is_told"),
    [
        (_hours(3e-4, modes=False), True),
        (_hours(3e-4, modes=False)[1:], False),  # not an hour yet
        (_hours(3e-3, modes=False), False),  # a quiet hour
        (_hours(3e-4), False),
        ([*_hours(3e-4, modes=False), *_hours(3e-4)[:1]], False),
        (_hours(*24 * [5e-3], modes=False), True),  # a day without modes, whatever the level
        (_hours(float("nan"), modes=False), False),
    ],
)
def test_a_stream_without_modes_that_fell_below_its_quietest_sees_nothing(
    then: list[WindowReading], is_told: bool
) -> None:
    windows = _in_order(*SEEN, *then)
    event = sees_nothing(windows)
    assert (event is not None) is is_told
    assert sees_nothing(windows[12:-1]) is None  # too little was seen before
    if event is not None:
        assert (event.kind, event.start) == ("lost modes", windows[36].window.start)


@pytest.mark.parametrize("before", [[], SEEN[:6]])
def test_a_stream_that_hardly_ever_had_a_mode_sees_nothing_after_a_day(
    before: list[WindowReading],
) -> None:
    windows = _in_order(*before, *_hours(*24 * [3e-4], modes=False))
    assert sees_nothing(windows[:-1]) is None
    event = sees_nothing(windows)
    assert event is not None
    assert "lowest before" not in event.detail


def test_what_sees_nothing_goes_on_until_modes_are_seen_and_is_told_again_after() -> None:
    blind = _hours(3e-4, modes=False)
    windows = _in_order(*SEEN, *blind, *blind)
    told = sees_nothing(windows[:-6])
    assert told is not None
    after = sees_nothing(windows[:-5], [told])
    assert after is not None
    assert (after.start, after.detail) == (windows[-6].window.start, told.detail)
    again = _in_order(*SEEN, *blind, *_hours(5e-3), *blind)
    found = sees_nothing(again, [told])
    assert found is not None
    assert found.start == again[-6].window.start


@pytest.mark.parametrize(("hours", "is_told"), [(2, False), (3, True)])
def test_find_lost_planes_six_minutes_an_hour(hours: int, is_told: bool) -> None:
    """A logger that records six minutes of each hour tells a lost plane within three hours."""
    windows = [
        WindowReading(
            Window("h3", 3, NOW + n * timedelta(hours=1), 360.0, "wind", 5e-3),
            tuple(m for m in MODES if n < 48 or m.plane == "longitudinal"),
            "tracked",
        )
        for n in range(48 + hours)
    ]
    found = find_lost_planes(windows, stream())
    assert [each.channel for each in found] == (["t0", "t1"] if is_told else [])
    assert all(each.start == windows[48].window.start for each in found)
