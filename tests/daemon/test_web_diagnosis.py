"""A gap is diagnosed on the page of a hanger, beside what else the pages do."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import httpx
import pytest

from shm.store import Workspace
from shm.store.watch import find_latest_diagnosis
from shm_daemon.web.background_work import BackgroundWorker
from tests.daemon.test_web_baseline import outcome
from tests.daemon.test_web_people import add_a_user_of_each_role, sign_in
from tests.helpers.flows import ingest
from tests.helpers.web_servers import a_thread, served
from tests.helpers.workspaces import make_workspace, write_loss

PAGE = "/hangers/3/diagnosis"


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    made = make_workspace(tmp_path_factory.mktemp("diagnosis") / "bridge", hangers=(3, 4))
    write_loss(made.spool, made)
    ingest(made)
    add_a_user_of_each_role(made)
    return made


@pytest.fixture(scope="module")
def browser(workspace: Workspace) -> Iterator[httpx.Client]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "shm_daemon.web.app.BackgroundWorker", partial(BackgroundWorker, pool=a_thread)
        )
        with served(workspace) as site, site.client(Origin=site.url, Accept="text/html") as client:
            yield client


def test_an_operator_has_it_diagnosed_and_reads_it_on_the_hangers_page(
    browser: httpx.Client, workspace: Workspace
) -> None:
    sign_in(browser, "reader")
    assert "Diagnose now" not in browser.get("/hangers/3").text
    assert browser.post(PAGE).status_code == 403
    sign_in(browser, "operator")
    assert "Diagnose now" in browser.get("/hangers/3").text
    assert 'name="all_tests"' in browser.get(PAGE).text
    ordered = browser.post(PAGE, data={"all_tests": "true"})
    waiting = browser.get(ordered.headers["location"].replace("?", "/outcome?"))
    assert waiting.status_code == 202
    assert "You can leave this page" in waiting.text
    found = outcome(browser, ordered)
    assert found.status_code == 200
    with workspace.store() as store:
        kept = find_latest_diagnosis(store, 3)
    assert kept is not None
    assert kept.diagnosis.tests == ("t0", "t1")  # from before the loss, too; t2 is as t1
    shown = browser.get("/hangers/3").text
    assert "Diagnose anew" in shown
    summary = found.text.partition("<p>")[2].partition("</p>")[0]
    assert summary.split(". ")[0] in shown


def test_a_hanger_without_a_test_is_refused_and_an_old_order_is_not_known(
    browser: httpx.Client,
) -> None:
    sign_in(browser, "operator")
    assert browser.post("/hangers/4/diagnosis").status_code in (404, 409)
    assert browser.get(f"{PAGE}/outcome?order=gone").status_code == 404
