"""The pages of permanent sensors, their metrics and what the doctor says of them."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import httpx
import pytest

from shm.store import Workspace
from shm.values import Mode
from shm.values.stream import PooledReading, StreamEvent, Window, WindowReading
from shm_daemon.doctor import Level, examine
from tests.helpers.live_streams import HOUR, send, with_live_streams
from tests.helpers.workspaces import make_workspace

NAME = "hanger03"
MODE = Mode("transverse", 1, 5.8, 1e-3)


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Return a stream that was heard two hours ago, with a window, six hours and a dead sensor."""
    workspace = with_live_streams(make_workspace(tmp_path_factory.mktemp("sensors") / "bridge"))
    start = (datetime.now(UTC) - 3 * HOUR).replace(minute=0, second=0, microsecond=0)
    send(workspace, hours=1 / 6, first=start)
    window = Window(NAME, 3, start, 600.0, "wind", 0.01)
    with workspace.store() as store:
        spectrum = tuple(range(-100, 0))
        store.streams.save_window(WindowReading(window, (MODE,), "tracked", "", spectrum))
        for n in range(6):
            store.streams.save_pooled(
                PooledReading(
                    NAME, 3, start - n * HOUR, "hour", (MODE,), 6, 0, 0.01,
                    compensated_shift=-0.031, compensated_sd=0.001,
                )
            )  # fmt: skip
        for n in range(3):
            at = start + n * timedelta(minutes=10)
            store.streams.save_event(
                StreamEvent(NAME, "dead", at, at + timedelta(minutes=10), "no motion", "acc_1")
            )
    return workspace


def test_pages_and_health_say_how_each_stream_is(client: httpx.Client) -> None:
    """How far tension moved, what befell it, and on every page that it is silent."""
    page = client.get("/streams").text
    assert "silent" in page
    assert "wind, 1 mode" in page
    assert "-3.10 ± 0.16 %" in page
    said = f"Stream {NAME} (last sample "
    assert all(said in client.get(address).text for address in ("/", "/alerts"))
    (told,) = client.get("/health").json()["attention"]
    assert told.startswith(said)
    assert told.endswith("silent.")
    page = client.get(f"/streams/{NAME}").text
    assert "no motion (3 times in a row)" in page
    assert f"/api/streams/{NAME}/figure?days=7" in page
    figure = client.get(f"/api/streams/{NAME}/figure").json()
    kinds = {trace["type"] for trace in figure["data"]}
    assert kinds == {"heatmap", "scatter"}
    assert "-3.10 %" in figure["alt"]
    assert client.get("/streams/nobody").status_code == 404
    assert client.get("/api/streams/nobody/figure").status_code == 404


def test_scrape_and_doctor_tell_lag_and_silence(client: httpx.Client, bridge: Workspace) -> None:
    lines = client.get("/metrics").text.splitlines()
    (lag,) = (line for line in lines if line.startswith("shm_stream_lag_seconds{"))
    assert 2.8 * 3600 < float(lag.split()[-1]) < 4 * 3600
    assert f'shm_stream_apart_seconds{{stream="{NAME}"}} 0.0' in lines
    (size,) = (line for line in lines if line.startswith("shm_stream_ring_bytes{"))
    assert float(size.split()[-1]) > 100_000
    (finding,) = (
        each for each in examine(bridge.folder, datetime.now(UTC)) if each.check == "streams"
    )
    assert finding.level is Level.WARNING
    assert NAME in finding.found
    assert "silent" in finding.found
