"""What is held shows on the pages, in the documents and in what watches over the service."""

from __future__ import annotations

from collections.abc import Iterator

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.heartbeat import beat
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import make_workspace, write_held, write_test


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Hanger 3 with a good test and one of 1970, hanger 4 with one of 1970 alone."""
    made = make_workspace(tmp_path_factory.mktemp("held") / "bridge", hangers=(3, 4))
    with pytest.MonkeyPatch.context() as patch:
        quick_update.stand_in(patch.setattr)
        write_test(made.spool / "good.modes.json", made)
        ingest(made)
        for number in (3, 4):
            write_held(made, number)
        ingest(made)
    beat(made)
    return made


@pytest.fixture(scope="module")
def client(bridge: Workspace) -> Iterator[httpx.Client]:
    site: Served
    with served(bridge) as site, site.client(site.read_token, Accept="text/html") as client:
        yield client


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


def test_a_held_test_has_no_page_and_no_place_in_the_lists(client: httpx.Client) -> None:
    assert client.get("/hangers/3/tests/epoch3").status_code == 404
    assert "epoch3" not in client.get("/hangers/3/tests").text
    alerts = client.get("/alerts").text
    assert 'href="/operation#held"' in alerts
    assert "/hangers/3/tests/epoch3" not in alerts


def test_an_upload_that_is_held_says_why_and_leads_to_the_decision(client: httpx.Client) -> None:
    text = client.get("/upload/outcome/2").text
    assert "<html" not in text
    assert "epoch3.modes.json" in text
    assert "1970" in text
    assert 'href="/operation#held-2"' in text
    assert client.get("/upload/outcome/99").status_code == 404


def test_health_asks_for_attention_and_does_not_fail(client: httpx.Client) -> None:
    found = client.get("/health")
    assert found.status_code == 200
    assert found.json() == {
        "status": "ok",
        "reasons": [],
        "attention": [
            "hanger 3: recording 2 is held until a person decides.",
            "hanger 4: recording 3 is held until a person decides.",
        ],
    }


def test_metrics_count_it_and_not_in_the_queue(client: httpx.Client) -> None:
    text = client.get("/metrics").text
    assert 'shm_recordings{stage="held"} 2.0' in text
    assert "shm_queue_length 0.0" in text
    assert "shm_store_up 1.0" in text


def test_documents_name_it(client: httpx.Client) -> None:
    found = client.get("/api/operation").json()["held"]
    assert [(each["recording"], each["hanger"]) for each in found] == [(2, 3), (3, 4)]
    recording = client.get("/api/recordings/2").json()
    assert recording["stage"] == "held"
    assert "1970-01-01" in recording["reason"]["message"]
    assert recording["tests"] == []
    assert client.get("/api/hangers/3").json()["tests"] == 1
