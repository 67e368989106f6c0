"""What is held and what counts, and silences: shown on the pages, decided in a browser."""

from __future__ import annotations

import json
import tomllib
from datetime import timedelta
from pathlib import Path

import httpx
import pytest

from shm.pipeline import utc_now
from shm.store import Decision, Stage, Workspace
from shm.store.recordings import list_holds
from shm_daemon.heartbeat import beat
from tests.helpers.logger_exports import write_described_export, write_export
from tests.helpers.taken_in import copied, ingest_quickly
from tests.helpers.web_servers import served, sign_in
from tests.helpers.workspaces import make_workspace, write_held, write_test

FOREIGN = {"Origin": "https://elsewhere.example"}


def _make_held(folder: Path) -> None:
    made = make_workspace(folder, hangers=(3, 4))
    write_test(made.spool / "good.modes.json", made)
    ingest_quickly(made)
    for number in (3, 4):
        write_held(made, number)
        ingest_quickly(made)


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 with a good test and one of 1970, hanger 4 with one of 1970 alone."""
    made = copied("held of two", tmp_path_factory.mktemp("held") / "bridge", _make_held)
    beat(made)
    return made


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Return the same, to be changed."""
    return copied("held of two", tmp_path / "bridge", _make_held)


# ------------------------------------------------------------ what is held is shown everywhere


@pytest.mark.parametrize("page", ["/", "/hangers/3", "/hangers/4", "/operation"])
def test_a_page_shows_what_is_held_and_what_to_do(client: httpx.Client, page: str) -> None:
    text = client.get(page).text
    hanger_4_alone = page == "/hangers/4"
    assert ("epoch3.modes.json" in text) is not hanger_4_alone
    assert ("epoch4.modes.json" in text) is (page != "/hangers/3")
    number = 3 if hanger_4_alone else 2
    assert f'<a href="/operation#held-{number}">Confirm</a>' in text
    assert f'id="held-{number}"' in text
    assert "shm ingest" not in text
    assert "Held until you decide" in text


def test_held_test_counts_nowhere(client: httpx.Client) -> None:
    assert client.get("/hangers/3/tests/epoch3").status_code == 404
    assert "epoch3" not in client.get("/hangers/3/tests").text
    alerts = client.get("/alerts").text
    assert 'href="/operation#held"' in alerts
    assert "/hangers/3/tests/epoch3" not in alerts
    text = client.get("/upload/outcome/2").text
    assert "<html" not in text
    for said in ("epoch3.modes.json", "1970", 'href="/operation#held-2"'):
        assert said in text
    assert client.get("/upload/outcome/99").status_code == 404


def test_health_metrics_and_documents_name_what_is_held(client: httpx.Client) -> None:
    """It asks for attention and does not fail; it is not in the queue."""
    found = client.get("/health")
    attention = [
        f"hanger {hanger}: recording {number} is held until a person decides."
        for hanger, number in ((3, 2), (4, 3))
    ]
    assert found.status_code == 200
    assert found.json() == {"status": "ok", "reasons": [], "attention": attention}
    text = client.get("/metrics").text
    for line in ('shm_recordings{stage="held"} 2.0', "shm_queue_length 0.0", "shm_store_up 1.0"):
        assert line in text
    held = client.get("/api/operation").json()["held"]
    assert [(each["recording"], each["hanger"]) for each in held] == [(2, 3), (3, 4)]
    recording = client.get("/api/recordings/2").json()
    assert (recording["stage"], recording["tests"]) == ("held", [])
    assert "1970-01-01" in recording["reason"]["message"]
    assert client.get("/api/hangers/3").json()["tests"] == 1


# ------------------------------------------------------------ and decided there


@pytest.mark.parametrize(
    ("sent", "decision", "stage"),
    [
        ({"action": "confirm", "time": "2026-05-01T10:00"}, Decision.CONFIRMED, Stage.IDENTIFIED),
        ({"action": "discard", "time": ""}, Decision.DISCARDED, Stage.REFUSED),
    ],
)
def test_what_is_held_is_decided_on_the_page_and_the_daemon_goes_on(
    browser: httpx.Client,
    workspace: Workspace,
    sent: dict[str, str],
    decision: Decision,
    stage: Stage,
) -> None:
    asked = {**sent, "why": "its clock was dead"}
    sign_in(browser, "reader")
    assert browser.post("/held/2", data=asked).status_code == 403
    assert 'action="/held/2"' not in browser.get("/hangers/3").text
    sign_in(browser, "operator")
    for address in ("/", "/hangers/3", "/operation"):
        assert 'action="/held/2"' in browser.get(address).text
    for wrong, status in (
        ({"why": ""}, 409),
        ({"time": "1901-01-01T00:00", "action": "confirm"}, 409),
        ({"time": "yesterday", "action": "confirm"}, 422),
    ):
        assert browser.post("/held/2", data={**asked, **wrong}).status_code == status
    assert browser.post("/held/9", data=asked).status_code == 404
    answer = browser.post("/held/2", data=asked)
    assert (answer.status_code, answer.headers["location"]) == (303, "/operation?decided=2#held")
    page = browser.get(answer.headers["location"]).text
    assert 'id="held-2"' not in page
    assert f"was {decision} by <strong>operator</strong>: its clock was dead" in page
    for action in ("confirm", "discard"):  # as of a page that was loaded before
        assert browser.post("/held/2", data={**asked, "action": action}).status_code == 409
    browser.post("/held/3", data={"action": "discard", "why": "nobody was there"})
    assert "Nothing is held." in browser.get("/operation").text
    with workspace.store() as store:
        assert store.recordings.get(2).stage is stage
    ingest_quickly(workspace)
    with workspace.store() as store:
        names = [each.test.id for each in store.tests.list_all(3)]
    assert ("epoch3" in names) is (decision is Decision.CONFIRMED)


def test_discard_on_page_and_back(browser: httpx.Client, workspace: Workspace) -> None:
    sign_in(browser, "reader")
    assert "Discard this test" not in browser.get("/hangers/3/tests/good").text
    sign_in(browser, "operator")
    assert 'action="/held/1"' in browser.get("/hangers/3/tests/good").text
    out = {"action": "withdraw", "test": "good", "why": "of hanger 4"}
    assert browser.post("/held/1", data={**out, "action": "burn"}).status_code == 422
    answer = browser.post("/held/1", data=out)
    assert browser.get("/hangers/3/tests/good").status_code == 404
    page = browser.get(answer.headers["location"]).text
    assert "was withdrawn by <strong>operator</strong>: of hanger 4" in page
    assert 'value="reinstate"' in page
    browser.post("/held/1", data={"action": "reinstate", "why": "it was of hanger 3"})
    ingest_quickly(workspace)
    assert browser.get("/hangers/3/tests/good").status_code == 200


def test_answered_day_teaches_order(browser: httpx.Client, workspace: Workspace) -> None:
    """A test without a time is named on the page of its hanger."""
    undated = workspace.spool / "undated.modes.json"
    write_test(undated, workspace, tension=0.99)
    document = json.loads(undated.read_text())
    document["tests"][0]["time"] = None
    undated.write_text(json.dumps(document))
    write_described_export(workspace.spool / "a.csv", "9/10/2025 9:12:31 AM")
    ingest_quickly(workspace)
    sign_in(browser, "operator")
    page = browser.get("/hangers/3").text
    assert "1 test without a time is dated by the receipt of the file: undated." in page
    said = "its day may be 2025-10-09 or 2025-09-10"
    assert all(said in browser.get(page).text for page in ("/", "/hangers/3", "/operation"))
    asked = {"action": "confirm", "why": "by the diary", "time": "2025-09-10T09:12"}
    with workspace.store() as store:
        (number,) = (
            each.recording_id for each in list_holds(store) if each.recording_id not in (2, 3)
        )
    assert browser.post(f"/held/{number}", data=asked).status_code == 303
    with workspace.store() as store:
        assert store.recordings.get(number).stage is Stage.IDENTIFIED
    (profile,) = (workspace.folder / "loggers").iterdir()
    assert tomllib.loads(profile.read_text())["day_order"] == "month first"


@pytest.mark.parametrize(
    ("answer", "time"), [("2025-10-09", "2025-10-09T09:12:31Z"), ("unknown", None)]
)
def test_import_page_asks_for_the_day(tmp_path: Path, answer: str, time: str | None) -> None:
    content = write_export(tmp_path / "a.csv", "9/10/2025 9:12:31 AM").read_bytes()
    fresh = make_workspace(tmp_path / "fresh")
    with served(fresh) as site, site.client(site.write_token) as client:

        def look(**said: object) -> httpx.Response:
            query = {"name": "a.csv", "said": json.dumps(said)}
            return client.post("/api/imports", params=query, content=content)

        (question,) = [each for each in look().json()["questions"] if each["about"] == "time"]
        assert "2025-10-09 or on 2025-09-10" in question["text"]
        found = look(time=answer).json()
        assert "time" not in [each["about"] for each in found["questions"]]
        assert found["time"] == time
        assert look(time="yesterday").status_code == 422


# ------------------------------------------------------------ silences


def in_days(number: float) -> str:
    return f"{utc_now() + timedelta(days=number):%Y-%m-%dT%H:%M}"


def test_silence_is_shown_until_its_end(browser: httpx.Client, workspace: Workspace) -> None:
    asked = {"hanger": "3", "from": "", "until": in_days(2), "why": "new <joint>"}
    sign_in(browser, "reader")
    assert "Silence notifications" not in browser.get("/alerts").text
    assert browser.post("/silences", data=asked).status_code == 403
    sign_in(browser, "operator")
    assert "Notifications are on for all hangers." in browser.get("/alerts").text
    past = in_days(-1)
    for wrong in ({"hanger": ""}, {"until": ""}, {"until": past}, {"hanger": "99"}, {"why": " "}):
        assert browser.post("/silences", data={**asked, **wrong}).status_code // 100 == 4
    assert browser.post("/silences", data=asked, headers=FOREIGN).status_code == 403
    made = browser.post("/silences", data=asked)
    assert (made.status_code, made.headers["location"]) == (303, "/alerts#silences")
    later = {"hanger": "all", "from": in_days(3), "until": in_days(4), "maintenance": "true"}
    browser.post("/silences", data={**asked, **later})
    told = "Silence 1: hooks receive nothing about hanger 3 until"
    page = browser.get("/").text
    assert told in page
    assert "new &lt;joint&gt;" in page
    assert "all hangers" not in page  # which is to come
    page = browser.get("/alerts").text
    assert "Silences and maintenance (2)" in page
    assert "Maintenance window 2: tests of all hangers are not compared with the baseline" in page
    assert browser.post("/silences/1/end").status_code == 303
    assert told not in browser.get("/").text
    assert browser.post("/silences/1/end").status_code == 409
    with workspace.store() as store:
        first, second = store.silences.list_all()
    assert (first.who, first.ended_who, first.why) == ("operator", "operator", "new <joint>")
    assert (second.hanger, second.is_maintenance) == (None, True)
