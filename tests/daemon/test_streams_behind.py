"""A watch that is behind is reported wherever somebody looks."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from shm.pipeline import utc_now
from shm.pipeline.stream_health import heard, stream_leads
from shm.read.chunk_document import chunk_document
from shm.store import Workspace
from shm.store.ring import ring_of
from shm.values.stream import PERIOD, Window, WindowReading, period_start
from shm_cli.main import run
from shm_daemon.doctor import examine
from shm_daemon.heartbeat import beat
from tests.helpers.streams import MODES, a_chunk, with_stream
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace

SMALL_RING_BYTES = 10**6
Faces = Callable[[Workspace], dict[str, str]]


@pytest.fixture
def bridge(tmp_path: Path) -> Workspace:
    return with_stream(
        make_workspace(tmp_path / "bridge", settings={"ring_bytes": SMALL_RING_BYTES})
    )


@pytest.fixture
def faces(capsys: pytest.CaptureFixture[str]) -> Faces:
    """Return what `/health`, `shm status`, the home page and `shm doctor` show."""

    def read(workspace: Workspace) -> dict[str, str]:
        beat(workspace)
        with served(workspace) as site, site.client(Accept="text/html") as client:
            health, home = client.get("/health").text, client.get("/").text
        capsys.readouterr()
        run(["--workspace", str(workspace.folder), "status"])
        status = capsys.readouterr().out
        findings = examine(workspace.folder, utc_now())
        doctor = "\n".join(f"{each.level} {each.found} {each.remedy}" for each in findings)
        return {"health": health, "home": home, "status": status, "doctor": doctor}

    return read


def send_minutes(workspace: Workspace, start: datetime, minutes: int) -> None:
    """Send a chunk for each minute, as it is recorded."""
    for minute in range(minutes):
        at = start + timedelta(minutes=minute)
        ring = ring_of(workspace, lambda at=at: at + timedelta(minutes=1))
        ring.append(chunk_document(a_chunk(minute, at, samples=6000)))


def save_windows(workspace: Workspace, start: datetime, count: int) -> None:
    with workspace.store() as store:
        for at in (start + number * PERIOD for number in range(count)):
            window = Window("h3", 3, at, PERIOD.total_seconds(), "wind", 0.01)
            store.streams.save_window(WindowReading(window, MODES, "tracked"))


@pytest.mark.parametrize(("read", "is_sealed"), [(2, True), (2, False), (0, True)])
def test_faces_name_unread_hours(
    bridge: Workspace, faces: Faces, read: int, is_sealed: bool
) -> None:
    """The stream sends, and is not silent; the watch has read little of it or nothing."""
    start = period_start(utc_now(), PERIOD) - 15 * PERIOD
    send_minutes(bridge, start, 150)
    if is_sealed:
        ring_of(bridge).seal(utc_now() + PERIOD)
    save_windows(bridge, start, read)
    hours = {0: "2.5", 2: "2.17"}[read] if is_sealed else "2.5"
    found = faces(bridge)
    for name, text in found.items():
        assert f"Stream h3 ({hours} hours): samples are not read yet" in text, name
    assert json.loads(found["health"])["status"] == "degraded"
    save_windows(bridge, start, 15)
    ring_of(bridge).seal(utc_now() + PERIOD)
    with bridge.store() as store:
        assert stream_leads(heard(bridge, store, utc_now())) == ()
