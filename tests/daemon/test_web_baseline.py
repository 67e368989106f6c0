"""A baseline is set on the page of a hanger, by an engineer, beside what else the pages do."""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import timedelta
from functools import partial

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.web.address import Address
from shm_daemon.web.background_work import BackgroundWorker
from tests.daemon.test_web_people import add_a_user_of_each_role, sign_in
from tests.helpers.flows import ingest
from tests.helpers.web_servers import a_thread, served
from tests.helpers.workspaces import START, make_workspace, write_slow_loss

PAGE = "/hangers/3/baseline"
LAST = f"{START + timedelta(days=60):%Y-%m-%d}"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    made = make_workspace(tmp_path_factory.mktemp("baseline") / "bridge", hangers=(3, 4))
    write_slow_loss(made.spool, made)
    ingest(made)
    add_a_user_of_each_role(made)
    return made


@pytest.fixture(scope="module")
def browser(workspace: Workspace) -> Iterator[httpx.Client]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "shm_daemon.web.app.BackgroundWorker", partial(BackgroundWorker, pool=a_thread)
        )
        with served(workspace, Address("0.0.0.0")) as site, site.client(Origin=site.url) as client:
            yield client


def outcome(browser: httpx.Client, answer: httpx.Response) -> httpx.Response:
    """Return the outcome of an order, once it was made."""
    assert answer.status_code == 303
    page = answer.headers["location"]
    assert f'data-fragment="{page.replace("?", "/outcome?")}"' in browser.get(page).text
    for _ in range(600):
        found = browser.get(page.replace("?", "/outcome?"))
        if found.status_code != 202:
            return found
        time.sleep(0.1)
    raise AssertionError("it was not made within a minute")


def test_an_engineer_sets_it_and_is_told_what_holds_from_now_on(
    browser: httpx.Client, workspace: Workspace
) -> None:
    asked = {"since": LAST, "kind": "accepted as it is", "why": "the deck was <lifted>"}
    sign_in(browser, "operator")
    assert browser.get(PAGE).status_code == 403
    assert browser.post(PAGE, data=asked).status_code == 403
    assert PAGE not in browser.get("/hangers/3").text
    sign_in(browser, "engineer")
    assert PAGE in browser.get("/hangers/3").text
    assert "Compared with one test" in browser.get(PAGE).text
    assert "has no baseline yet" in browser.get("/hangers/4/baseline").text
    for wrong, status in (({"since": ""}, 422), ({"why": " "}, 409), ({"kind": "prayed"}, 422)):
        assert browser.post(PAGE, data={**asked, **wrong}).status_code == status
    said = outcome(browser, browser.post(PAGE, data=asked))
    assert said.status_code == 200
    assert "Hanger 3 is compared with its" in said.text
    assert "from now on" in said.text
    with workspace.store() as store:
        made = store.watch.baseline(3)
        assert not store.alerts.list_all(3, standing=True)
    assert made is not None
    assert (made.who, made.why) == ("engineer", "accepted as it is: the deck was <lifted>")
    assert "the deck was &lt;lifted&gt;" in browser.get(PAGE).text
    assert "baseline set" in browser.get("/audit").text


def test_an_order_that_cannot_be_made_says_why_and_changes_nothing(
    browser: httpx.Client, workspace: Workspace
) -> None:
    sign_in(browser, "engineer")
    with workspace.store() as store:
        before = store.watch.baseline(3)
    said = outcome(browser, browser.post(PAGE, data={"since": "2031-01-01", "why": "x"}))
    assert said.status_code == 404
    assert "hanger 3 has no test since 2031-01-01" in said.text
    assert browser.get(f"{PAGE}/outcome?order=unknown").status_code == 404
    with workspace.store() as store:
        after = store.watch.baseline(3)
    assert before is not None
    assert after is not None
    assert before.id == after.id
