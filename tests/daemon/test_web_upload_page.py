"""The page where recordings are handed in, and what it can follow of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.web.access import COOKIE
from tests.helpers.taken_in import ingest_quickly
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import put, write_loss

BROWSER = {"Accept": "text/html"}


@pytest.fixture
def site(workspace: Workspace) -> Iterator[Served]:
    with served(workspace) as site:
        yield site


@pytest.fixture
def writer(site: Served) -> Iterator[httpx.Client]:
    with site.client(**BROWSER, Origin=site.url) as client:
        client.cookies.set(COOKIE, site.write_token)
        yield client


def test_files_are_offered_only_to_who_may_send_them(site: Served, writer: httpx.Client) -> None:
    with site.client(**BROWSER) as client:
        assert 'type="file"' not in client.get("/upload").text
        assert "/sign-in?next=/upload" in client.get("/upload").text
    page = writer.get("/upload").text
    assert 'type="file" id="files" multiple' in page
    assert '<option value="3">Hanger 3</option>' in page


def test_a_file_is_followed_until_it_is_a_test_or_its_reason_is_told(
    workspace: Workspace, writer: httpx.Client, tmp_path: Path
) -> None:
    write_loss(tmp_path, workspace, lost=0)
    good = sorted(tmp_path.glob("*.modes.json"))[0]
    sent = writer.post(f"/api/recordings?name={good.name}", content=good.read_bytes()).json()
    asked = f"/api/recordings?sha256={sent['sha256']}"
    assert writer.get(asked).json() == {"recordings": []}
    put(workspace.spool / "bad.csv", "no recording\n")
    ingest_quickly(workspace)
    (found,) = writer.get(asked).json()["recordings"]
    assert found == writer.get(sent["status_url"]).json()
    (test,) = found["tests"]
    assert test["page"].startswith("/hangers/3/tests/")
    assert found["stage"] in ("identified", "updated", "watched", "done")
    refused = hashlib.sha256(b"no recording\n").hexdigest()
    reason = writer.get(f"/api/recordings/{refused}").json()
    assert (reason["stage"], reason["tests"]) == ("refused", [])
    assert reason["reason"]["message"]
