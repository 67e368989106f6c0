"""An operator has a gap diagnosed and an engineer sets a baseline on the page of a hanger."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta

import httpx
import pytest

from shm.pipeline import utc_now
from shm.store import Workspace
from shm.store.watch import find_latest_diagnosis
from tests.helpers.taken_in import with_a_slow_loss
from tests.helpers.web_servers import (
    add_a_user_of_each_role,
    in_a_thread,
    outcome,
    served,
    sign_in,
)
from tests.helpers.workspaces import START

BASELINE, DIAGNOSIS = "/hangers/3/baseline", "/hangers/3/diagnosis"
LAST = f"{START + timedelta(days=60):%Y-%m-%d}"


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    made = with_a_slow_loss(tmp_path_factory.mktemp("orders") / "bridge")
    add_a_user_of_each_role(made)
    return made


@pytest.fixture(scope="module")
def browser(bridge: Workspace) -> Iterator[httpx.Client]:
    with in_a_thread(), served(bridge) as site, site.client(Origin=site.url) as client:
        yield client


def test_operator_has_gap_diagnosed(browser: httpx.Client, bridge: Workspace) -> None:
    sign_in(browser, "reader")
    assert "Diagnose now" not in browser.get("/hangers/3").text
    assert browser.post(DIAGNOSIS).status_code == 403
    sign_in(browser, "operator")
    assert "Diagnose now" in browser.get("/hangers/3").text
    assert 'name="all_tests"' in browser.get(DIAGNOSIS).text
    ordered = browser.post(DIAGNOSIS, data={"all_tests": "true"})
    waiting = browser.get(ordered.headers["location"].replace("?", "/outcome?"))
    assert waiting.status_code == 202
    assert "You can leave this page" in waiting.text
    found = outcome(browser, ordered)
    assert found.status_code == 200
    with bridge.store() as store:
        kept = find_latest_diagnosis(store, 3)
    assert kept is not None
    assert kept.diagnosis.tests == ("t0", "t4", "t5", "t6")  # before the loss, too; t1 is as t0
    shown = browser.get("/hangers/3").text
    assert "Diagnose again" in shown
    summary = found.text.partition("<p>")[2].partition("</p>")[0]
    assert summary.split(". ")[0] in shown


def test_diagnosis_without_test(browser: httpx.Client) -> None:
    sign_in(browser, "operator")
    assert browser.post("/hangers/4/diagnosis").status_code in (404, 409)
    assert browser.get(f"{DIAGNOSIS}/outcome?order=gone").status_code == 404


def test_engineer_sets_a_baseline(browser: httpx.Client, bridge: Workspace) -> None:
    asked = {"since": LAST, "kind": "accepted as it is", "why": "the deck was <lifted>"}
    sign_in(browser, "operator")
    assert browser.get(BASELINE).status_code == 403
    assert browser.post(BASELINE, data=asked).status_code == 403
    assert BASELINE not in browser.get("/hangers/3").text
    sign_in(browser, "engineer")
    assert BASELINE in browser.get("/hangers/3").text
    assert "Compared with one test" in browser.get(BASELINE).text
    assert "has no baseline yet" in browser.get("/hangers/4/baseline").text
    for wrong, status in (({"since": ""}, 422), ({"why": " "}, 409), ({"kind": "prayed"}, 422)):
        assert browser.post(BASELINE, data={**asked, **wrong}).status_code == status
    said = outcome(browser, browser.post(BASELINE, data=asked))
    assert said.status_code == 200
    assert "Hanger 3 is compared with its" in said.text
    assert "from now on" in said.text
    with bridge.store() as store:
        made = store.watch.baseline(3)
        assert not store.alerts.list_all(3, standing=True)
    assert made is not None
    assert (made.who, made.why) == ("engineer", "accepted as it is: the deck was <lifted>")
    assert "the deck was &lt;lifted&gt;" in browser.get(BASELINE).text
    assert "baseline set" in browser.get("/audit").text


def test_impossible_baseline_says_why(browser: httpx.Client, bridge: Workspace) -> None:
    sign_in(browser, "engineer")
    with bridge.store() as store:
        before = store.watch.baseline(3)
    future = browser.post(BASELINE, data={"since": "2031-01-01", "why": "x"})
    assert future.status_code == 422
    assert "2031-01-01 is yet to come" in future.text
    today = f"{utc_now():%Y-%m-%d}"
    said = outcome(browser, browser.post(BASELINE, data={"since": today, "why": "x"}))
    assert said.status_code == 404
    assert f"hanger 3 has no test since {today}" in said.text
    assert "Test it first" in said.text
    assert browser.get(f"{BASELINE}/outcome?order=unknown").status_code == 404
    with bridge.store() as store:
        after = store.watch.baseline(3)
    assert before is not None
    assert after is not None
    assert before.id == after.id
