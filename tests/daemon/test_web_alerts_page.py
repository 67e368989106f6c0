"""Alerts and notes on the pages: who was told, what is acknowledged, what somebody has seen."""

from __future__ import annotations

import io
import sys
from datetime import timedelta
from pathlib import Path

import httpx
import numpy as np
import pytest
import sqlalchemy as sa
from PIL import Image

from shm.documents import alert_document
from shm.pipeline import utc_now
from shm.pipeline.reporting import hanger_report
from shm.report.as_html import as_html
from shm.report.figures.hanger_trend import FIGURE
from shm.report.figures.specification import Points
from shm.report.hanger_report import hanger_json, hanger_paper
from shm.store import Workspace
from shm.store.database import insert
from shm.store.journal import list_changes
from shm.store.tables import alerts
from shm.values.notes import NoteKind
from shm_daemon.web.pages import alerts as alerts_page
from tests.helpers.taken_in import ingest_quickly, with_a_slow_loss
from tests.helpers.web_servers import sign_in
from tests.helpers.workspaces import make_workspace, write_slow_loss

FAILING = {"siren": (sys.executable, "-c", "import sys; sys.exit('no power')")}


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 has lost tension; the hook that should tell somebody fails."""
    workspace = make_workspace(tmp_path_factory.mktemp("alerts") / "bridge", hooks=FAILING)
    write_slow_loss(workspace.spool, workspace)
    ingest_quickly(workspace)
    return workspace


@pytest.fixture(scope="module")
def alert(client: httpx.Client) -> int:
    found = client.get("/api/alerts").json()["alerts"][0]
    assert found["acknowledged"] is None
    assert found["kinds"]
    assert isinstance(found["id"], int)
    return found["id"]


def test_alerts_say_who_was_told(client: httpx.Client, writer: httpx.Client, alert: int) -> None:
    """Only who may write is offered to acknowledge."""
    page = client.get("/alerts").text
    for said in (f'id="alert-{alert}"', '<a href="/hangers/3">Hanger 3</a>', "/hangers/3/tests/",
                 "siren", "open</span>", "/sign-in?next=/alerts"):  # fmt: skip
        assert said in page
    address = f'data-address="/api/alerts/{alert}/acknowledgement"'
    assert address not in page
    assert address in writer.get("/alerts").text
    assert 'class="card' in client.get("/alerts?hanger=3").text
    assert 'class="card' not in client.get("/alerts?hanger=4").text
    assert client.get("/alerts?hanger=x").status_code == 422


def test_acknowledge_without_script(bridge: Workspace, writer: httpx.Client, alert: int) -> None:
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
    """Once, and until it is resolved; what cannot be a reason is refused."""
    address = f"/api/alerts/{alert}/acknowledgement"
    for why in ("", " ", "a\x00b", "x" * 2001):
        assert writer.post(address, json={"who": " ", "why": why}).status_code == 422
    told = {"who": "Ada <b>", "why": "Nut tightened."}
    noted = writer.post(address, json=told).json()
    assert noted["acknowledged"]["who"] == "Ada <b> (token write)"
    only = {"alerts": [noted], "next_before": None}
    none: dict[str, object] = {"alerts": [], "next_before": None}
    for query, expected in (
        ("open=true&hanger=3", none), ("hanger=3", only), ("hanger=4", none),
        (f"limit=1&before={alert + 1}", only), (f"limit=1&before={alert}", none),
    ):  # fmt: skip
        found = writer.get(f"/api/alerts?{query}").json()
        ours = [each for each in found["alerts"] if each["id"] <= alert]
        assert {**found, "alerts": ours} == expected
    again = writer.post(address, json=told)
    assert again.status_code == 409
    assert "already" in again.json()["message"]
    nothing = writer.post("/api/alerts/99/acknowledgement", json={"why": "what?"})
    assert nothing.status_code == 404
    every = writer.get("/api/alerts").json()["alerts"]
    count = sum(bool(each["acknowledged"]) and not each["resolved"] for each in every)
    assert f'shm_alerts{{state="acknowledged"}} {count}.0' in writer.get("/metrics").text
    page = writer.get("/alerts").text
    for said in ("No alert is open: all are acknowledged.", "Ada &lt;b&gt; (token write)",
                 "Nut tightened.", f"Resolve alert {alert}"):  # fmt: skip
        assert said in page
    ended = writer.post(address, json={"why": "Raised by mistake.", "resolved": True}).json()
    whys = (ended["resolved"]["why"], ended["acknowledged"]["why"])
    assert whys == ("Raised by mistake.", "Nut tightened.")
    page = writer.get("/alerts").text
    assert "Raised by mistake." in page
    assert f"Resolve alert {alert}" not in page


def test_older_alerts_are_a_link_away(
    bridge: Workspace, client: httpx.Client, alert: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alerts_page, "_SHOWN", 1)
    first, second = (copied(bridge, alert, key) for key in ("again", "once more"))
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


NOTE = {"hanger": "3", "kind": "repair", "at": "2026-05-01", "text": "new pin\r\n<b>lower</b> end"}


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return with_a_slow_loss(tmp_path / "bridge")


def test_note_with_photo_and_mark(browser: httpx.Client, workspace: Workspace) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (200, 150, 3), np.uint8)
    image = io.BytesIO()
    Image.fromarray(noise).save(image, "PNG")  # with line ends of every kind among its bytes
    file = {"photo": ("pin.png", image.getvalue(), "image/png")}
    sign_in(browser, "reader")
    assert "Write a note" not in browser.get("/hangers/3").text
    assert browser.post("/notes", data=NOTE, files=file).status_code == 403
    sign_in(browser, "operator")
    assert "Write a note" in browser.get("/hangers/3").text
    foreign = {"Origin": "https://elsewhere.example"}
    assert browser.post("/notes", data=NOTE, files=file, headers=foreign).status_code == 403
    assert browser.post("/notes", data=NOTE).status_code == 415
    written = browser.post("/notes", data=NOTE, files=file)
    assert (written.status_code, written.headers["location"]) == (303, "/hangers/3#notes")
    empty = {"photo": ("", b"", "application/octet-stream")}  # as a browser sends none
    of_bridge = {"hanger": "", "kind": "inspection", "at": "", "text": "storm"}
    assert browser.post("/notes", data=of_bridge, files=empty).headers["location"] == "/#notes"
    for wrong in ({"kind": "x"}, {"at": "x"}, {"hanger": "x"}, {"hanger": "99"}, {"text": " "}):
        refused = browser.post("/notes", data={**NOTE, **wrong}, files=file)
        assert (wrong, refused.status_code // 100) == (wrong, 4)

    form = {"Content-Type": "multipart/form-data; boundary=x"}
    part = b'--x\r\nContent-Disposition: form-data; name="%d"\r\n\r\na\r\n'
    for body, status in {
        b"no form": 400,
        b"--x\r\nContent-Disposition: form-data\r\n\r\na\r\n--x--": 400,  # of no name
        b"".join(part % number for number in range(50)) + b"--x--": 400,
        part % 1 + b"a" * 70_000: 400,
        part.replace(b"%d", b'photo"; filename="a') + b"a" * 6_000_000: 413,
        part % 1 + part % 2: 409,  # broken off: a note of no kind
    }.items():
        refused = browser.post("/notes", content=body, headers=form)
        assert (body[:20], refused.status_code) == (body[:20], status), refused.text[:500]

    sign_in(browser, "reader")
    shown = browser.get("/hangers/3").text
    assert "Notes and inspections (2)" in shown
    assert "Repair of hanger 3, <time>2026-05-01" in shown
    assert "new pin\n&lt;b&gt;lower&lt;/b&gt; end" in shown
    assert "storm" in browser.get("/").text
    assert "new pin" not in browser.get("/").text
    assert "storm" in browser.get("/hangers/4").text  # which has no test
    photo = browser.get("/notes/1/photo")
    assert photo.headers["content-type"] == "image/jpeg"
    assert Image.open(io.BytesIO(photo.content)).size == (150, 200)
    assert browser.get("/notes/2/photo").status_code == 404
    with workspace.store() as store:
        assert [row.who for row in list_changes(store, 2)] == ["operator", "operator"]
    traces = browser.get("/api/hangers/3/figures/trend").json()["data"]
    (marked,) = [each for each in traces if each.get("name") == "repair"]
    assert "of hanger 3 by operator: new pin" in str(marked)


def test_the_report_marks_and_lists_the_notes_of_its_period(workspace: Workspace) -> None:
    now = utc_now()
    with workspace.store() as store:
        store.notes.add(3, now - timedelta(hours=1), NoteKind.INSPECTION, "rust", "a", now)
        report = hanger_report(workspace, store, 3, now)
    drawn = FIGURE.draw(report)
    (mark,) = [
        each
        for each in drawn.panels[0].marks
        if isinstance(each, Points) and "rust" in str(each.texts)
    ]
    assert mark.name == "inspection"
    assert now - timedelta(hours=1) < drawn.panels[-1].x.range[1]
    assert "rust" in str(hanger_json(report)["inspections"])
    assert "rust" in as_html(hanger_paper(report))
