"""The page of alerts, and what is acknowledged from it."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import httpx
import pytest
import sqlalchemy as sa

from shm.documents import alert_document
from shm.store import Workspace
from shm.store.database import insert
from shm.store.tables import alerts
from shm_daemon.web.access import COOKIE
from shm_daemon.web.pages import alerts as alerts_page
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import make_workspace, write_slow_loss

BROWSER = {"Accept": "text/html"}
FAILING = {"siren": (sys.executable, "-c", "import sys; sys.exit('no power')")}


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has lost tension; the hook that should tell somebody fails."""
    workspace = make_workspace(tmp_path_factory.mktemp("alerts") / "bridge", hooks=FAILING)
    write_slow_loss(workspace.spool, workspace)
    ingest_quickly(workspace)
    return workspace


@pytest.fixture(scope="module")
def site(bridge: Workspace) -> Iterator[Served]:
    with served(bridge) as site:
        yield site


@pytest.fixture(scope="module")
def alert(site: Served) -> int:
    with site.client() as client:
        found = client.get("/api/alerts").json()["alerts"][0]
    assert found["acknowledged"] is None
    assert found["kinds"]
    number = found["id"]
    assert isinstance(number, int)
    return number


@pytest.fixture
def writer(site: Served) -> Iterator[httpx.Client]:
    with site.client(**BROWSER, Origin=site.url) as client:
        client.cookies.set(COOKIE, site.write_token)
        yield client


def test_an_open_alert_says_what_it_is_and_who_was_told(site: Served, alert: int) -> None:
    with site.client(**BROWSER) as client:
        page = client.get("/alerts").text
    assert f'id="alert-{alert}"' in page
    assert '<a href="/hangers/3">Hanger 3</a>' in page
    assert "/hangers/3/tests/" in page
    assert "siren" in page
    assert "open</span>" in page


def test_only_who_may_write_is_offered_to_acknowledge(
    site: Served, writer: httpx.Client, alert: int
) -> None:
    address = f'data-address="/api/alerts/{alert}/acknowledgement"'
    with site.client(**BROWSER) as client:
        assert address not in client.get("/alerts").text
        assert "/sign-in?next=/alerts" in client.get("/alerts").text
    assert address in writer.get("/alerts").text


def test_alerts_of_one_hanger_stand_alone(site: Served) -> None:
    with site.client(**BROWSER) as client:
        assert 'class="card' in client.get("/alerts?hanger=3").text
        assert 'class="card' not in client.get("/alerts?hanger=4").text
        assert client.get("/alerts?hanger=x").status_code == 422


def test_an_alert_is_acknowledged_without_a_script(
    bridge: Workspace, writer: httpx.Client, alert: int
) -> None:
    number = copied(bridge, alert, "without a script")
    address = f"/alerts/{number}/acknowledgement"
    assert f'action="{address}"' in writer.get("/alerts").text
    assert writer.post(address, data={"why": " "}).status_code == 409
    noted = writer.post(address, data={"who": "Ada", "why": "Seen."})
    assert (noted.status_code, noted.headers["Location"]) == (303, f"/alerts#alert-{number}")
    with bridge.store() as store:
        acknowledged = store.alerts.get(number).acknowledgement
    assert acknowledged
    assert (acknowledged.who, acknowledged.why) == ("Ada (token write)", "Seen.")


def test_person_token_and_reason_go_on_the_record(writer: httpx.Client, alert: int) -> None:
    address = f"/api/alerts/{alert}/acknowledgement"
    empty = writer.post(address, json={"who": " ", "why": "seen"})
    assert empty.status_code == 422
    told = {"who": "Ada <b>", "why": "Nut tightened."}
    noted = writer.post(address, json=told).json()["acknowledged"]
    assert noted["who"] == "Ada <b> (token write)"
    again = writer.post(address, json=told)
    assert again.status_code == 409
    assert "already" in again.json()["message"]
    page = writer.get("/alerts").text
    assert "No alert is open: all are acknowledged." in page
    assert "Ada &lt;b&gt; (token write)" in page
    assert "Nut tightened." in page
    assert f"Resolve alert {alert}" in page
    ended = writer.post(address, json={"why": "Raised by mistake.", "resolved": True}).json()
    assert (ended["resolved"]["why"], ended["acknowledged"]["why"]) == (
        "Raised by mistake.", "Nut tightened.",
    )  # fmt: skip
    page = writer.get("/alerts").text
    assert "Raised by mistake." in page
    assert f"Resolve alert {alert}" not in page


def test_older_alerts_are_a_link_away(
    bridge: Workspace, site: Served, alert: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alerts_page, "_SHOWN", 1)
    first, second = (copied(bridge, alert, key) for key in ("again", "once more"))
    with site.client(**BROWSER) as client:
        page = client.get("/alerts?hanger=3").text
        assert f'id="alert-{second}"' in page
        assert f'id="alert-{first}"' not in page
        older = f"/alerts?open_before={second}&amp;hanger=3"
        assert older in page
        assert "Open (1 of 2)" in page
        page = client.get(older.replace("&amp;", "&")).text
        assert f'id="alert-{first}"' in page
        assert f'id="alert-{second}"' not in page
        assert "The newest alerts" in page
        assert client.get(f"/alerts?noted_before={alert}").status_code == 200


def copied(bridge: Workspace, alert: int, key: str) -> int:
    """Return the same alert raised for another reason; its number."""
    with bridge.store() as store, store.writing() as connection:
        row = connection.execute(sa.select(alerts).where(alerts.c.id == alert)).one()
        changed = {"id": None, "key": key, "document": alert_document(row.document)}
        changed |= {f"{prefix}_at": None for prefix in ("noted", "ended")}
        return insert(connection, alerts, {**row._mapping, **changed})
