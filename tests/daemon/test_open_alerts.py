"""How many alerts are open: one number, wherever it is said."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

import httpx
import pytest

from shm.store import Workspace
from shm.store.outbox import resolve
from shm.store.queries.alerts import count_open_alerts, list_alert_page
from shm_cli.main import run
from tests.helpers.taken_in import with_a_loss
from tests.helpers.web_servers import served
from tests.helpers.workspaces import START

AT_FIRST = 2
"""Alerts of the loss: the notice that asks to repeat a test, and that two tests agree."""


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    return with_a_loss(tmp_path_factory.mktemp("open") / "bridge")


@pytest.fixture(scope="module")
def client(bridge: Workspace) -> Iterator[httpx.Client]:
    with served(bridge) as site, site.client() as client:
        yield client


def stated(
    bridge: Workspace, client: httpx.Client, capsys: pytest.CaptureFixture[str]
) -> dict[str, int]:
    """Return the number of open alerts of hanger 3, the only one with any, by its face."""

    def shm(*arguments: str) -> str:
        capsys.readouterr()
        assert run(["--workspace", str(bridge.folder), *arguments]) == 0
        return capsys.readouterr().out

    def number(pattern: str, text: str) -> int:
        found = re.search(pattern, text)
        return int(found[1]) if found else 0

    status = json.loads(shm("status", "--json"))
    report = json.loads(shm("report", "--bridge", "--json"))

    rows = json.loads(shm("alerts", "--json"))["alerts"]
    hanger = client.get("/api/hangers").json()["hangers"][0]
    alerts_page = client.get("/alerts").text
    found = {
        "status": status["open_alerts"],
        "status in words": number(r"(\d+) open", shm("status")),
        "status of the hanger": status["hangers"][0]["open_alerts"],
        "list of alerts": sum(not (row["acknowledged"] or row["resolved"]) for row in rows),
        "report": report["hangers"][0]["open_alerts"],
        "API of the state": client.get("/api/status").json()["open_alerts"],
        "API of hangers": hanger["open_alerts"],
        "API of the hanger": client.get("/api/hangers/3").json()["open_alerts"],
        "API of alerts": len(client.get("/api/alerts?open=true").json()["alerts"]),
        "metrics": number(r'shm_alerts\{state="open"\} (\d+)', client.get("/metrics").text),
        "navigation": number(r'class="count">(\d+)', client.get("/").text),
        "page of the bridge": number(r'/alerts\?hanger=3">(\d+)', client.get("/").text),
        "cards of the page of alerts": alerts_page.count('class="card open"'),
        "heading of the page of alerts": number(r">Open \((\d+)\)", alerts_page),
    }
    with bridge.store() as store:
        found["store"] = count_open_alerts(store).get(3, 0)
        found["rows"] = len(list_alert_page(store, 3, is_open=True))
    return found


def test_every_place_says_the_same_number_of_open_alerts(
    bridge: Workspace,
    client: httpx.Client,
    capsys: pytest.CaptureFixture[str],
) -> None:
    at_first = stated(bridge, client, capsys)
    assert at_first == dict.fromkeys(at_first, AT_FIRST)
    with bridge.store() as store:
        notice, loss = (each.id for each in store.alerts.list_all())
        with store.engine.begin() as connection:
            resolve(connection, notice, "shm", "two visits agree", START)
    resolved = stated(bridge, client, capsys)
    assert resolved == dict.fromkeys(resolved, AT_FIRST - 1), "a resolved one is open no more"
    with bridge.store() as store:
        store.alerts.acknowledge(loss, "Ann", "seen", START)
    noted = stated(bridge, client, capsys)
    assert noted == dict.fromkeys(noted, 0)
