"""Hours that come late are pooled and watched in their place; what they owe is told once."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from shm.pipeline import stream_days, stream_steps, streaming
from shm.pipeline.lineage import discarded_of_baselines
from shm.pipeline.stream_days import hand_on_day
from shm.pipeline.streaming import Streaming
from shm.store import Stage, Store, Workspace
from shm.store.streams import list_pooled, load_stream_watch
from shm.store.tests import list_baseline_tests
from shm.values import Mode
from shm.values.stream import PooledReading
from shm.watch.engine.kept_state import from_bytes, to_bytes
from shm.watch.sensors.stream_thermometer import Thermometer
from shm.watch.sensors.stream_watch import StreamState, watch_reading
from tests.helpers.flows import Clock, ingest
from tests.helpers.live_streams import drain, found_in, with_live_streams
from tests.helpers.workspaces import make_workspace

FIRST = datetime(2026, 6, 1, tzinfo=UTC)
HOUR = timedelta(hours=1)
LOST = 84  # the hour from which 5 % of the tension are gone, amid those that come late


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """A stream whose windows, one an hour, are made up: three exact modes a plane, and noise."""
    made = with_live_streams(make_workspace(tmp_path / "bridge"))
    hanger, stream = made.bridge.hangers[0], made.bridge.streams[0]

    def window(start: datetime) -> stream_steps.WindowFound:
        hour = (start - FIRST) // HOUR
        return found_in(stream, hanger, start, hour, factor=0.95 if hour >= LOST else 1.0)

    starts: list[datetime] = []
    real = Streaming._read
    monkeypatch.setattr(
        Streaming,
        "_read",
        lambda self, stream, start: (starts.append(start), real(self, stream, start))[1],
    )
    monkeypatch.setattr(stream_steps, "read_stream_window", lambda *_: window(starts[-1]))
    monkeypatch.setattr(stream_days, "PERIOD", HOUR)
    monkeypatch.setattr(streaming, "evaluate_silent_streams", lambda *_: None)  # the ring is empty
    return made


@pytest.fixture
def working(workspace: Workspace) -> Iterator[tuple[Streaming, Store, Clock]]:
    clock = Clock(FIRST + timedelta(days=6))
    with workspace.store() as store, ThreadPoolExecutor(1) as threads:
        streaming = Streaming(workspace, store, threads, clock=clock)
        yield streaming, store, clock
        streaming.close()


def come(working: tuple[Streaming, Store, Clock], *hours: int) -> None:
    streaming, _, clock = working
    name = streaming.workspace.bridge.streams[0].name
    streaming.note_sealed([(name, FIRST + hour * HOUR) for hour in hours])
    drain(streaming, clock)


def hours_of(store: Store) -> tuple[PooledReading, ...]:
    return list_pooled(store, 3, "hour", FIRST, FIRST + timedelta(days=9))


def in_order(workspace: Workspace, readings: tuple[PooledReading, ...]) -> list[Any]:
    kept, found = None, []
    for reading in readings:
        found.append(watch_reading(None, reading, workspace.bridge.hangers[0], kept))
        kept = found[-1].kept
    return found


def test_what_was_offline_is_watched_in_its_place_and_its_alert_raised_once(
    workspace: Workspace, working: tuple[Streaming, Store, Clock]
) -> None:
    _, store, _ = working
    come(working, *range(80))
    come(working, 100, 101)  # live again; the store of the logger follows, its middle first
    assert not store.alerts.list_all()
    assert days_of(workspace) == [1, 2, 3]  # of the fourth there are eight hours
    come(working, *range(85, 99), 83, 82, 81, 80, 84, 99)

    readings = hours_of(store)
    assert [each.start for each in readings] == [FIRST + n * HOUR for n in range(101)]
    (raised,) = store.alerts.list_all()
    assert FIRST + LOST * HOUR < raised.alert.time < FIRST + (LOST + 8) * HOUR
    come(working, *range(102, 110))
    assert len(store.alerts.list_all()) == 1
    assert not store.alerts.list_all(standing=False)

    readings = hours_of(store)
    found = in_order(workspace, readings)
    assert [each.compensated_shift for each in found[72:]] == pytest.approx(
        [each.compensated_shift for each in readings[72:]], nan_ok=True
    )
    assert [each.alert.key for each in found if each.alert] == [raised.alert.key]
    kept = load_stream_watch(store, 3)
    assert kept is not None
    state = from_bytes(StreamState, kept.content)
    begun = replace(state, settled_day=0.0, thermometer=Thermometer())
    assert to_bytes(begun) == found[-1].kept
    assert days_of(workspace) == [1, 2, 3, 4]


def test_a_part_of_a_day_is_a_test_only_once_no_more_has_come_for_hours(
    workspace: Workspace, working: tuple[Streaming, Store, Clock]
) -> None:
    streaming, _, clock = working
    come(working, *range(30), 60)
    assert days_of(workspace) == [1]
    clock.pass_by(5 * 3600)
    come(working, 30, 61)  # some of the rest: it is waited for again
    clock.pass_by(5 * 3600)
    come(working)
    assert days_of(workspace) == [1]
    clock.pass_by(3600)
    come(working, 62)
    assert days_of(workspace) == [1, 2]
    come(working, *range(31, 47), 72)
    assert days_of(workspace) == [1, 2]  # the third lacks twelve hours
    drain_in_a_hurry(streaming)
    assert days_of(workspace) == [1, 2, 3]


def drain_in_a_hurry(streaming: Streaming) -> None:
    while streaming.advance(hurry=True):
        for running in streaming.under_way:
            running.exception(timeout=60)


def days_of(workspace: Workspace) -> list[int]:
    return sorted(int(path.name[-13:-11]) for path in workspace.spool.glob("*.modes.json"))


def test_whoever_comes_next_ends_what_late_hours_began(
    workspace: Workspace, working: tuple[Streaming, Store, Clock]
) -> None:
    streaming, store, clock = working
    come(working, *range(10), *range(14, 20))
    name = workspace.bridge.streams[0].name
    streaming.note_sealed([(name, FIRST + hour * HOUR) for hour in range(10, 14)])
    for _ in range(6):  # the watch has gone back, and is killed on its way
        streaming.advance()
        for running in streaming.under_way:
            running.exception(timeout=60)
    assert len(hours_of(store)) < 19

    with ThreadPoolExecutor(1) as threads:
        drain(Streaming(workspace, store, threads, clock=clock), clock)
    readings = hours_of(store)
    kept = load_stream_watch(store, 3)
    assert kept is not None
    assert len(readings) == 19
    assert from_bytes(StreamState, kept.content).readings == 19
    assert readings[-1].learning == in_order(workspace, readings)[-1].learning


def test_the_whole_day_takes_the_place_of_what_was_known_of_it(workspace: Workspace) -> None:
    from shm.monitor import as_modal_test

    with workspace.store() as store:
        for day, hz in ((0, 2.0), (1, 2.0), (1, 2.0), (1, 2.001), (0, 2.002)):
            modes = tuple(Mode("transverse", n, hz * n, 1e-3) for n in (1, 2, 3))
            reading = PooledReading(
                "hanger03", 3, FIRST + day * 24 * HOUR, "day", modes, 9, 0, 0.02, 10.0, 4.0
            )
            hand_on_day(workspace, store, as_modal_test(reading), FIRST + timedelta(days=2))
            ingest(workspace)
        found = [each.test.modes[0].frequency_hz for each in store.tests.list_all(3)]
        baseline = store.watch.baseline(3)
        assert baseline is not None
        assert any(each.stage == Stage.REFUSED for each in list_baseline_tests(store, baseline))
        assert discarded_of_baselines(store) == {}  # no person discarded it
    assert found == [2.002, 2.001]
