"""Streams that are asked for by SeedLink: every sample once, whatever ends when."""

from __future__ import annotations

import random
import shutil
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from pymseed import MS3Record, nslc2sourceid

import shm_daemon
from shm.store import Workspace
from shm.store.ring import Ring
from shm.store.streams import list_stream_events
from shm.values import FloatArray
from shm_daemon.heartbeat import HEARTBEAT
from shm_daemon.seedlink import Pace, StreamAskers
from shm_daemon.wakeup import Wakeup
from tests.helpers.flows import Clock, threads
from tests.helpers.seedlink_servers import a_seedlink_server
from tests.helpers.waiting import until
from tests.helpers.workspaces import make_workspace

RATE = 100.0
START = datetime(2026, 5, 1, 10, 0, 7, 120000, tzinfo=UTC)
NOW = START + timedelta(minutes=20)
COUNT = 2e-6
CODES = ("HN1", "HN2")
QUICK = Pace(retry_s=0.05)

STREAM = """
[[stream]]
name = "h3"
hanger = 3
kind = "seedlink"
server = "127.0.0.1:{port}"
channels = ["XX_HGR3_00_HN1", "XX_HGR3_00_HN2"]
calibration = [2e-6, 2e-6]
sampling_rate_hz = 100
[[stream.channel]]
name = "acc_1"
plane = "transverse"
x_m = 3.0
[[stream.channel]]
name = "acc_2"
plane = "longitudinal"
x_m = 3.0
"""


def samples(seconds: float, seed: int = 1) -> np.ndarray:
    """Return counts of both channels, shape (channels, samples)."""
    rng = np.random.default_rng(seed)
    return rng.integers(-50_000, 50_000, (2, round(seconds * RATE))).astype(np.int32)


def records_of(counts: np.ndarray, start: datetime = START, code: str = "HN1") -> list[bytes]:
    """Return one channel as miniSEED records of 512 bytes."""
    made: list[bytes] = []
    record = MS3Record()
    record.sourceid = nslc2sourceid("XX", "HGR3", "00", code)
    record.formatversion, record.reclen, record.samprate = 2, 512, RATE
    record.starttime = (
        round((start - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() * 1e6) * 1000
    )
    record.pubversion = 1
    made.extend(bytes(each) for each in record.generate(counts, "i"))
    return made


def interleaved(counts: np.ndarray) -> list[bytes]:
    """Return the records of both channels as a digitizer sends them, one after the other."""
    one, two = (records_of(row, code=code) for row, code in zip(counts, CODES, strict=True))
    return [each for pair in zip(one, two, strict=False) for each in pair]


@pytest.fixture
def bridge(tmp_path: Path) -> Workspace:
    return make_workspace(tmp_path / "bridge", settings={"workers": 1})


def asking(workspace: Workspace, port: int) -> Workspace:
    path = workspace.folder / "bridge.toml"
    path.write_text(path.read_text().partition("\n[[stream]]")[0] + STREAM.format(port=port))
    return workspace.reopened()


@contextmanager
def asked(workspace: Workspace, pace: Pace = QUICK) -> Iterator[None]:
    with closing(StreamAskers(Clock(NOW), pace)) as askers:
        askers.use(workspace)
        yield


def stored(workspace: Workspace) -> FloatArray:
    """Return all samples of the ring, in m/s2; between pieces a column of NaN."""
    ring = Ring(workspace.folder / "ring")
    pieces = ring.read("h3", START - timedelta(hours=1), NOW + timedelta(hours=1))
    gap = np.full((2, 1), np.nan)
    parts = [part for piece in pieces for part in (gap, piece.values)]
    return np.concatenate(parts[1:], axis=1) if parts else np.empty((2, 0))


def n_stored(workspace: Workspace) -> int:
    return stored(workspace).shape[1]


def events(workspace: Workspace) -> list[tuple[str, str]]:
    with workspace.store() as store:
        found = list_stream_events(store, "h3", START - timedelta(days=1))
    return [(each.kind, each.detail) for each in found]


def full(counts: np.ndarray, until_at: datetime) -> int:
    """Return how many samples lie before a time."""
    return min(counts.shape[1], round((until_at - START).total_seconds() * RATE))


END_OF_FULL = datetime(2026, 5, 1, 10, 4, tzinfo=UTC)


def test_samples_are_stored_exactly(bridge: Workspace) -> None:
    counts = samples(250)
    with a_seedlink_server(interleaved(counts)) as server:
        workspace = asking(bridge, server.port)
        n_full = full(counts, END_OF_FULL)
        with asked(workspace):
            until(lambda: n_stored(workspace) >= n_full, 30.0)
    np.testing.assert_allclose(stored(workspace), counts[:, :n_full] * COUNT, rtol=1e-6)
    assert "SELECT 00HN1" in server.told
    assert not events(workspace)


def test_dropped_connections_lose_nothing(bridge: Workspace) -> None:
    counts = samples(250)
    records = interleaved(counts)
    # Each connection brings a little more than a minute of both channels.
    with a_seedlink_server(records, drop_after=len(records) // 3) as server:
        workspace = asking(bridge, server.port)
        n_full = full(counts, END_OF_FULL)
        with asked(workspace):
            until(lambda: n_stored(workspace) >= n_full, 30.0)
    assert server.connections > 2
    assert len(server.sent) > len(records)  # what was not on disk came again
    np.testing.assert_allclose(stored(workspace), counts[:, :n_full] * COUNT, rtol=1e-6)


@pytest.mark.parametrize("is_lost", [False, True])
def test_daemon_goes_on_where_it_stopped(bridge: Workspace, is_lost: bool) -> None:
    counts = samples(250)
    records = interleaved(counts)
    with a_seedlink_server(records[: len(records) // 2]) as server:
        workspace = asking(bridge, server.port)
        n_half = full(counts, datetime(2026, 5, 1, 10, 2, tzinfo=UTC))
        with asked(workspace):
            until(lambda: n_stored(workspace) >= n_half, 30.0)
        asked_first = [line for line in server.told if line.startswith("DATA")]
        if is_lost:  # with its state: the server sends all from the beginning, which is known
            shutil.rmtree(workspace.folder / "seedlink")
        server.records = records
        n_full = full(counts, END_OF_FULL)
        with asked(workspace):
            until(lambda: n_stored(workspace) >= n_full, 30.0)
        again = [line for line in server.told if line.startswith("DATA")][len(asked_first) :]
    assert asked_first == ["DATA"]
    assert (again == ["DATA"]) == is_lost
    np.testing.assert_allclose(stored(workspace), counts[:, :n_full] * COUNT, rtol=1e-6)
    assert [kind for kind, _ in events(workspace) if kind in ("doubled", "overlap")] == []


def test_server_down_is_said_and_waited_for(bridge: Workspace) -> None:
    counts = samples(130)
    with a_seedlink_server([]) as server:
        port = server.port
    workspace = asking(bridge, port)
    with asked(workspace):
        until(lambda: events(workspace), 30.0)
        ((kind, detail),) = events(workspace)
        assert kind == "refused"
        assert f"127.0.0.1:{port}: Could not connect" in detail
        with a_seedlink_server(interleaved(counts), port=port):
            until(lambda: n_stored(workspace) >= full(counts, START + timedelta(seconds=112)), 30.0)


def test_dead_channel_is_nan(bridge: Workspace) -> None:
    counts = samples(250)
    with a_seedlink_server(records_of(counts[0])) as server:
        workspace = asking(bridge, server.port)
        n_full = full(counts, datetime(2026, 5, 1, 10, 2, tzinfo=UTC))
        with asked(workspace, Pace(retry_s=0.05, patience_s=60.0)):
            until(lambda: n_stored(workspace) >= n_full, 30.0)
    found = stored(workspace)[:, :n_full]
    np.testing.assert_allclose(found[0], counts[0, :n_full] * COUNT, rtol=1e-6)
    assert np.isnan(found[1]).all()


def test_gap_of_server_is_a_gap(bridge: Workspace) -> None:
    counts = samples(370)
    records = interleaved(counts)
    n = len(records)
    with a_seedlink_server([*records[: n // 3], *records[2 * n // 3 :]]) as server:
        workspace = asking(bridge, server.port)
        with asked(workspace):
            until(lambda: len(_pieces(workspace)) > 1, 30.0)


def _pieces(workspace: Workspace) -> Sequence[object]:
    ring = Ring(workspace.folder / "ring")
    return ring.read("h3", START - timedelta(hours=1), NOW + timedelta(hours=1))


def test_daemon_takes_stream_over(bridge: Workspace) -> None:
    counts = samples(130)
    with a_seedlink_server(interleaved(counts)) as server:
        wakeup, clock = Wakeup(), Clock(NOW)

        def change_and_wait() -> None:
            until(lambda: (bridge.folder / HEARTBEAT).exists(), 30.0)
            asking(bridge, server.port)
            until(lambda: n_stored(bridge) > 0, 30.0)
            wakeup.stop()

        thread = threading.Thread(target=change_and_wait)
        thread.start()
        shm_daemon.run(bridge, clock=clock, wakeup=wakeup, make_executor=threads)
        thread.join()
    assert n_stored(bridge) > 0


@pytest.mark.parametrize("jump", [timedelta(hours=5, minutes=1), timedelta(days=27_000)])
def test_clock_that_jumps(bridge: Workspace, jump: timedelta) -> None:
    counts = samples(250)
    wrong = samples(130, seed=2)
    records = interleaved(counts)
    ahead = [
        record
        for pair in zip(
            *(records_of(row, START + jump, code) for row, code in zip(wrong, CODES, strict=True)),
            strict=True,
        )
        for record in pair
    ]
    half = len(records) // 4 * 2
    with a_seedlink_server([*records[:half], *ahead, *records[half:]]) as server:
        workspace = asking(bridge, server.port)
        n_full = full(counts, END_OF_FULL)
        with asked(workspace):
            until(lambda: n_stored(workspace) >= n_full, 30.0)
    found, true = stored(workspace)[:, :n_full], counts[:, :n_full] * COUNT
    there = np.isfinite(found)
    np.testing.assert_allclose(found[there], true[there], rtol=1e-6)
    # Where the clock jumps one channel may be a record ahead: of the other's as much is lost.
    assert np.count_nonzero(~there) < 2 * RATE
    is_refused = any("which is to come" in detail for _, detail in events(workspace))
    assert is_refused == (jump > timedelta(days=1))


def test_late_record_does_no_harm(bridge: Workspace) -> None:
    counts = samples(250)
    records = records_of(counts[0])
    late = records_of(counts[1], code="HN2")[:1]
    with a_seedlink_server([*records, *late]) as server:
        workspace = asking(bridge, server.port)
        pace = Pace(retry_s=0.05, patience_s=60.0)
        with asked(workspace, pace):
            until(lambda: len(records) + 1 in server.sent, 30.0)
            server.add(*records_of(samples(130)[0], START + timedelta(seconds=250)))
            n_full = full(samples(400), START + timedelta(seconds=292))
            until(lambda: n_stored(workspace) >= n_full, 30.0)
    found = stored(workspace)[0, : counts.shape[1]]
    np.testing.assert_allclose(found, counts[0] * COUNT, rtol=1e-6)


def test_garbage_is_said(bridge: Workspace) -> None:
    random.seed(1)
    with a_seedlink_server([random.randbytes(512)] * 3) as server:
        workspace = asking(bridge, server.port)
        with asked(workspace):
            until(lambda: events(workspace), 30.0)
    assert "miniSEED" in events(workspace)[0][1]
