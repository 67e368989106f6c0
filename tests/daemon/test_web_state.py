"""States, alerts, health and metrics over HTTP, of a bridge that has lost tension."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.heartbeat import HEARTBEAT
from tests.helpers.taken_in import with_a_slow_loss
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import SLOW_LOSS, make_workspace, put


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has lost a twelfth of its tension, as its last test shows; 4 has no tests."""
    return with_a_slow_loss(tmp_path_factory.mktemp("web") / "bridge")


@pytest.fixture(scope="module")
def site(bridge: Workspace) -> Iterator[Served]:
    with served(bridge) as site:
        yield site


@pytest.fixture
def client(site: Served) -> Iterator[httpx.Client]:
    with site.client() as client:
        yield client


def samples(client: httpx.Client) -> dict[str, float]:
    lines = client.get("/metrics").text.splitlines()
    return {
        name: float(value)
        for name, value in (line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
    }


def test_a_hanger_tells_its_tension_with_its_interval(client: httpx.Client) -> None:
    state = client.get("/api/hangers/3").json()
    tension = state["tension_n"]
    assert tension["q05"] < tension["q50"] < tension["q95"]
    assert tension["mean"] == pytest.approx(SLOW_LOSS[-1] * state["nominal_tension_n"], rel=0.03)
    assert state["tests"] == len(SLOW_LOSS)
    alerts = client.get("/api/alerts", params={"hanger": 3, "open": True}).json()["alerts"]
    assert state["open_alerts"] == len(alerts) > 0
    assert {shift["quantity"] for shift in state["shifts"]} >= {"tension"}


def test_a_hanger_without_tests_is_unknown_and_not_nought(client: httpx.Client) -> None:
    hangers = client.get("/api/hangers").json()["hangers"]
    assert [row["hanger"] for row in hangers] == [3, 4]
    assert (hangers[1]["tension_n"], hangers[1]["model"], hangers[1]["shifts"]) == (None, None, [])


def test_an_alert_is_listed_and_acknowledged_once(site: Served) -> None:
    with site.client(site.write_token) as client:
        (alert,) = client.get("/api/alerts?open=true").json()["alerts"]
        path = f"/api/alerts/{alert['id']}/acknowledgement"
        for why in ("", " ", "a\x00b", "x" * 2001):
            assert client.post(path, json={"why": why}).status_code == 422
        noted = client.post(path, json={"why": "pin replaced", "who": "Ada"}).json()
        assert noted["acknowledged"]["who"] == "Ada (token write)"
        assert client.get("/api/alerts?open=true").json()["alerts"] == []
        assert client.get("/api/alerts?hanger=3").json()["alerts"] == [noted]
        assert client.get("/api/alerts?hanger=4").json()["alerts"] == []
        assert client.get("/api/alerts").json() == {"alerts": [noted], "next_before": None}
        assert client.get("/api/alerts?limit=1").json() == {"alerts": [noted], "next_before": None}
        older = client.get(f"/api/alerts?limit=1&before={alert['id']}").json()
        assert older == {"alerts": [], "next_before": None}
        again = client.post(path, json={"why": "once more"})
        assert again.status_code == 409
        nothing = client.post("/api/alerts/99/acknowledgement", json={"why": "what?"})
        assert nothing.status_code == 404
        assert samples(client)['shm_alerts{state="acknowledged"}'] == 1


def test_the_status_counts_what_is_there(client: httpx.Client, bridge: Workspace) -> None:
    (bridge.folder / HEARTBEAT).touch()
    status = client.get("/api/status").json()
    assert status["recordings"]["done"] == len(SLOW_LOSS)
    assert (status["spool"], status["quarantine"]) == (0, 0)
    assert status["daemon_seen_seconds_ago"] < 60


def test_health_follows_the_daemon_and_the_spool(client: httpx.Client, bridge: Workspace) -> None:
    (bridge.folder / HEARTBEAT).touch()
    assert client.get("/health").json() == {"status": "ok", "reasons": [], "attention": []}
    before = time.time() - 3600
    os.utime(bridge.folder / HEARTBEAT, (before, before))
    stale = client.get("/health")
    assert stale.status_code == 503
    assert "last seen 60 min ago" in stale.json()["reasons"][0]
    (bridge.folder / HEARTBEAT).unlink()
    assert client.get("/health").json()["reasons"] == ["The daemon has never run here."]


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
