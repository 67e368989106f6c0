"""The frame of the dashboard: what every page has, its scripts and styles, its figures."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from shm.store import Workspace
from shm_daemon.heartbeat import HEARTBEAT, beat, patience_s
from shm_daemon.web.address import Address
from shm_daemon.web.frame import NAVIGATION
from tests.helpers.web_servers import Served, served
from tests.helpers.workspaces import make_workspace

PAGES = tuple(address for address, _ in NAVIGATION)
BROWSER = {"Accept": "text/html,application/xhtml+xml"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(make_workspace(tmp_path_factory.mktemp("frame") / "bridge")) as site:
        yield site


@pytest.fixture(scope="module")
def client(site: Served) -> Iterator[httpx.Client]:
    with site.client(**BROWSER) as client:
        yield client


@pytest.mark.parametrize("path", PAGES)
def test_a_page_can_be_used_by_keyboard_and_read_aloud(client: httpx.Client, path: str) -> None:
    page = client.get(path)
    assert page.status_code == 200
    text = page.text
    assert text.startswith("<!doctype html>")
    assert '<html lang="en">' in text
    assert 'class="skip" href="#main"' in text
    assert 'id="main"' in text
    assert text.count("<h1") == 1
    assert 'aria-current="page"' in text
    assert "nan" not in re.findall(r"[a-z]+", re.sub(r"<[^>]*>", " ", text).lower())


def test_every_page_says_once_that_the_daemon_has_not_reported_for_long(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    beat(workspace)
    with served(workspace) as site, site.client(**BROWSER) as client:
        assert not any("daemon was last" in client.get(path).text for path in PAGES)
        long_ago = time.time() - patience_s(workspace) - 120
        os.utime(workspace.folder / HEARTBEAT, (long_ago, long_ago))
        for path in PAGES:
            assert client.get(path).text.count("The daemon was last seen 3 min ago.") == 1, path


@pytest.mark.parametrize("path", PAGES)
def test_no_page_holds_a_script_or_fetches_from_elsewhere(client: httpx.Client, path: str) -> None:
    text = client.get(path).text
    assert not re.search(r"<script(?![^>]*\bsrc=)", text)
    assert not re.search(r"\son[a-z]+=", text)
    addresses = re.findall(r'(?:src|href|action|content)="([^"]*//[^"]*)"', text)
    assert addresses == []
    for address in re.findall(r'(?:src|href)="(/static/[^"]+)"', text):
        assert client.get(address).status_code == 200


def test_plotly_is_that_of_the_installed_package_and_kept_by_its_version(
    client: httpx.Client,
) -> None:
    address = re.search(r'name="plotly" content="([^"]+)"', client.get("/").text)
    assert address is not None
    packed = client.get(address[1])
    assert packed.headers["Content-Encoding"] == "gzip"
    assert "immutable" in packed.headers["Cache-Control"]
    plain = client.get("/static/plotly.js", headers={"Accept-Encoding": "identity"})
    assert plain.content == packed.content
    assert b"plotly.js v" in plain.content[:200]
    assert plain.headers["Cache-Control"] == "no-cache"


def test_only_our_own_files_are_given_out(client: httpx.Client) -> None:
    for name in ("../app.py", "%2e%2e/app.py", "..%2fapp.py", "bridge.toml", ".", "nix.js"):
        assert client.get(f"/static/{name}").status_code in (404, 400)


def test_an_error_is_a_page_for_a_person_and_a_document_for_a_program(
    client: httpx.Client,
) -> None:
    page = client.get("/no/such/page")
    assert page.status_code == 404
    assert page.headers["Content-Type"].startswith("text/html")
    assert "There is no such page." in page.text
    assert client.get("/api/hangers/99").json()["message"]
    as_program = client.get("/no/such/page", headers={"Accept": "application/json"})
    assert as_program.json()["message"] == "There is no such page."


def test_a_store_that_is_away_is_said_on_the_page(workspace: Workspace) -> None:
    with served(workspace) as site, site.client(**BROWSER) as client:
        Path(workspace.database).rename(workspace.folder / "gone.db")
        page = client.get("/")
    assert page.status_code == 503
    assert "That did not work" in page.text


def test_what_is_named_in_bridge_toml_cannot_become_html(tmp_path: Path) -> None:
    config = tmp_path / "c.toml"
    config.write_text('[bridge]\nname = "<script>alert(1)</script>"\n')
    workspace = Workspace.initialise(tmp_path / "odd", config)
    with served(workspace) as site, site.client(**BROWSER) as client:
        text = client.get("/").text
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert" in text


def test_strangers_learn_nothing_of_the_bridge(workspace: Workspace) -> None:
    with served(workspace, Address("0.0.0.0")) as site, site.client(**BROWSER) as client:
        for path in (*PAGES, "/moved", "/operation/examination"):
            page = client.get(path)
            assert page.status_code == 401
            assert "Test bridge" not in page.text
            assert '<form method="post" action="/sign-in">' in page.text
