"""The page of operation: whether work flows, what was refused, what the doctor finds."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.heartbeat import beat, turn_failed
from tests.helpers.flows import ingest
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import make_workspace, put

BROWSER = {"Accept": "text/html"}
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    workspace = make_workspace(tmp_path_factory.mktemp("operation") / "bridge")
    put(workspace.spool / "bad.csv", "no recording\n")
    ingest(workspace)
    put(workspace.quarantine.folder / "torn.csv.reason.json", '{"file": ')
    return workspace


@pytest.fixture(scope="module")
def site(bridge: Workspace) -> Iterator[Served]:
    with served(bridge) as site:
        yield site


@pytest.fixture(scope="module")
def client(site: Served) -> Iterator[httpx.Client]:
    with site.client(**BROWSER) as client:
        yield client


def test_it_says_that_no_daemon_runs_and_then_that_work_flows(
    bridge: Workspace, client: httpx.Client
) -> None:
    page = client.get("/operation").text
    assert "Stopped" in page
    assert "The daemon has never run here." in page
    beat(bridge)
    assert "Running normally" in client.get("/operation").text


def test_a_daemon_whose_turns_fail_is_no_healthy_one(
    bridge: Workspace, client: httpx.Client
) -> None:
    beat(bridge)
    assert client.get("/health").status_code == 200
    turn_failed(bridge, "OSError: File name too long: /srv/secret")
    beat(bridge)
    answer = client.get("/health")
    assert (answer.status_code, answer.json()["status"]) == (503, "failing")
    assert "last turn failed" in answer.text
    assert "secret" not in answer.text
    assert "Stopped" in client.get("/operation").text
    turn_failed(bridge, "")
    assert client.get("/health").status_code == 200


def test_refused_files_are_listed_with_their_reasons(client: httpx.Client) -> None:
    found = client.get("/api/operation").json()
    assert found["quarantined"] == 2
    by_name = {each["file"].partition(" ")[0]: each for each in found["quarantine"]}
    assert by_name["torn.csv"]["message"] == "Its reason cannot be read."
    assert by_name["bad.csv"]["remedy"]
    page = client.get("/operation").text
    assert "bad.csv" in page
    assert "Refused files (2)" in page


def test_the_numbers_of_the_page_stand_in_json(client: httpx.Client) -> None:
    found = client.get("/api/operation").json()
    assert found["recordings"]["refused"] == 1
    assert found["disk_free_bytes"] > 0
    assert found["daemon"] is None
    assert found["oldest_waiting_at"] is None


def test_the_examination_comes_when_it_is_made(client: httpx.Client) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while (answer := client.get("/api/operation/examination")).status_code == 202:
        assert answer.headers["Retry-After"] == "2"
        assert time.monotonic() < deadline
        time.sleep(0.3)
    findings = {each["check"]: each for each in answer.json()["findings"]}
    assert findings["store"]["level"] == "ok"
    assert findings["quarantine"]["level"] == "warning"
    fragment = client.get("/operation/examination")
    assert fragment.text.count("<tr class=") == len(answer.json()["findings"])
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
    with served(workspace) as site, site.client(**BROWSER) as client:
        found = client.get("/health").json()
        assert (found["status"], found["reasons"]) == (status, [reason] if reason else [])
        assert ("nearly full" in client.get("/").text) is (status == "degraded")
