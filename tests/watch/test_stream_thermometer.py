"""A stream's thermometer at fault: dead, in another unit, loose. Its tension is not to follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import timedelta

import pytest

from shm.pipeline.stream_steps import Pooled, pool_stream
from shm.values import outdoor_c
from shm.values.stream import PooledReading, Window, WindowReading
from shm.watch.sensors.stream_thermometer import Believed, Thermometer, believed
from tests.watch.test_stream_watch import HANGER, START, from_hour, hours
from tests.watch.test_stream_watch import watched as watch_readings

Says = Callable[[int, float], float]


def windows_of(reading: PooledReading, said_c: float) -> list[WindowReading]:
    """The first and the last ten minutes of an hour: each follows on the one before."""
    starts = (reading.start, reading.start + timedelta(minutes=50))
    level = reading.level_m_s2
    return [
        WindowReading(
            Window("north", 7, at, 600.0, "wind", level, temperature_c=said_c, wind_m_s=4.0),
            reading.modes,
            "tracked",
        )
        for at in starts
    ]


def watched(readings: Sequence[PooledReading], says: Says) -> list[Pooled]:
    """Hour by hour as the daemon does, the thermometer saying what `says` makes of the truth."""
    found: list[Pooled] = []
    kept, events = None, []
    for hour, each in enumerate(readings):
        windows = windows_of(each, says(hour, each.temperature_c))
        one = pool_stream(windows, "hour", each.start, HANGER, None, kept, 100.0, events[-9:])
        kept, events = one.state, [*events, *one.events]
        found.append(one)
    return found


def from_on(first: int, says: Callable[[float], float], last: int = 10**6) -> Says:
    return lambda hour, true_c: says(true_c) if first <= hour < last else true_c


DEAD = from_on(110, lambda _: -127.0)


@pytest.mark.parametrize("said_c", [-127.0, 999.0, -273.0, 85.0, 282.0])
def test_what_no_bridge_can_be_is_an_unknown_temperature_and_told_each_hour(said_c: float) -> None:
    assert math.isnan(outdoor_c(said_c))
    found = watched(hours(4), from_on(2, lambda _: said_c))

    assert [len(each.events) for each in found] == [0, 0, 1, 1]
    (event,) = found[2].events
    assert event.kind == "thermometer"
    assert event.detail.startswith(f"temperature_c is {said_c:g}, and nothing outdoors is")
    assert event.end == START + timedelta(hours=3)
    assert [math.isnan(each.reading.temperature_c) for each in found] == [False] * 2 + [True] * 2


def test_a_dead_thermometer_neither_moves_the_tension_nor_doubles_a_loss() -> None:
    readings = hours(150, tension=from_hour(115, -0.02))
    found = watched(readings, DEAD)

    (told,) = [each.alert for each in found if each.alert]
    assert told.time > START + timedelta(hours=115)
    assert told.message.startswith(
        "Hanger 7: the temperature is not known (temperature_c is -127, and nothing outdoors is "
        "below -60 or above 80 °C): part of this may be the weather's. Tension fell by "
    )
    tension = told.change.moved[0]
    sighted, _ = watch_readings(readings)
    (sharp,) = [each.alert for each in sighted if each.alert]
    assert tension.quantity == "tension"
    assert abs(tension.shift_mean + 0.02) < 2 * tension.shift_sd
    assert 1.5 * sharp.change.moved[0].shift_sd < tension.shift_sd < 0.01


def test_a_thermometer_at_fault_alone_is_no_alert() -> None:
    readings = hours(130, seed=2)
    found = judge(readings, from_on(100, lambda true_c: true_c + 12))
    blind = [
        replace(each, temperature_c=one.windows[0].window.temperature_c)
        for each, one in zip(readings, found, strict=True)
    ]

    assert {event.kind for each in found for event in each.events} == {"thermometer"}
    assert all(each.events for each in found[100:])
    assert not [each.alert for each in watch_readings(blind)[0] if each.alert]


def judge(readings: Sequence[PooledReading], says: Says) -> list[Believed]:
    """Hour by hour what is believed of a thermometer, after three days of learning."""
    thermometer, found = Thermometer(), []
    for hour, each in enumerate(readings):
        windows = windows_of(each, says(hour, each.temperature_c))
        found.append(believed(thermometer, windows, learning=hour < 72))
        thermometer = found[-1].thermometer
    return found


def list_unknown(found: Sequence[Believed]) -> list[int]:
    return [
        hour
        for hour, each in enumerate(found)
        if all(math.isnan(one.window.temperature_c) for one in each.windows)
    ]


def test_a_jump_is_not_believed_until_it_is_back() -> None:
    says = from_on(100, lambda true_c: true_c + 12, 110)
    readings = hours(120)
    found = judge(readings, says)

    told = [each.events[0].detail for each in found if each.events]
    assert len(told) == 10
    assert told[0].startswith("temperature_c jumped by +1")
    assert "at 2026-05-05 04:00, faster than steel warms or cools" in told[0]
    assert list_unknown(found) == list(range(100, 110))
    for hour in (99, 105, 112):  # gone over again, as in the pool of a day
        windows = windows_of(readings[hour], says(hour, readings[hour].temperature_c))
        again = believed(found[-1].thermometer, windows, learning=False)
        assert bool(list_unknown([again])) is (100 <= hour < 110)


def test_one_that_stands_still_for_a_day_is_not_believed_until_it_moves() -> None:
    found = judge(hours(150), from_on(100, lambda _: 7.5, 140))

    told = [event.detail for each in found for event in each.events]
    assert len(told) == 140 - 100 - 24
    assert told[0].startswith("temperature_c has been 7.5 since 2026-05-05 04:00")
    assert list_unknown(found) == list(range(124, 140))
    start_s, seen = START.timestamp(), Thermometer()
    for day in range(20):  # a logger that sends a window at each noon
        seen = seen.after(20.0, start_s + 86400 * day)
    assert not seen.is_doubted(seen.seen_s)
