"""Streams brought forward: from chunks to windows, hours, days and the spool."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from shm.errors import StoreBusy
from shm.modes_document import load_modes
from shm.pipeline import stream_steps
from shm.pipeline.stream_state import stream_states
from shm.pipeline.streaming import Streaming
from shm.read.chunk_document import chunk_document
from shm.simulate.ambient import streamed
from shm.store import Store, Workspace
from shm.store.ring import ring_of
from shm.store.streams import Streams, list_pooled, list_windows, load_stream_watch
from shm.values.stream import PooledReading
from shm.watch.engine.kept_state import to_bytes
from shm.watch.sensors.stream_reading import ModeTable
from shm.watch.sensors.stream_watch import StreamState, StreamWatched
from tests.helpers.flows import Clock
from tests.helpers.live_streams import (
    CALM,
    FIRST,
    HOUR,
    drain,
    find_quickly,
    send,
    with_live_streams,
)
from tests.helpers.workspaces import make_workspace


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """A bridge with one stream, what whose windows say is made up."""
    monkeypatch.setattr(stream_steps, "read_stream_window", find_quickly)
    return with_live_streams(make_workspace(tmp_path / "bridge"))


@contextmanager
def at_work(workspace: Workspace, clock: Clock) -> Iterator[tuple[Streaming, Store]]:
    with workspace.store() as store, ThreadPoolExecutor(1) as threads:
        streaming = Streaming(workspace, store, threads, clock=clock)
        try:
            yield streaming, store
        finally:
            streaming.close()


def hours_of(store: Store, period: str = "hour") -> tuple[PooledReading, ...]:
    return list_pooled(store, 3, period, FIRST - timedelta(days=2), FIRST + timedelta(days=9))


@pytest.fixture(scope="module")
def two_hours(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Two hours of a stream a day later, brought to its end; only to be looked at."""
    workspace = with_live_streams(make_workspace(tmp_path_factory.mktemp("hours") / "bridge"))
    send(workspace, 2)
    clock = Clock(FIRST + timedelta(days=1))
    with at_work(workspace, clock) as (streaming, _):
        drain(streaming, clock)
    return workspace


def test_chunks_become_windows_hours_and_a_day_in_the_spool(two_hours: Workspace) -> None:
    with two_hours.store() as store:
        windows = list_windows(store, 3, FIRST, FIRST + 2 * HOUR)
        assert [each.window.start for each in windows] == [
            FIRST + n * timedelta(minutes=10) for n in range(12)
        ]
        assert windows[0].how == "from scratch"
        assert {each.how for each in windows[1:]} == {"tracked"}
        assert len(windows[0].spectrum_db) == 200
        assert [each.start for each in hours_of(store)] == [FIRST + n * HOUR for n in range(2)]
        assert "learning" in hours_of(store)[0].learning
        (day,) = hours_of(store, "day")
    (test,) = load_modes(two_hours.spool / "hanger03-2026-06-01.modes.json")
    assert test.hanger == 3
    assert [mode.frequency_hz for mode in test.modes] == [m.frequency_hz for m in day.modes]


def test_a_day_gives_the_frequency_that_was_planted(two_hours: Workspace) -> None:
    """To a hundredth of a per cent: 1 % of tension moves it by 0.4 %."""
    from shm.simulate import HangerState
    from shm.simulate.ambient import Weather
    from tests.worlds.simulated.elements import natural_frequencies

    with two_hours.store() as store:
        (day,) = hours_of(store, "day")
    hanger = two_hours.bridge.hangers[0]
    mode = next(m for m in day.modes if (m.plane, m.order) == ("transverse", 3))
    cold, warm = (
        natural_frequencies(hanger, HangerState(711e3 * (1 + 3 * sign * CALM.per_kelvin * 10)), 3)
        for sign in (-1, 1)
    )
    assert cold[0, 2] < mode.frequency_hz < warm[0, 2]
    assert 0 < mode.frequency_sd_hz < 3e-4 * mode.frequency_hz
    assert day.temperature_c == pytest.approx(Weather(3, CALM).temperature_c(FIRST + HOUR), abs=2)


def test_what_was_begun_and_not_kept_is_done_by_whoever_comes_next(workspace: Workspace) -> None:
    send(workspace, 1)
    clock = Clock(FIRST + timedelta(days=1))
    with at_work(workspace, clock) as (streaming, _):
        streaming.advance()  # begins the first window, and is gone
    with at_work(workspace, clock) as (streaming, store):
        drain(streaming, clock)
        assert len(list_windows(store, 3, FIRST, FIRST + HOUR)) == 6
        assert len(hours_of(store)) == 1


@pytest.mark.slow
def test_three_days_offline_are_caught_up_and_nothing_between_is_made_up(
    workspace: Workspace,
) -> None:
    clock = Clock(FIRST + 2 * HOUR)
    send(workspace, 1)
    with at_work(workspace, clock) as (streaming, store):
        drain(streaming, clock)
        assert len(hours_of(store)) == 1
    clock.now = FIRST + timedelta(days=3)
    send(workspace, 1, first=FIRST + timedelta(days=2, hours=22), seed=4)
    with at_work(workspace, clock) as (streaming, store):
        drain(streaming, clock)
        assert [each.start for each in hours_of(store)] == [
            FIRST,
            FIRST + timedelta(days=2, hours=22),
        ]


def test_ten_minutes_of_which_more_comes_later_are_read_anew(workspace: Workspace) -> None:
    (stream,), (hanger,) = workspace.bridge.streams, workspace.bridge.hangers
    chunks = list(streamed(hanger, stream, CALM, FIRST, 3600, 3))
    clock, ring = Clock(FIRST + timedelta(days=1)), ring_of(workspace)
    for chunk in chunks[:2] + chunks[3:]:
        ring.append(chunk_document(chunk))
    with at_work(workspace, clock) as (streaming, store):
        drain(streaming, clock)
        assert len(list_windows(store, 3, FIRST, FIRST + HOUR)) == 5
        ring.append(chunk_document(chunks[2]))
        drain(streaming, clock)
        assert len(list_windows(store, 3, FIRST, FIRST + HOUR)) == 6


def test_a_step_that_fails_is_said_in_its_window_and_the_stream_goes_on(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    def find_most(pieces, *others):
        if pieces[0].start == FIRST + timedelta(minutes=20):
            raise ValueError("odd")
        return find_quickly(pieces, *others)

    monkeypatch.setattr(stream_steps, "read_stream_window", find_most)
    send(workspace, 1)
    clock = Clock(FIRST + timedelta(days=1))
    with at_work(workspace, clock) as (streaming, store):
        drain(streaming, clock)
        windows = list_windows(store, 3, FIRST, FIRST + HOUR)
    assert [each.window.kind == "unusable" for each in windows] == [False] * 2 + [True] + [
        False
    ] * 3
    assert "odd" in windows[2].why


@pytest.mark.parametrize("place", ["save_window", "save_pooled"])
@pytest.mark.parametrize("error", [ValueError("not a number"), StoreBusy("", retry_after_s=1.0)])
def test_advance_storing_raises(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, place: str, error: Exception
) -> None:
    """No ten minutes are lost and no later ones held up by an error while one result is stored."""
    save, failures = getattr(Streams, place), [error]

    def fail_once(*args: Any) -> Any:
        if failures:
            raise failures.pop()
        return save(*args)

    monkeypatch.setattr(Streams, place, fail_once)
    send(workspace, 1)
    clock = Clock(FIRST + timedelta(days=1))
    with at_work(workspace, clock) as (streaming, store):
        if isinstance(error, StoreBusy):
            with pytest.raises(StoreBusy):
                drain(streaming, clock)
        drain(streaming, clock)
        windows = list_windows(store, 3, FIRST, FIRST + HOUR)
        unread = [each for each in windows if "not a number" in each.why]
        assert len(windows) == 6
        given_up = isinstance(error, ValueError)
        assert len(unread) == (given_up and place == "save_window")
        assert len(hours_of(store)) == 1 - (given_up and place == "save_pooled")


def test_an_alert_is_owed_to_the_hooks_and_the_raw_samples_before_it_stay(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    from shm.values import Alert

    state = b""

    def alarmed(baseline, reading, hanger, kept, options) -> StreamWatched:
        at = reading.start + HOUR
        alert = Alert("hanger-3:sudden-change:x", 3, "hanger03-x", at, "Hanger 3 lost 3 %.", ())
        nonlocal state
        state = to_bytes(StreamState.begun("", at, ModeTable.of(None, hanger, reading.modes)))
        return StreamWatched(state, -0.03, 1e-3, -0.03, 1e-3, None, alert, (), (), "")

    monkeypatch.setattr(stream_steps, "watch_reading", alarmed)
    send(workspace, 2)
    clock = Clock(FIRST + timedelta(days=1))
    with at_work(workspace, clock) as (streaming, store):
        drain(streaming, clock)
        assert [each.alert.key for each in store.alerts.list_all()] == ["hanger-3:sudden-change:x"]
        assert hours_of(store)[0].tension_shift == -0.03
        kept = load_stream_watch(store, 3)
        assert kept is not None
        assert kept.content == state
    assert len(list((workspace.folder / "ring").glob("*/kept/*.json"))) == 2


def test_a_dead_thermometer_is_a_sensor_at_fault(workspace: Workspace) -> None:
    send(workspace, 1, temperature_c=-127.0)
    clock = Clock(FIRST + HOUR)
    with at_work(workspace, clock) as (streaming, store):
        drain(streaming, clock)
        (state,) = stream_states(workspace, streaming.ring, store, FIRST + HOUR)
    assert state.state == "sensor at fault"
    (event,) = [each for each in state.events if each.kind == "thermometer"]
    assert (event.start, event.end) == (FIRST, FIRST + HOUR)
    assert "temperature_c is -127" in event.detail
    assert state.hour is not None
    assert math.isnan(state.hour.temperature_c)


def test_streams_tell_how_they_are(workspace: Workspace) -> None:
    send(workspace, 1)
    clock = Clock(FIRST + HOUR)
    with at_work(workspace, clock) as (streaming, store):
        (before,) = stream_states(workspace, streaming.ring, store, FIRST + HOUR)
        assert (before.state, before.window) == ("live", None)
        drain(streaming, clock)
        (state,) = stream_states(workspace, streaming.ring, store, FIRST + HOUR)
        assert state.behind == timedelta(0)
        assert state.lost_share == 0
        assert state.hour is not None
        (silent,) = stream_states(workspace, streaming.ring, store, FIRST + 3 * HOUR)
        assert silent.state == "silent"
        (ahead,) = stream_states(workspace, streaming.ring, store, FIRST - HOUR)
        assert ahead.state == "clock ahead"
