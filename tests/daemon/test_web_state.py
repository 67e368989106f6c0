"""The state of bridge and service: hangers, status, health, metrics, the page of operation."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.heartbeat import HEARTBEAT, beat, turn_failed
from tests.helpers.flows import ingest
from tests.helpers.taken_in import with_a_slow_loss
from tests.helpers.web_servers import HTML, at_last, served
from tests.helpers.workspaces import SLOW_LOSS, make_workspace, put


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has lost a twelfth of its tension, as its last test shows; 4 has no tests."""
    return with_a_slow_loss(tmp_path_factory.mktemp("web") / "bridge")


def samples(client: httpx.Client) -> dict[str, float]:
    lines = client.get("/metrics").text.splitlines()
    return {
        name: float(value)
        for name, value in (line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
    }


def test_hangers_and_status_tell_tension_and_count(client: httpx.Client, bridge: Workspace) -> None:
    """A hanger without tests is unknown and not nought."""
    state = client.get("/api/hangers/3").json()
    tension = state["tension_n"]
    assert tension["q05"] < tension["q50"] < tension["q95"]
    assert tension["mean"] == pytest.approx(SLOW_LOSS[-1] * state["nominal_tension_n"], rel=0.03)
    assert state["tests"] == len(SLOW_LOSS)
    alerts = client.get("/api/alerts", params={"hanger": 3, "open": True}).json()["alerts"]
    assert state["open_alerts"] == len(alerts) > 0
    assert {shift["quantity"] for shift in state["shifts"]} >= {"tension"}
    hangers = client.get("/api/hangers").json()["hangers"]
    assert [row["hanger"] for row in hangers] == [3, 4]
    assert (hangers[1]["tension_n"], hangers[1]["model"], hangers[1]["shifts"]) == (None, None, [])
    (bridge.folder / HEARTBEAT).touch()
    status = client.get("/api/status").json()
    assert status["recordings"]["done"] == len(SLOW_LOSS)
    assert (status["spool"], status["quarantine"]) == (0, 0)
    assert status["daemon_seen_seconds_ago"] < 60


def test_metrics_follow_the_queue(client: httpx.Client, bridge: Workspace) -> None:
    assert samples(client)["shm_queue_length"] == 0
    path = bridge.spool / "waiting.csv"
    put(path, "x")
    before = time.time() - 500
    os.utime(path, (before, before))
    seen = samples(client)
    path.unlink()
    assert seen["shm_queue_length"] == seen["shm_spool_files"] == 1
    assert 500 <= seen["shm_queue_oldest_seconds"] < 520
    assert seen['shm_recordings{stage="done"}'] == len(SLOW_LOSS)
    assert seen["shm_store_up"] == 1
    assert seen["shm_disk_free_bytes"] > 0
    assert seen['shm_deliveries{state="given up"}'] == 0


def test_metrics_say_so_where_the_store_is_out(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    with served(workspace) as site, site.client() as client:
        workspace.database.rename(tmp_path / "gone.db")
        seen = samples(client)
    assert seen["shm_store_up"] == 0
    assert seen["shm_spool_files"] == 0
    assert "shm_queue_length" not in seen


@pytest.fixture(scope="module")
def refused(bridge: Workspace) -> None:
    """Two files that could not be taken in, of one of which the reason cannot be read."""
    put(bridge.spool / "bad.csv", "no recording\n")
    ingest(bridge)
    put(bridge.quarantine.folder / "torn.csv.reason.json", '{"file": ')


def test_page_says_whether_work_flows(bridge: Workspace, client: httpx.Client) -> None:
    """No daemon, one at work, one whose turns fail, which is not healthy, and one that is late."""
    heartbeat = bridge.folder / HEARTBEAT
    heartbeat.unlink(missing_ok=True)
    assert client.get("/health").json()["reasons"] == ["The daemon has never run here."]
    assert client.get("/api/operation").json()["daemon"] is None
    page = client.get("/operation").text
    assert "Stopped" in page
    assert "The daemon has never run here." in page
    beat(bridge)
    assert client.get("/health").json() == {"status": "ok", "reasons": [], "attention": []}
    assert "Running normally" in client.get("/operation").text
    turn_failed(bridge, "OSError: File name too long: /srv/secret")
    beat(bridge)
    answer = client.get("/health")
    assert (answer.status_code, answer.json()["status"]) == (503, "failing")
    assert "last turn failed" in answer.text
    assert "secret" not in answer.text
    assert "Stopped" in client.get("/operation").text
    turn_failed(bridge, "")
    assert client.get("/health").status_code == 200
    before = time.time() - 3600
    os.utime(heartbeat, (before, before))
    stale = client.get("/health")
    assert stale.status_code == 503
    assert "last seen 60 min ago" in stale.json()["reasons"][0]


def test_refused_files_are_listed(client: httpx.Client, refused: None) -> None:
    found = client.get("/api/operation").json()
    assert found["quarantined"] == 2
    by_name = {each["file"].partition(" ")[0]: each for each in found["quarantine"]}
    assert by_name["torn.csv"]["message"] == "Its reason cannot be read."
    assert by_name["bad.csv"]["remedy"]
    page = client.get("/operation").text
    assert "finished" in page
    assert "bad.csv" in page
    assert "Refused files (2)" in page
    found = client.get("/api/operation").json()
    assert found["recordings"]["refused"] == 1
    assert found["disk_free_bytes"] > 0
    assert found["oldest_waiting_at"] is None


def test_examination_comes_when_it_is_made(client: httpx.Client, refused: None) -> None:
    first = client.get("/api/operation/examination")
    assert first.status_code == 200 or first.headers["Retry-After"] == "2"
    told = at_last(client, "/api/operation/examination").json()["findings"]
    findings = {each["check"]: each for each in told}
    assert findings["store"]["level"] == "ok"
    assert findings["quarantine"]["level"] == "warning"
    fragment = client.get("/operation/examination")
    assert fragment.text.count("<tr class=") == len(told)
    assert "<html" not in fragment.text


@pytest.mark.parametrize(
    ("free_mb", "waiting", "status", "reason"),
    [
        (60, 0, "degraded", "The disk is nearly full: 60 MB are free."),
        (60, 1, "degraded", "The disk is nearly full: 60 MB are free."),
        (3, 0, "failing", "The disk is full: 3 MB are free."),
        (3, 2, "failing", "The disk is full: 3 MB are free, and 2 files wait in the spool."),
        (300, 0, "ok", ""),
    ],
)
def test_health_reports_free_space(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    free_mb: int,
    waiting: int,
    status: str,
    reason: str,
) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    for number in range(waiting):
        put(workspace.spool / f"{number}.csv", "a recording")
    beat(workspace)
    usage = SimpleNamespace(total=10**10, used=0, free=free_mb * 10**6)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    with served(workspace) as site, site.client(**HTML) as client:
        found = client.get("/health").json()
        assert (found["status"], found["reasons"]) == (status, [reason] if reason else [])
        assert ("nearly full" in client.get("/").text) is (status == "degraded")
