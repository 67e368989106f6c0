"""Chunks by HTTP, by MQTT and in rolling files: on disk before they are acknowledged."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import httpx
import numpy as np
import pytest

import shm_daemon
from shm.errors import StoreError
from shm.pipeline import utc_now
from shm.read.chunk_document import chunk_document
from shm.store import Workspace
from shm.store.ring import Ring
from shm.store.streams import list_stream_events
from shm.values import Channel, Recording
from shm.values.stream import Chunk
from shm_daemon.mqtt import messages
from shm_daemon.spool import scan
from shm_daemon.streams import StreamKeeper
from tests.helpers.brokers import a_broker
from tests.helpers.flows import threads
from tests.helpers.streams import a_chunk, with_stream
from tests.helpers.waiting import until
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace
from tests.helpers.written import write

URL = "/api/streams/h3/chunks"
HOUR = timedelta(hours=1)


@pytest.fixture
def bridge(tmp_path: Path) -> Workspace:
    settings = {"spool_stable_seconds": 0.0, "workers": 1}
    return with_stream(make_workspace(tmp_path / "bridge", settings=settings))


@pytest.fixture
def client(bridge: Workspace) -> Iterator[httpx.Client]:
    with served(bridge) as site, site.client(site.write_token) as client:
        yield client


def now() -> datetime:
    return utc_now().replace(microsecond=0)


def recent(number: int = 0, **changes: object) -> Chunk:
    """Of the last minutes."""
    start = now() - timedelta(minutes=5) + timedelta(seconds=5 * number)
    return a_chunk(number, start, **changes)  # type: ignore[arg-type]


def samples_of(workspace: Workspace) -> int:
    ring = Ring(workspace.folder / "ring")
    pieces = ring.read("h3", utc_now() - 100 * HOUR, utc_now() + HOUR)
    return sum(piece.values.shape[1] for piece in pieces)


def events_of(workspace: Workspace) -> list[tuple[str, str]]:
    with workspace.store() as store:
        found = list_stream_events(store, None, utc_now() - 100 * HOUR)
    return [(event.kind, event.detail) for event in found]


# ---------------------------------------------------------------- HTTP


def test_a_chunk_is_acknowledged_once_it_is_on_disk(
    client: httpx.Client, bridge: Workspace
) -> None:
    chunk = recent(7)
    for is_new in (True, False):
        answer = client.post(URL, content=chunk_document(chunk))
        assert answer.status_code == 202
        told = answer.json()
        assert (told["stream"], told["sequence"], told["is_new"]) == ("h3", 7, is_new)
        assert samples_of(bridge) == 500


def test_a_wrong_chunk_is_refused_with_its_reason_and_noted_once(
    client: httpx.Client, bridge: Workspace
) -> None:
    for number in range(2):
        answer = client.post(URL, content=chunk_document(recent(number, sampling_rate_hz=50.0)))
        assert answer.status_code == 422
        assert "50 Hz where bridge.toml says 100" in answer.json()["message"]
    assert client.post(URL, content=b"{}").status_code == 422
    other = client.post("/api/streams/h4/chunks", content=chunk_document(recent()))
    assert (other.status_code, samples_of(bridge)) == (422, 0)
    assert [kind for kind, _ in events_of(bridge)] == ["refused", "refused"]  # of h3 and of h4


def test_a_doubled_chunk_that_differs_is_refused_with_what_to_do(
    client: httpx.Client, bridge: Workspace
) -> None:
    first = recent(7)
    assert client.post(URL, content=chunk_document(first)).status_code == 202
    other = replace(first, values=recent(8).values)
    for _ in range(2):
        answer = client.post(URL, content=chunk_document(other))
        assert answer.status_code == 409
        assert "chunk 7 of stream h3" in answer.json()["message"]
        assert "under the next number" in answer.json()["remedy"]
    head = json.loads(chunk_document(first).partition(b"\n")[0])
    values = dict(zip(first.channels, first.values.astype(float).tolist(), strict=True))
    as_json = json.dumps({**head, "encoding": "", "values": values}).encode()
    assert client.post(URL, content=as_json).json()["is_new"] is False
    (piece,) = Ring(bridge.folder / "ring").read("h3", first.start, first.end)
    assert np.array_equal(piece.values, first.values)
    assert [kind for kind, _ in events_of(bridge)] == ["doubled", "doubled"]


def test_a_sender_is_told_when_to_come_again(
    client: httpx.Client, bridge: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise StoreError("the disk is full.", retry_after_s=60.0)

    monkeypatch.setattr(Ring, "place", full)
    answer = client.post(URL, content=chunk_document(recent()))
    assert answer.status_code == 503
    assert int(answer.headers["Retry-After"]) >= 30
    assert samples_of(bridge) == 0


def test_too_large_a_body_is_not_held(client: httpx.Client) -> None:
    answer = client.post(URL, content=bytes(33 << 20))
    assert answer.status_code == 413
    assert "33554432 that are taken" in answer.json()["message"]
    assert "at most 32 MiB and ten minutes" in answer.json()["remedy"]


# ---------------------------------------------------------------- MQTT


def test_chunks_by_mqtt_are_kept_apart_from_recordings(tmp_path: Path) -> None:
    with a_broker() as broker:
        settings = {"mqtt_url": broker.url}
        workspace = with_stream(make_workspace(tmp_path / "bridge", settings=settings))
        with messages(workspace):
            time.sleep(0.5)
            broker.publish("shm/test-bridge/stream/h3", b"no chunk")
            chunks = [recent(number) for number in (0, 1)]
            other = replace(chunks[1], values=chunks[0].values)
            for chunk in (*chunks, chunks[1], other):
                broker.publish("shm/test-bridge/stream/h3", chunk_document(chunk))
            broker.publish("shm/test-bridge/3/hit.csv", b"force,acc_1\n")
            until(lambda: scan(workspace.spool))
            assert samples_of(workspace) == 1000
        assert [path.name for path in scan(workspace.spool)] == ["hit.csv"]
        assert sorted(kind for kind, _ in events_of(workspace)) == ["doubled", "refused"]
        with messages(workspace):  # what cannot be used was acknowledged and does not come again
            time.sleep(0.5)
        assert len(events_of(workspace)) == 2


def test_a_disk_that_is_full_holds_chunks_up_and_loses_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with a_broker() as broker:
        settings = {"mqtt_url": broker.url}
        workspace = with_stream(make_workspace(tmp_path / "bridge", settings=settings))
        tried = []

        def full(*_: object) -> None:
            tried.append(1)
            raise StoreError("the disk is full.", retry_after_s=0.1)

        with messages(workspace):
            with monkeypatch.context() as patch:
                patch.setattr(Ring, "place", full)
                time.sleep(0.5)
                for number in range(3):
                    broker.publish("shm/test-bridge/stream/h3", chunk_document(recent(number)))
                until(lambda: len(tried) > 3)
            until(lambda: samples_of(workspace) == 1500)


# ---------------------------------------------------------------- rolling files


def a_file(folder: Path, name: str, start: datetime | None, seconds: int = 90) -> np.ndarray:
    """Return a recording of two channels in the format of the suffix."""
    folder.mkdir(parents=True, exist_ok=True)
    values = np.random.default_rng(seconds).normal(size=(2, 100 * seconds))
    channels = tuple(
        Channel(f"acc_{place}", "acceleration", row, "transverse", 3.0)
        for place, row in enumerate(values, 1)
    )
    write(Recording("", channels, 100.0, 3, start, 12.5), folder / name)
    return values


@pytest.fixture
def keeper(bridge: Workspace) -> Iterator[StreamKeeper]:
    keeper = StreamKeeper(bridge, utc_now)
    yield keeper
    keeper.close()


@pytest.mark.parametrize("name", ["a.csv", "a.mseed"])
def test_a_rolling_file_becomes_chunks(bridge: Workspace, keeper: StreamKeeper, name: str) -> None:
    folder, start = bridge.spool / "streams" / "h3", now() - HOUR
    values = a_file(folder, name, start)
    assert scan(bridge.spool) == {}
    assert keeper.turn() == 0
    assert list(folder.iterdir()) == []
    (piece,) = Ring(bridge.folder / "ring").read("h3", start - HOUR, start + HOUR)
    assert piece.start == start
    assert piece.temperature_c == 12.5
    assert np.allclose(piece.values, values, rtol=1e-5)


def test_files_that_follow_each_other_are_one_piece(
    bridge: Workspace, keeper: StreamKeeper
) -> None:
    folder, start = bridge.spool / "streams" / "h3", now() - HOUR
    sealed: list[object] = []
    keeper._sealed = sealed.extend
    for number in range(3):  # the logger's stamps are off by some milliseconds
        at = start + timedelta(seconds=90 * number, milliseconds=7 * number)
        a_file(folder, f"{number}.csv", at)
    while keeper.turn():
        continue
    assert sum(1 for _ in sealed) == 0  # they have only just come
    ring = Ring(bridge.folder / "ring")
    (piece,) = ring.read("h3", start - HOUR, start + HOUR)
    assert piece.values.shape == (2, 27_000)
    ring.seal(utc_now() + HOUR)
    assert events_of(bridge) == []


def test_a_file_that_is_read_again_after_a_crash_counts_once(
    bridge: Workspace, keeper: StreamKeeper, tmp_path: Path
) -> None:
    folder = bridge.spool / "streams" / "h3"
    a_file(folder, "a.csv", now() - HOUR)
    shutil.copytree(folder, tmp_path / "copy")
    keeper.turn()
    Ring(bridge.folder / "ring").seal(utc_now() + HOUR)
    shutil.copytree(tmp_path / "copy", folder, dirs_exist_ok=True)
    keeper.turn()
    assert samples_of(bridge) == 9000
    assert not Ring(bridge.folder / "ring").unsealed_periods("h3")


def test_what_files_do_not_say_is_said_once(bridge: Workspace, keeper: StreamKeeper) -> None:
    folder, start = bridge.spool / "streams" / "h3", now() - HOUR
    folder.mkdir(parents=True)
    rows = "\n".join(f"{x},{x}" for x in range(500))
    (folder / f"h3_{start:%Y%m%d_%H%M%S}.csv").write_text(f"A1,A2\n{rows}\n")
    common = 'sampling_rate_hz = 100\n[channel.A1]\nunit = "mg"\n[channel.A2]\nunit = "mg"\n'
    (folder / "stream.toml").write_text(common)
    keeper.turn()
    assert [path.name for path in folder.iterdir()] == ["stream.toml"]
    (piece,) = Ring(bridge.folder / "ring").read("h3", start, start + HOUR)
    assert piece.values[0, 100] == pytest.approx(0.980665)


@pytest.mark.parametrize(
    ("name", "folder", "said"),
    [
        ("a.csv", "h9", "is not described"),
        ("a.csv", "h3", "says no time"),
        ("torn.csv", "h3", ""),
        ("one_20990101_000000.csv", "h3", "has the channels acc_7"),
    ],
)
def test_a_file_that_cannot_be_used_is_laid_out_with_its_reason(
    bridge: Workspace, keeper: StreamKeeper, name: str, folder: str, said: str
) -> None:
    path = bridge.spool / "streams" / folder
    a_file(path, name, None)
    if name == "torn.csv":
        (path / name).write_bytes(b"\x00\x01\x02" * 100)
    if name.startswith("one"):
        lines = ["# sampling_rate_hz: 100", "# unit: m/s2", "acc_7", *map(str, range(500))]
        (path / name).write_text("\n".join(lines) + "\n")
    a_file(bridge.spool / "streams" / "h3", "sound.csv", now() - HOUR)
    while keeper.turn():
        continue
    reason = json.loads((bridge.quarantine.folder / f"{name}.reason.json").read_text())
    assert said in reason["message"]
    assert (bridge.quarantine.folder / name).exists()
    assert samples_of(bridge) == 9000
    assert [kind for kind, _ in events_of(bridge)] == ["refused"]


# ---------------------------------------------------------------- the daemon


def test_the_daemon_keeps_the_ring(bridge: Workspace) -> None:
    start = now() - 3 * HOUR
    a_file(bridge.spool / "streams" / "h3", "0.csv", start)
    old = replace(a_chunk(1), start=now() - 2 * HOUR)
    Ring(bridge.folder / "ring", clock=lambda: now() - HOUR).append(chunk_document(old))
    shm_daemon.run(bridge, once=True, make_executor=threads)
    assert samples_of(bridge) == 9500
    assert Ring(bridge.folder / "ring").periods("h3", now() - 24 * HOUR)
    assert list((bridge.spool / "streams" / "h3").iterdir()) == []
