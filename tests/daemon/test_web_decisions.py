"""Silences, what is held and what counts, decided in a browser by whoever may write."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta

import httpx
import pytest

from shm.pipeline import utc_now
from shm.store import Decision, Stage, Workspace
from shm_daemon.web.address import Address
from tests.daemon.test_web_people import add_a_user_of_each_role, sign_in
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace, write_held, write_test


@pytest.fixture
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workspace]:
    """Hanger 3 with a test that counts, and one of 1970 that is held."""
    made = make_workspace(tmp_path_factory.mktemp("decided") / "bridge")
    with pytest.MonkeyPatch.context() as patch:
        quick_update.stand_in(patch.setattr)
        write_test(made.spool / "good.modes.json", made)
        ingest(made)
        write_held(made, 3)
        ingest(made)
        add_a_user_of_each_role(made)
        yield made


@pytest.fixture
def browser(workspace: Workspace) -> Iterator[httpx.Client]:
    with served(workspace, Address("0.0.0.0")) as site, site.client(Origin=site.url) as client:
        yield client


def in_days(number: float) -> str:
    return f"{utc_now() + timedelta(days=number):%Y-%m-%dT%H:%M}"


def test_an_operator_holds_messages_back_and_every_page_says_so_until_it_ends(
    browser: httpx.Client, workspace: Workspace
) -> None:
    asked = {"hanger": "3", "from": "", "until": in_days(2), "why": "new <joint>"}
    sign_in(browser, "reader")
    assert "Silence notifications" not in browser.get("/alerts").text
    assert browser.post("/silences", data=asked).status_code == 403
    sign_in(browser, "operator")
    assert "Notifications are on for all hangers." in browser.get("/alerts").text
    for wrong in (
        {"hanger": ""},
        {"until": ""},
        {"until": in_days(-1)},
        {"hanger": "99"},
        {"why": " "},
    ):
        assert browser.post("/silences", data={**asked, **wrong}).status_code // 100 == 4
    foreign = {"Origin": "https://elsewhere.example"}
    assert browser.post("/silences", data=asked, headers=foreign).status_code == 403
    made = browser.post("/silences", data=asked)
    assert (made.status_code, made.headers["location"]) == (303, "/alerts#silences")
    later = {
        **asked,
        "hanger": "all",
        "from": in_days(3),
        "until": in_days(4),
        "maintenance": "true",
    }
    browser.post("/silences", data=later)
    told = "Silence 1: hooks are told nothing of hanger 3 until"
    page = browser.get("/").text
    assert told in page
    assert "new &lt;joint&gt;" in page
    assert "all hangers" not in page  # which is to come
    page = browser.get("/alerts").text
    assert "Silences and maintenance (2)" in page
    assert "Maintenance window 2: tests of all hangers are compared with nothing" in page
    assert browser.post("/silences/1/end").status_code == 303
    assert told not in browser.get("/").text
    assert browser.post("/silences/1/end").status_code == 409
    with workspace.store() as store:
        first, second = store.silences.list_all()
    assert (first.who, first.ended_who, first.why) == ("operator", "operator", "new <joint>")
    assert (second.hanger, second.is_maintenance) == (None, True)


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
    assert "Nothing is held." in page
    assert f"was {decision} by <strong>operator</strong>: its clock was dead" in page
    for action in ("confirm", "discard"):  # as of a page that was loaded before
        assert browser.post("/held/2", data={**asked, "action": action}).status_code == 409
    with workspace.store() as store:
        assert store.recordings.get(2).stage is stage
    ingest(workspace)
    with workspace.store() as store:
        names = [each.test.id for each in store.tests.list_all(3)]
    assert ("epoch3" in names) is (decision is Decision.CONFIRMED)


def test_a_test_that_counts_is_discarded_on_its_page_and_taken_back(
    browser: httpx.Client, workspace: Workspace
) -> None:
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
    ingest(workspace)
    assert browser.get("/hangers/3/tests/good").status_code == 200
