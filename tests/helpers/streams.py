"""Permanent sensors for tests: a stream, what its windows say, chunks of it."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np

from shm.store import Store, Workspace
from shm.store.ring import Ring
from shm.store.ring_days import StreamDays
from shm.values import ShapePoint
from shm.values.modes import Mode
from shm.values.stream import (
    Chunk,
    Period,
    PooledReading,
    Stream,
    StreamChannel,
    StreamEvent,
    Window,
    WindowReading,
    time_of,
)
from tests.helpers.nouns import NOW

STREAM = Stream(
    "h3",
    3,
    100.0,
    (StreamChannel("acc_1", "transverse", 3.0), StreamChannel("acc_2", "longitudinal", 3.0, 20.0)),
)
MODES = (
    Mode("transverse", 1, 5.8, 0.0016, 0.004, shape=(ShapePoint(3.0, 1.0),)),
    Mode("longitudinal", 2, 11.9, 0.002),
)


def a_window(minutes: float = 0.0, modes: tuple[Mode, ...] = MODES) -> WindowReading:
    """What ten minutes said."""
    start = NOW + timedelta(minutes=minutes)
    window = Window("h3", 3, start, 600.0, "wind", 0.012, temperature_c=11.5)
    return WindowReading(window, modes, "tracked" if modes else "none")


def a_reading(hours: float = 0.0, period: Period = "hour") -> PooledReading:
    """What an hour or a day said."""
    return PooledReading("h3", 3, NOW + timedelta(hours=hours), period, MODES, 6, 0, 0.012, 11.5)


def an_event(minutes: float = 0.0) -> StreamEvent:
    start = NOW + timedelta(minutes=minutes)
    return StreamEvent("h3", "gap", start, start + timedelta(seconds=5), "500 samples are missing")


def fill_streams(store: Store) -> None:
    """A row in each table of permanent sensors."""
    store.streams.save_window(a_window())
    store.streams.save_pooled(a_reading(), b"state")
    store.streams.save_event(an_event())


def list_excluded(ring: Ring) -> list[tuple[datetime, str]]:
    """Return when each chunk of `h3` begins that does not count, with the reason."""
    days = StreamDays(ring.folder / "h3")
    rows = days.rows(days.paths(), "excluded <> ''")
    return [(time_of(row.start_us), row.excluded) for row in rows]


def a_chunk(
    sequence: int,
    start: datetime | None = None,
    samples: int = 500,
    stream: Stream = STREAM,
    **changes: object,
) -> Chunk:
    """Five seconds of noise, the same for the same number: each follows on the one before."""
    rate = stream.sampling_rate_hz
    values = np.random.default_rng(sequence).normal(size=(len(stream.channels), samples))
    values_of: dict[str, object] = {
        "stream": stream.name,
        "sequence": sequence,
        "start": start or NOW + timedelta(seconds=sequence * samples / rate),
        "sampling_rate_hz": rate,
        "channels": tuple(channel.name for channel in stream.channels),
        "values": values.astype(np.float32),
        "temperature_c": 11.5,
        **changes,
    }
    return Chunk(**values_of)  # type: ignore[arg-type]


TABLES = """
[[stream]]
name = "h3"
hanger = 3
sampling_rate_hz = 100
[[stream.channel]]
name = "acc_1"
plane = "transverse"
x_m = 3.0
[[stream.channel]]
name = "acc_2"
plane = "longitudinal"
x_m = 3.0
full_scale = 20.0
"""


def with_stream(workspace: Workspace) -> Workspace:
    """The workspace with the stream `h3`."""
    path = workspace.folder / "bridge.toml"
    path.write_text(path.read_text() + TABLES)
    return workspace.reopened()
