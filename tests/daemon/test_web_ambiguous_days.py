"""Days such as 9/10/2025 in a browser: asked in an import, answered on a page, never silent."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator

import httpx
import pytest

from shm.store import Stage, Workspace
from shm_daemon.web.address import Address
from tests.daemon.test_web_people import add_a_user_of_each_role, sign_in
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.logger_exports import write_described_export, write_export
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace, write_test


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workspace]:
    """Hanger 3 with a test without a time, and one whose day may be of September or October."""
    made = make_workspace(tmp_path_factory.mktemp("days") / "bridge")
    with pytest.MonkeyPatch.context() as patch:
        quick_update.stand_in(patch.setattr)
        undated = made.spool / "undated.modes.json"
        write_test(undated, made)
        document = json.loads(undated.read_text())
        document["tests"][0]["time"] = None
        undated.write_text(json.dumps(document))
        ingest(made)
        write_described_export(made.spool / "held.csv", "9/10/2025 9:12:31 AM")
        ingest(made)
        add_a_user_of_each_role(made)
        yield made


@pytest.fixture(scope="module")
def browser(workspace: Workspace) -> Iterator[httpx.Client]:
    with served(workspace, Address("0.0.0.0")) as site, site.client(Origin=site.url) as client:
        sign_in(client, "operator")
        yield client


def test_hanger_page_names_undated_tests(browser: httpx.Client) -> None:
    page = browser.get("/hangers/3").text
    assert "1 test without a time is dated by the receipt of the file: undated." in page


def test_held_page_teaches_day_order(browser: httpx.Client, workspace: Workspace) -> None:
    said = "its day may be 2025-10-09 or 2025-09-10"
    assert all(said in browser.get(page).text for page in ("/", "/hangers/3", "/operation"))
    asked = {"action": "confirm", "why": "by the diary", "time": "2025-09-10T09:12"}
    assert browser.post("/held/2", data=asked).status_code == 303
    with workspace.store() as store:
        assert store.recordings.get(2).stage is Stage.IDENTIFIED
    (profile,) = (workspace.folder / "loggers").iterdir()
    assert tomllib.loads(profile.read_text())["day_order"] == "month first"


@pytest.mark.parametrize(
    ("answer", "time"), [("2025-10-09", "2025-10-09T09:12:31Z"), ("unknown", None)]
)
def test_import_page_asks_for_day(
    workspace: Workspace, tmp_path_factory: pytest.TempPathFactory, answer: str, time: str | None
) -> None:
    fresh = make_workspace(tmp_path_factory.mktemp("import") / "bridge")
    content = write_export(workspace.folder / "a.csv", "9/10/2025 9:12:31 AM").read_bytes()
    with served(fresh) as site, site.client(Authorization=f"Bearer {site.write_token}") as client:

        def look(**said: object) -> httpx.Response:
            query = {"name": "a.csv", "said": json.dumps(said)}
            return client.post("/api/imports", params=query, content=content)

        (question,) = [each for each in look().json()["questions"] if each["about"] == "time"]
        assert "2025-10-09 or on 2025-09-10" in question["text"]
        found = look(time=answer).json()
        assert "time" not in [each["about"] for each in found["questions"]]
        assert found["time"] == time
        assert look(time="yesterday").status_code == 422
