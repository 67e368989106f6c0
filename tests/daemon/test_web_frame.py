"""The frame of the dashboard: what every page has, its scripts and styles, commands as links."""

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
from shm_daemon.web.commands import set_reader, with_links, without_commands
from shm_daemon.web.frame import NAVIGATION
from tests.helpers.web_servers import ELSEWHERE, HTML, served
from tests.helpers.workspaces import make_workspace

PAGES = tuple(address for address, _ in NAVIGATION)


@pytest.mark.parametrize("path", PAGES)
def test_page_for_keyboard_and_reader(client: httpx.Client, path: str) -> None:
    """It holds no script of its own and names nothing from elsewhere."""
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
    assert not re.search(r"<script(?![^>]*\bsrc=)", text)
    assert not re.search(r"\son[a-z]+=", text)
    addresses = re.findall(r'(?:src|href|action|content)="([^"]*//[^"]*)"', text)
    assert addresses == []
    for address in re.findall(r'(?:src|href)="(/static/[^"]+)"', text):
        assert client.get(address).status_code == 200


def test_every_page_says_once_that_the_daemon_has_not_reported_for_long(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    beat(workspace)
    with served(workspace) as site, site.client(**HTML) as client:
        assert not any("daemon was last" in client.get(path).text for path in PAGES)
        long_ago = time.time() - patience_s(workspace) - 120
        os.utime(workspace.folder / HEARTBEAT, (long_ago, long_ago))
        for path in PAGES:
            assert client.get(path).text.count("The daemon was last seen 3 min ago.") == 1, path


def test_static_files_are_ours_alone_and_kept_by_version(client: httpx.Client) -> None:
    address = re.search(r'name="plotly" content="([^"]+)"', client.get("/").text)
    assert address is not None
    packed = client.get(address[1])
    assert packed.headers["Content-Encoding"] == "gzip"
    assert "immutable" in packed.headers["Cache-Control"]
    plain = client.get("/static/plotly.js", headers={"Accept-Encoding": "identity"})
    assert plain.content == packed.content
    assert b"plotly.js v" in plain.content[:200]
    assert plain.headers["Cache-Control"] == "no-cache"
    for name in ("../app.py", "%2e%2e/app.py", "..%2fapp.py", "bridge.toml", ".", "nix.js"):
        assert client.get(f"/static/{name}").status_code in (404, 400)


def test_error_is_page_or_document(client: httpx.Client) -> None:
    page = client.get("/no/such/page")
    assert page.status_code == 404
    assert page.headers["Content-Type"].startswith("text/html")
    assert "There is no such page." in page.text
    assert client.get("/api/hangers/99").json()["message"]
    as_program = client.get("/no/such/page", headers={"Accept": "application/json"})
    assert as_program.json()["message"] == "There is no such page."


def test_a_store_that_is_away_is_said_on_the_page(workspace: Workspace) -> None:
    with served(workspace) as site, site.client(**HTML) as client:
        Path(workspace.database).rename(workspace.folder / "gone.db")
        page = client.get("/")
    assert page.status_code == 503
    assert "That did not work" in page.text


def test_what_is_named_in_bridge_toml_cannot_become_html(tmp_path: Path) -> None:
    config = tmp_path / "c.toml"
    config.write_text('[bridge]\nname = "<script>alert(1)</script>"\n')
    workspace = Workspace.initialise(tmp_path / "odd", config)
    with served(workspace) as site, site.client(**HTML) as client:
        text = client.get("/").text
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert" in text


def test_strangers_learn_nothing_of_the_bridge(workspace: Workspace) -> None:
    with served(workspace, ELSEWHERE) as site, site.client(**HTML) as client:
        for path in (*PAGES, "/moved", "/operation/examination"):
            page = client.get(path)
            assert page.status_code == 401
            assert "Test bridge" not in page.text
            assert '<form method="post" action="/sign-in">' in page.text


@pytest.fixture(autouse=True)
def no_hanger() -> Iterator[None]:
    set_reader(None)
    yield
    set_reader(None)


@pytest.mark.parametrize(
    ("text", "link"),
    [
        ("compare the hangers beside it (`shm drift bridge`)", '(<a href="/compare">Compare</a>)'),
        ("Hanger 7: set (`shm drift rebaseline`)", '<a href="/hangers/7/baseline">Baseline</a>'),
        ("for the tension: shm gap diagnose --hanger 18", 'href="/hangers/18/diagnosis"'),
        ("`shm ingest --held`.", '<a href="/operation#held">Held tests</a>.'),
        ("`shm ingest --confirm 37 --time TIME`", '<a href="/operation#held-37">Confirm</a>'),
        ("`shm ingest --discard 37`", '<a href="/operation#held-37">Discard</a>'),
        ("`shm alerts ack 4`", '<a href="/alerts#alert-4">Acknowledge</a>'),
        ("`shm alerts test --hook siren`", 'href="/settings#notifications"'),
        ("its log and `shm doctor` say why", '<a href="/operation#examination">Examination</a>'),
        ("Drop it again with `hanger = 3` in its sidecar", 'href="/upload">Upload it again</a>'),
    ],
)
def test_a_command_becomes_a_link_to_its_page(text: str, link: str) -> None:
    assert link in with_links(text)
    assert "`" not in with_links(text)


def test_a_command_without_a_page_stays_as_code_and_others_words_are_escaped() -> None:
    for command in ("shm alerts silences", "shm db check", "shm archive fetch"):
        assert with_links(f"Run `{command}`.") == f"Run <code>{command}</code>."
    assert with_links("<b> `shm status` <i>") == '&lt;b&gt; <a href="/">Bridge</a> &lt;i&gt;'
    assert without_commands("`shm doctor` warns < 7 days") == "Examination warns < 7 days"


def test_a_command_is_of_the_hanger_and_role_of_the_reader() -> None:
    text = "Once it is explained, set a new baseline (`shm drift rebaseline`)."
    assert "<code>shm drift rebaseline</code>" in with_links(text)
    set_reader(3)
    assert '<a href="/hangers/3/baseline">' in with_links(text)
    set_reader(3, is_engineer=False)
    assert with_links("set a new baseline (`shm drift rebaseline`)") == (
        "set a new baseline (page Baseline, for engineers)"
    )
    assert '<a href="/hangers/3/diagnosis">' in with_links("ask `shm gap diagnose`")
