"""`shm stream`: what is live, what was lost, what was noticed; keeping and exporting samples."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from shm.documents import format_time
from shm.pipeline import utc_now
from shm.read import read
from shm.read.chunk_document import chunk_document
from shm.store import Workspace
from shm.store.ring import Ring, ring_of
from shm.values import Recording
from shm.values.stream import PERIOD, period_start
from tests.cli.conftest import Shm
from tests.helpers.outboxes import entered
from tests.helpers.streams import a_chunk, a_reading, a_window, an_event, with_stream
from tests.helpers.workspaces import make_workspace


@pytest.fixture
def start() -> datetime:
    """Return the full ten minutes half an hour ago."""
    return period_start(utc_now() - 4 * PERIOD, PERIOD)


@pytest.fixture
def bridge(tmp_path: Path, start: datetime) -> Workspace:
    """Half an hour, of which the twelfth minute is missing; what is over is sealed."""
    workspace = with_stream(make_workspace(tmp_path / "bridge"))
    with workspace.store() as store:
        now = [start]
        ring = ring_of(workspace, lambda: now[0], store.streams.save_event)
        for minute in range(30):
            now[0] = start + timedelta(minutes=minute)
            if minute != 12:
                ring.append(chunk_document(a_chunk(minute, now[0], samples=6000)))
        ring.seal(utc_now() + timedelta(minutes=1))
    return workspace


@pytest.fixture
def on_ring(shm: Shm, bridge: Workspace) -> Shm:
    return shm.at(bridge)


def test_table_of_streams(on_ring: Shm, bridge: Workspace, start: datetime) -> None:
    with bridge.store() as store:
        store.streams.save_window(a_window())
    ended = on_ring("stream", "--json")
    assert ended.code == 0
    (row,) = ended.document["streams"]
    assert (row["name"], row["hanger"], row["state"]) == ("h3", 3, "late")
    assert row["last_sample"] == format_time(start + timedelta(minutes=30))
    assert row["lag_s"] > 0
    assert row["received_hz"] == 100.0
    assert row["lost_share_24h"] == pytest.approx(1 / 30)
    assert row["ring_bytes"] > 100_000
    assert (row["last_window_kind"], row["last_window_how"]) == ("wind", "tracked")
    assert row["apart_s_24h"] == 0
    said = on_ring("stream").out
    assert "3.33%" in said
    assert "late" in said


def test_a_stream_that_never_sent_or_sends_now(shm: Shm, tmp_path: Path) -> None:
    workspace = with_stream(make_workspace(tmp_path / "other"))
    (row,) = shm.at(workspace).json("stream")["streams"]
    assert (row["state"], row["last_sample"], row["lag_s"]) == ("never sent", None, None)
    assert row["lost_share_24h"] is None
    Ring(workspace.folder / "ring").append(chunk_document(a_chunk(0, utc_now())))
    assert "live" in shm.at(workspace)("stream").out


def test_stream_differs_from_hammer_tests(shm: Shm, tmp_path: Path) -> None:
    workspace = with_stream(make_workspace(tmp_path / "both"))
    with workspace.store() as store:
        (test,) = entered(store, [1])
        lower = replace(test.test.modes[0], frequency_hz=test.test.modes[0].frequency_hz * 0.99)
        hour = replace(a_reading(), start=test.time, modes=(lower,))
        store.streams.save_pooled(replace(hour, start=test.time - timedelta(days=3)))
        (row,) = shm.at(workspace).json("stream")["streams"]
        assert (row["ambient_bias"], row["hammer_tests"]) == (None, 0)
        store.streams.save_pooled(hour)
    (row,) = shm.at(workspace).json("stream")["streams"]
    assert row["hammer_tests"] == 1
    assert row["ambient_bias"] == pytest.approx(math.log(0.99), abs=1e-6)
    assert row["ambient_bias"] < -row["ambient_bias_sd"] < 0
    assert "differ from those of hammer" in shm.at(workspace)("stream").out


def test_events_are_listed(on_ring: Shm, bridge: Workspace, start: datetime) -> None:
    with bridge.store() as store:
        store.streams.save_event(an_event())  # of months ago
    ended = on_ring("stream", "--events", "--json")
    (event,) = ended.document["events"]
    assert (event["kind"], event["start"]) == ("gap", format_time(start + timedelta(minutes=12)))
    assert "6000 samples" in on_ring("stream", "--events").out


@pytest.mark.parametrize("name", ["h3.csv", "h3.h5"])
def test_an_export_is_a_recording_with_what_is_missing_empty(
    on_ring: Shm, bridge: Workspace, start: datetime, tmp_path: Path, name: str
) -> None:
    file = tmp_path / name
    times = [format_time(start + timedelta(minutes=minute)) for minute in (11, 14)]
    ended = on_ring("stream", "export", "h3", *times, file)
    assert ended.code == 0
    assert "18000 samples of 2 channels" in ended.out
    found = read(file)
    assert isinstance(found, Recording)
    assert (found.hanger, found.time, found.temperature_c) == (
        3,
        start + timedelta(minutes=11),
        11.5,
    )
    assert [(c.plane, c.x_m) for c in found.channels] == [
        ("transverse", 3.0),
        ("longitudinal", 3.0),
    ]
    assert found.channels[1].full_scale == 20.0
    values = found.channels[0].values
    assert np.allclose(values[:6000], a_chunk(11, samples=6000).values[0], rtol=1e-5)
    assert np.isnan(values[6000:12_000]).all()
    assert np.allclose(values[12_000:], a_chunk(13, samples=6000).values[0], rtol=1e-5)


def test_kept_samples_stay(on_ring: Shm, bridge: Workspace, start: datetime) -> None:
    times = [format_time(start + timedelta(minutes=minute)) for minute in (21, 22)]
    arguments = ("stream", "keep", "h3", *times, "--why", "a train")
    assert on_ring(*arguments).code == 0
    ring = Ring(bridge.folder / "ring")
    ring.sweep(utc_now() + timedelta(days=400), 30)
    assert ring.periods("h3", start) == (start + 2 * PERIOD,)


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("export", "h3", "yesterday", "2026-05-02", "x.csv"), 2, "not an ISO 8601 time"),
        (("export", "h3", "2026-05-01T10:00", "2026-05-01T11:00", "x.csv"), 4, "has no sample"),
        (("export", "h3", "2026-05-01", "2027-05-01", "x.csv"), 2, "more than the 10000000"),
        (("keep", "h3", "2026-05-01T10:00", "2026-05-01T11:00"), 2, "--why"),
    ],
)
def test_what_cannot_be_done_is_said(
    on_ring: Shm, bridge: Workspace, arguments: tuple[str, ...], code: int, said: str
) -> None:
    ended = on_ring("stream", *arguments)
    assert ended.code == code
    assert said in ended.said
