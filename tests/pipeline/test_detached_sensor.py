"""Sensors that come off their hanger and lie on the deck, through the front of the streams."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import timedelta

import numpy as np
import pytest
import scipy

from shm.pipeline.stream_health import StreamHealth, heard, leads_of
from shm.pipeline.streaming import Streaming
from shm.read.chunk_document import chunk_document
from shm.simulate.ambient import streamed
from shm.store import Store, Workspace
from shm.store.ring import ring_of
from shm.store.streams import find_last_window, list_stream_events, list_windows
from shm.values import PLANES, FloatArray, Mode, Plane
from shm.values.stream import StreamEvent, WindowReading
from tests.helpers.flows import Clock
from tests.helpers.live_streams import CALM, FIRST, HOUR, drain, with_live_streams
from tests.helpers.workspaces import make_workspace

DECK_HZ = (3.3, 7.9, 12.2, 15.7, 21.4)
WINDOW = timedelta(minutes=10)
OFF = FIRST + 3 * WINDOW
BACK = OFF + 9 * WINDOW
END = BACK + 2 * WINDOW


@dataclass(frozen=True)
class Followed:
    """What the front reported of a stream whose sensors were off for more than an hour."""

    windows: tuple[WindowReading, ...]
    events: tuple[StreamEvent, ...]
    while_off: StreamHealth
    after: StreamHealth

    def modes(self, plane: Plane, *, after: bool) -> list[Mode]:
        return [
            mode
            for each in self.windows
            if (each.window.start >= BACK if after else each.window.start < OFF)
            for mode in each.modes
            if mode.plane == plane
        ]


def deck_motion(rng: np.random.Generator, count: int, rate_hz: float) -> FloatArray:
    """Make what a sensor on the deck measures, as strong as a hanger in a light wind."""
    moved = np.zeros(count)
    for hz in DECK_HZ:
        pole = np.exp((-0.01 + 1j) * 2 * np.pi * hz / rate_hz)
        own = scipy.signal.lfilter(
            [1.0], [1.0, -2 * pole.real, abs(pole) ** 2], rng.normal(size=count)
        )
        moved += 2e-3 * own / own.std()
    return moved + 3e-4 * rng.normal(size=count)


def remember_sound_day(store: Store, known: WindowReading) -> None:
    """Save a day of windows before, each as one that was read."""
    for number in range(1, 145):
        window = replace(known.window, start=FIRST - number * WINDOW)
        store.streams.save_window(replace(known, window=window))


def follow(workspace: Workspace, planes: tuple[Plane, ...]) -> Followed:
    """Send sound windows, then some with the sensors of `planes` on the deck, and sound ones."""
    (stream,), (hanger,) = workspace.bridge.streams, workspace.bridge.hangers
    ring, clock, rng = ring_of(workspace), Clock(FIRST), np.random.default_rng(4)
    chunks = list(streamed(hanger, stream, CALM, FIRST, (END - FIRST).total_seconds(), 5))
    states = []
    with workspace.store() as store, ThreadPoolExecutor(1) as threads:
        streaming = Streaming(workspace, store, threads, clock=clock)
        for first, end in ((FIRST, OFF), (OFF, BACK), (BACK, END)):
            for chunk in (each for each in chunks if first <= each.start < end):
                values = chunk.values.copy()
                for row, channel in enumerate(stream.channels):
                    if first == OFF and channel.plane in planes:
                        values[row] = deck_motion(rng, values.shape[1], stream.sampling_rate_hz)
                ring.append(chunk_document(replace(chunk, values=values)))
            clock.now = end + HOUR
            drain(streaming, clock)
            if first == FIRST:
                remember_sound_day(store, find_last_window(store, stream.name))
            states += heard(workspace, store, end)
        streaming.close()
        windows = list_windows(store, hanger.id, FIRST, END)
        return Followed(windows, list_stream_events(store, stream.name, FIRST), *states[1:])


@pytest.fixture(scope="module")
def transverse(tmp_path_factory: pytest.TempPathFactory) -> Followed:
    """Follow a stream whose two transverse sensors come off; only to be looked at."""
    folder = tmp_path_factory.mktemp("one_plane") / "bridge"
    return follow(with_live_streams(make_workspace(folder)), ("transverse",))


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Followed:
    """Follow a stream of which all sensors come off; only to be looked at."""
    folder = tmp_path_factory.mktemp("both_planes") / "bridge"
    return follow(with_live_streams(make_workspace(folder)), PLANES)


def lost(found: Followed) -> list[StreamEvent]:
    return [each for each in found.events if each.kind == "lost modes"]


def test_detached_plane_is_reported(transverse: Followed) -> None:
    first = min(each.end for each in lost(transverse))
    assert OFF + HOUR <= first <= OFF + 9 * WINDOW
    assert {each.channel for each in lost(transverse)} == {"acc_1", "acc_3"}
    assert transverse.while_off.state == "sensor at fault"
    (lead,) = leads_of([transverse.while_off])
    assert "sensor at fault" in lead.words
    assert max(each.end for each in lost(transverse)) <= BACK + HOUR / 6
    assert transverse.after.state in ("live", "sensor at fault")  # a fault is shown for an hour


def test_detached_stream_is_reported(both: Followed) -> None:
    first = min(each.end for each in lost(both))
    assert OFF + HOUR <= first <= OFF + 9 * WINDOW
    assert {each.channel for each in lost(both)} == {""}
    assert both.while_off.state == "sees nothing"
