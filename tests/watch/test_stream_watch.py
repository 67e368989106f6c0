"""The watch over a permanent sensor's hours, on a small world of its own: AR(1), warmth, knocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from shm.errors import BadInput
from shm.models.classes.tensioned_beam import frequencies_hz
from shm.values import PLANES, FloatArray, Hanger, ModalTest, Mode
from shm.values.rounding import NINETY_PERCENT
from shm.values.stream import PooledReading, StreamEvent
from shm.watch.ambient_hammer import ambient_bias
from shm.watch.engine.kept_state import from_bytes
from shm.watch.sensors.stream_causes import find_cause
from shm.watch.sensors.stream_reading import ModeTable
from shm.watch.sensors.stream_watch import (
    StreamOptions,
    StreamState,
    StreamWatch,
    StreamWatched,
    watch_reading,
    with_believed,
)
from shm.watch.words.notices import led_by

AREA = math.pi * 0.07**2 / 4
HANGER = Hanger(
    id=7,
    length_m=14.0,
    elastic_modulus_pa=205e9,
    area_m2=AREA,
    second_moment_m4=math.pi * 0.07**4 / 64,
    mass_per_length_kg_m=7850 * AREA,
    nominal_tension_n=600e3,
    diameter_m=0.07,
)
START = datetime(2026, 5, 1, tzinfo=UTC)
MODES = [(plane, order) for plane in ("transverse", "longitudinal") for order in range(1, 6)]
K = 3e5  # N m/rad, a soft joint
Change = Callable[[int], FloatArray | float]


def log_hz(tension_n: float, k: float = K) -> FloatArray:
    each = (HANGER.length_m, tension_n, HANGER.bending_stiffness_n_m2, HANGER.mass_per_length_kg_m)
    found = frequencies_hz(*map(np.asarray, (*each, k, k)), modes=5)
    return np.log(np.concatenate([found, found]))


BASE = log_hz(600e3)
OF_TENSION = (log_hz(600e3 * math.exp(0.01)) - log_hz(600e3 * math.exp(-0.01))) / 0.02


def hours(
    count: int, *, tension: Change = lambda _: 0.0, modes: Change = lambda _: 0.0, seed: int = 0
) -> list[PooledReading]:
    """Readings of `count` hours: `tension` adds to ln T, `modes` to the ln f of all or of each."""
    draw, found = np.random.default_rng(seed), []
    weather = wander = 0.0
    for hour in range(count):
        weather = 0.986 * weather + 0.66 * draw.normal()
        wander = 0.85 * wander + 2.5e-4 * draw.normal()
        warm = 10 + 4 * math.sin(2 * math.pi * (hour - 9) / 24) + weather
        shift = -8e-4 * (warm - 10) + wander + tension(hour)
        y = BASE + OF_TENSION * shift - 3e-4 * (0.5 - OF_TENSION) * (warm - 10) + modes(hour)
        y = y + 2e-4 * draw.standard_t(5, size=10)
        measured = tuple(
            Mode(plane, order, hz, 2e-4 * hz)
            for (plane, order), hz in zip(MODES, np.exp(y).tolist(), strict=True)
            if draw.random() > 0.05
        )
        at = START + timedelta(hours=hour)
        found.append(PooledReading("north", 7, at, "hour", measured, 6, 0, 0.02, warm, 4.0))
    return found


def watched(
    readings: Sequence[PooledReading], hanger: Hanger = HANGER
) -> tuple[list[StreamWatched], StreamState]:
    watch, state, found = StreamWatch(None, hanger, StreamOptions()), None, []
    for each in readings:
        one, state = watch.after(state, each)
        found.append(one)
    assert state is not None
    return found, state


def from_hour(first: int, change: float, last: int = 10**6) -> Change:
    return lambda hour: change if first <= hour < last else 0.0


def test_it_learns_first_and_says_so() -> None:
    found, _ = watched(hours(75))

    assert found[10].learning == "learning since 2026-05-01 00:00: 0.5 of 3 days."
    assert not found[-1].learning
    assert not any(each.alert for each in found)


@pytest.mark.slow
def test_nothing_is_told_where_nothing_changes() -> None:
    found, _ = watched(hours(24 * 40, seed=3))

    assert not [each for each in found if each.alert or each.events]


def test_a_loss_of_one_percent_is_told_once_within_a_day_and_ends_when_it_is_back() -> None:
    found, state = watched(hours(900, tension=from_hour(500, -0.01, 700)))

    (told,) = [each.alert for each in found if each.alert]
    assert START + timedelta(hours=500) < told.time <= START + timedelta(hours=524)
    assert told.kinds == ("sudden change",)
    assert told.message.startswith("Hanger 7: tension fell by ")
    assert told.change is not None
    first = told.change.moved[0]
    assert abs(first.shift_mean + 0.01) < 3 * first.shift_sd < 0.01
    ended = [(n, each.ended) for n, each in enumerate(found) if each.ended]
    assert [keys for _, keys in ended] == [(told.key,)]
    assert 700 < ended[0][0] < 724
    assert not state.standing


@pytest.mark.parametrize("hour", [500, 450])
def test_what_the_logger_said_as_a_change_began_leads_its_alert(hour: int) -> None:
    at = START + timedelta(hours=hour, minutes=14)
    said = StreamEvent("north", "logger", at, at, "acc_1 exchanged")
    gap = replace(said, kind="gap", detail="9 samples are missing")
    found, _ = watched(hours(530, tension=from_hour(500, -0.01)))
    (alert,) = [each.alert for each in found if each.alert]

    led = led_by(alert, [gap, said])
    if hour == 450:
        assert led == alert
        return
    assert led.key == alert.key
    assert led.message.startswith(
        "Hanger 7: check the sensors first, at 2026-05-21 20:14 the logger said acc_1 exchanged. "
        "Tension fell by "
    )


def test_a_loss_beyond_its_threshold_is_urgent() -> None:
    found, _ = watched(hours(560, tension=from_hour(500, -0.08)))

    messages = [each.alert.message for each in found if each.alert]
    assert "beyond its threshold" in messages[0]
    assert "today" in messages[0]


def test_a_slow_loss_is_told_as_slow() -> None:
    found, _ = watched(hours(1000, tension=lambda hour: -0.002 * max(hour - 400, 0) / 24))

    told = [each.alert for each in found if each.alert]
    assert told
    assert told[0].kinds == ("slow drift",)
    assert told[0].time < START + timedelta(hours=400 + 24 * 12)


def test_a_time_base_that_steps_is_the_measurements() -> None:
    found, _ = watched(hours(560, modes=from_hour(500, 0.004)))

    assert not any(each.alert for each in found)
    (event,) = [event for each in found for event in each.events]
    assert event.kind == "clock drift"
    assert event.start < START + timedelta(hours=501) < event.end
    assert abs(found[-1].compensated_shift) < 0.002


def exchanged(modes: Sequence[Mode]) -> tuple[Mode, ...]:
    """Return the modes with their planes exchanged, as crossed cables report them."""
    other = dict(zip(PLANES, PLANES[::-1], strict=True))
    return tuple(replace(mode, plane=other[mode.plane]) for mode in modes)


@pytest.mark.parametrize("lacking", [0, 2])
def test_planes_that_are_exchanged_are_told_as_such_within_hours(lacking: int) -> None:
    """Also where one plane lacks modes; the other one's springs are softer here."""
    apart = np.repeat([0.0, -0.04], 5)
    plain = hours(530, modes=lambda _: apart)
    whole = range(1, 6 - lacking)
    kept = [
        replace(
            each,
            modes=tuple(m for m in each.modes if m.order in whole or m.plane == "transverse"),
        )
        for each in plain
    ]
    off = [replace(each, modes=exchanged(each.modes)) for each in kept[500:]]
    found, _ = watched([*kept[:500], *off])

    assert not any(each.alert for each in found)
    (event,) = [event for each in found for event in each.events]
    assert event.kind == "swapped"
    assert event.end <= START + timedelta(hours=504)
    assert abs(found[-1].compensated_shift) < 0.002


@pytest.mark.parametrize("apart", [6e-4, 2e-3])
def test_close_planes_that_are_exchanged(apart: float) -> None:
    """Planes that lie a few deviations apart are told, and what is exchanged is no change."""
    plain = hours(560, modes=lambda _: np.repeat([0.0, -apart], 5))
    off = [replace(each, modes=exchanged(each.modes)) for each in plain[500:]]
    found, _ = watched([*plain[:500], *off])
    assert not any(each.alert for each in found)
    (event,) = [event for each in found for event in each.events]
    assert event.kind == "swapped"
    assert event.end <= START + timedelta(hours=506)


def test_a_mode_that_went_astray_moves_nothing() -> None:
    astray = np.eye(10)[0] * 0.01
    plain, _ = watched(hours(300))
    found, _ = watched(hours(300, modes=lambda hour: astray if hour > 200 else 0.0))

    assert not any(each.alert or each.events for each in found)
    assert found[-1].tension_shift == pytest.approx(plain[-1].tension_shift, abs=5e-4)


def test_a_plane_that_falls_silent_moves_nothing() -> None:
    readings = hours(300)
    dead = [
        replace(each, modes=tuple(mode for mode in each.modes if mode.plane == "longitudinal"))
        for each in readings[200:]
    ]
    found, _ = watched([*readings[:200], *dead])

    assert not any(each.alert or each.events for each in found)


def test_a_loosened_end_is_told_as_one() -> None:
    softer = (log_hz(600e3, K / 4) - BASE) * (np.arange(10) < 5)
    found, _ = watched(hours(540, modes=lambda hour: softer if hour >= 500 else 0.0))

    told = next(each.alert for each in found if each.alert)
    assert "end stiffness" in told.message
    assert told.change is not None
    assert told.change.moved[0].quantity == "transverse_end_stiffness"


@pytest.mark.parametrize("plane", ["transverse", "longitudinal"])
def test_loosened_end_of_one_plane(plane: str) -> None:
    """It is told within half a day, as no tension, and stands until the end is tight again."""
    own = np.array([each == plane for each, _ in MODES])
    softer = (log_hz(600e3, K / 10) - BASE) * own
    found, state = watched(hours(640, modes=lambda n: softer if 500 <= n < 580 else 0.0))
    (told,) = [each.alert for each in found if each.alert]
    assert START + timedelta(hours=500) < told.time <= START + timedelta(hours=512)
    assert told.change is not None
    assert told.change.moved[0].quantity == f"{plane}_end_stiffness"
    (ended,) = [n for n, each in enumerate(found) if each.ended]
    assert 580 < ended < 604
    assert not state.standing
    for each in (found[540], found[-1]):
        assert abs(each.compensated_shift) < 3 * each.compensated_sd < 0.006


@pytest.mark.parametrize(("tension", "modes"), [(-0.08, 0.0), (0.0, -0.04)])
def test_interval_reaches_what_its_reading_says(tension: float, modes: float) -> None:
    """In the hours before a change is told: of the tension, or of one plane that says -8 %."""
    own = np.array([each == "longitudinal" for each, _ in MODES])
    found, _ = watched(
        hours(503, tension=from_hour(500, tension), modes=lambda n: modes * own * (n >= 500))
    )
    assert not any(each.alert for each in found)
    for each in found[500:]:
        assert abs(each.compensated_shift + 0.08) < NINETY_PERCENT * each.compensated_sd + 0.005


def test_where_ends_and_tension_cannot_be_told_apart_both_are_named() -> None:
    """Of 60 % of the stiffness of all ends of a taut bar, and of 2 % of its tension."""
    hz = zip(MODES, np.exp(BASE).tolist(), strict=True)
    table = ModeTable.of(None, HANGER, [Mode(*own, each, 2e-4 * each) for own, each in hz])

    first = find_cause(log_hz(600e3, 0.4 * K) - BASE, table, None, HANGER).moved[0]
    assert "end_stiffness" in " ".join((first.quantity, *first.alike))
    first = find_cause(log_hz(588e3) - BASE, table, None, HANGER).moved[0]
    assert first.quantity == "tension"
    assert first.shift_mean == pytest.approx(-0.02, abs=0.003)


def test_without_a_thermometer_it_is_careful_and_goes_on() -> None:
    readings = hours(700, seed=5)
    blind = [replace(each, temperature_c=math.nan) for each in readings[400:500]]
    found, _ = watched([*readings[:400], *blind, *readings[500:]])

    assert not any(each.alert or each.events for each in found)


# ---------------------------------------------------------------- what is kept


def test_it_goes_on_from_bytes_as_it_would_have() -> None:
    readings = hours(140, tension=from_hour(120, -0.02))
    found, state = watched(readings)
    kept = None
    for each in readings:
        last = watch_reading(None, each, HANGER, kept)
        kept = last.kept
        assert not last.alert or last.alert == found[readings.index(each)].alert

    assert last.compensated_shift == found[-1].compensated_shift
    assert from_bytes(StreamState, last.kept).bank.day == state.bank.day


def test_what_it_cannot_read_or_watch_is_said() -> None:
    reading = hours(1)[0]
    with pytest.raises(BadInput, match="the watch then starts again"):
        watch_reading(None, reading, HANGER, b"{}\n")
    with pytest.raises(BadInput, match="no model"):
        watch_reading(None, reading, Hanger.without_model(7), None)


# ---------------------------------------------------------------- parts


def test_with_believed_drops_a_state_that_cannot_be_read() -> None:
    kept, found = with_believed(b'{"of": "another version"}', [])
    assert kept is None
    assert found.windows == ()


def test_ambient_frequencies_are_compared_with_hammer_tests() -> None:
    readings = hours(24 * 6)
    tests = [
        ModalTest(
            f"t{day}",
            tuple(replace(m, frequency_hz=m.frequency_hz * (1 - 8e-4)) for m in reading.modes),
            hanger=7,
            time=reading.start + timedelta(minutes=20),
        )
        for day, reading in enumerate(readings[12::24])
    ]
    found = ambient_bias(7, tests, readings)

    assert abs(found.common - 8e-4) < 2 * found.common_sd < 8e-4
    assert found.most_tests == 6
    assert found.text().startswith(
        "Hanger 7: frequencies by wind and traffic differ from those of hammer tests by +0.0"
    )
    far = [replace(each, time=START - timedelta(days=9)) for each in tests]
    assert not ambient_bias(7, far, readings).is_known
    assert "Make one while they run" in ambient_bias(7, far, readings).text()
