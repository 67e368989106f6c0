"""Times of loggers: their unit, their start, and the rate where several rows have the same."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from shm.errors import BadInput
from shm.read import logger_text
from shm.read.assemble import assemble
from shm.read.describe import describe
from shm.read.registry import look
from shm.read.table import Table
from shm.values import NAN, FloatArray

PATH = Path("a.csv")


def table(times: FloatArray, stated_hz: float = NAN, name: str = "Time [s]") -> Table:
    """Return what is read of a logger's text with these times and one acceleration."""
    preamble = [] if math.isnan(stated_hz) else [f"Sample rate;{stated_hz} Hz"]
    rows = [f"{float(each)!r};{row % 7 / 8}" for row, each in enumerate(times)]
    found = logger_text.table_in("\n".join([*preamble, f"{name};Acc [m/s2]", *rows]), PATH)
    assert found is not None
    return found


def rate(seconds: FloatArray, stated_hz: float = NAN, name: str = "Time [s]") -> float:
    """Return the sampling rate, NaN where nothing says it."""
    found = look(table(seconds, stated_hz, name), "CSV")
    assert not any("but the times" in problem for problem in found.problems)
    return found.sampling_rate_hz


def contradiction(seconds: FloatArray, stated_hz: float) -> str:
    """Return the problem of times that say another rate than is stated."""
    found = look(table(seconds, stated_hz), "CSV")
    return next(each for each in found.problems if "but the times" in each)


def whole_seconds(hz: int, seconds: int, late: int = 0) -> FloatArray:
    """Return times of a clock that counts seconds, begun `late` samples after one."""
    return np.floor((np.arange(hz * seconds) + late) / hz)


def test_a_clock_of_whole_seconds_gives_the_samples_between_its_first_and_last_step() -> None:
    """However many of the first and the last second are there."""
    for late in (0, 3, 49):
        assert rate(whole_seconds(50, 20, late)) == 50
    assert rate(whole_seconds(50, 20) / 2) == 100


def test_a_rate_that_is_said_is_trusted_where_the_clock_does_not_contradict() -> None:
    times = whole_seconds(50, 20, 3)
    assert rate(times, 50.9) == 50.9
    assert rate(times, 49.1) == 49.1
    assert "the data give 50 Hz" in contradiction(times, 51.5)
    assert "the data give 50 Hz" in contradiction(times, 48.5)


def test_a_finely_rounded_clock_gives_the_rate_of_all_its_samples() -> None:
    times = np.floor(np.arange(40_001) / 2000 * 1000) / 1000
    assert rate(times) == pytest.approx(40_000 / times[-1], rel=1e-12)


def test_counts_that_differ_by_more_than_one_say_no_rate() -> None:
    steady = np.repeat(np.arange(20.0), [50, 50, 51, 50] * 5)
    assert rate(steady) == 50
    uneven = np.repeat(np.arange(20.0), [50, 52] * 10)
    assert math.isnan(rate(uneven))
    assert math.isnan(rate(np.repeat([0.0, 1.0], 20)))


def test_times_that_jump_or_go_back_are_refused_at_their_row() -> None:
    back = np.repeat([0.0, 1, 0, 2], 8)
    with pytest.raises(BadInput, match=r"line 18.*does not increase"):
        assemble(describe(table(back), with_sidecars=False))
    jumped = whole_seconds(50, 20)
    jumped[500:] += 5
    with pytest.raises(BadInput, match=r"line 501.*the times are uneven"):
        assemble(describe(table(jumped), with_sidecars=False))


@pytest.mark.parametrize(
    ("first", "step", "hz"),
    [
        (1_777_636_800.0, 0.01, 100.0),
        (1_777_636_800e3, 10.0, 100.0),
        (1_777_636_800e6, 1e4, 100.0),
    ],
)
def test_times_since_an_epoch_say_the_start(first: float, step: float, hz: float) -> None:
    times = first + step * np.arange(9)
    assert rate(times, name="Time") == pytest.approx(hz, rel=1e-5)
    found = table(times, name="Time")
    start = datetime.fromisoformat(found.entries["time"].text)
    assert abs((start - datetime(2026, 5, 1, 12, tzinfo=UTC)).total_seconds()) < 1e-3


@pytest.mark.parametrize("first", [0.0, 29_000.0, 61_000.0, 1e8])
def test_other_numbers_are_no_epoch(first: float) -> None:
    assert "time" not in table(first + 0.25 * np.arange(9), name="Time").entries
    assert "time" not in table(45_000 + 2.0 * np.arange(9), name="Time").entries


@pytest.mark.parametrize(
    ("hz", "said", "factor"),
    [
        (200.0, NAN, 1.0), (0.2, 200.0, 1e-3), (0.0002, 200.0, 1e-6), (200.0, 200.0, 1.0),
        (200.0, 300.0, 1.0), (0.0002, NAN, None), (1e7, NAN, None),
    ],
)  # fmt: skip
def test_the_unit_of_times_follows_from_the_rate_that_is_said(
    hz: float, said: float, factor: float | None
) -> None:
    """A unit of 1/1000 s makes a rate of 0.2 per unit one of 200 Hz."""
    times = np.arange(100) / hz
    if factor is None:
        assert math.isnan(rate(times, said, name="Time"))
        assert "the unit of Time is not said" in table(times, said, name="Time").remarks[0]
    elif hz / factor == pytest.approx(said) or math.isnan(said):
        assert rate(times, said, name="Time") == pytest.approx(hz / factor)
    else:
        assert f"the data give {hz / factor:g} Hz" in contradiction(times, said)


def test_times_that_stand_still_have_no_unit() -> None:
    assert rate(np.zeros(40), 200.0, name="Time") == 200


def of_two_sensors(second: FloatArray) -> str:
    """Return a text of two sensors, each after its own column of times."""
    rows = [f"{i / 100:.3f};{i % 7};{t:.3f};{i % 5}" for i, t in enumerate(second)]
    return "\n".join(["Time 1 [s];A1 [m/s2];Time 2 [s];A2 [m/s2]", *rows])


@pytest.mark.parametrize("second", [np.arange(200) / 100 + 7.5, np.arange(200) // 100])
def test_a_second_column_of_times_that_agrees_changes_nothing(second: FloatArray) -> None:
    table = logger_text.table_in(of_two_sensors(second), PATH)
    assert table is not None
    found = look(table, "CSV")
    assert (found.problems, found.sampling_rate_hz, found.left_out) == ((), 100.0, ())
    assert [channel.name for channel in found.channels] == ["A1", "A2"]


@pytest.mark.parametrize(
    ("second", "line"),
    [(np.arange(200) * 0.012, 5), (np.where(np.arange(200) < 195, np.arange(200) / 100, NAN), 197)],
)
def test_a_second_column_of_other_times_is_refused(second: FloatArray, line: int) -> None:
    table = logger_text.table_in(of_two_sensors(second), PATH)
    assert table is not None
    with pytest.raises(BadInput, match="are not those of Time 1") as refusal:
        assemble(describe(table, with_sidecars=False))
    assert (refusal.value.channel, refusal.value.line) == ("Time 2", line)
