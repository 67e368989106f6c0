"""The audit log: each way in leaves a row with who came, and only engineers read it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import httpx
import pytest

from shm.errors import NothingThere
from shm.pipeline import utc_now
from shm.store import Scope, Workspace
from shm.store.journal import Actor, change_document, list_changes
from shm.store.rows import Role
from shm_cli.main import run
from tests.helpers.web_servers import PASSWORD, UPLOAD, Served, sign_in


@pytest.fixture
def browser(workspace: Workspace, at_home: Served) -> Iterator[httpx.Client]:
    with replace(workspace, actor=Actor("anna", "page")).store() as store:
        for role in Role:
            store.people.add(role, role, PASSWORD, utc_now())
    with at_home.client(Origin=at_home.url) as client:
        yield client


def newest(workspace: Workspace) -> tuple[str, ...]:
    with workspace.store() as store:
        (row,) = list_changes(store, limit=1)
    change = change_document(row)
    return tuple(str(change[name]) for name in ("who", "via", "action", "subject"))


def test_what_page_api_and_command_line_change_is_noted_with_who_did_it(
    at_home: Served,
    browser: httpx.Client,
    workspace: Workspace,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    sign_in(browser, "operator")
    browser.post(UPLOAD, content=b"x")
    assert newest(workspace) == ("operator", "page", "recording uploaded", "x.csv")
    with at_home.client(at_home.write_token) as program:
        program.post(UPLOAD, content=b"y")
    assert newest(workspace)[:3] == ("token write", "API", "recording uploaded")
    monkeypatch.setattr("getpass.getuser", lambda: "huber")
    at = ["--workspace", str(workspace.folder)]
    silence = ("alerts", "silence", "--hanger", "3", "--until", "2099-01-01", "--why", "paint")
    assert run([*at, *silence]) == 0
    *noted, of = newest(workspace)
    assert noted == ["huber", "command line", "silence made"]
    assert of.startswith("silence 1, hanger 3, ")
    assert of.endswith(" to 2099-01-01 00:00 UTC")
    capsys.readouterr()
    assert run([*at, "audit", "--json", "--limit", "1"]) == 0
    assert json.loads(capsys.readouterr().out)["changes"][0]["detail"] == "paint"


def test_failed_change_leaves_no_row(workspace: Workspace) -> None:
    with workspace.store() as store:
        anna = store.acting_as(Actor("anna", "page"))
        with pytest.raises(NothingThere, match="no token"):
            anna.upkeep.revoke_token("none such", utc_now())
        store.upkeep.create_token("made by nobody", Scope.READ, utc_now())
        assert list_changes(store) == ()


def test_only_an_engineer_reads_it(browser: httpx.Client, at_home: Served) -> None:
    assert browser.get("/audit").status_code == 401
    sign_in(browser, "operator")
    assert browser.get("/audit").status_code == 403
    assert 'href="/audit"' not in browser.get("/operation").text
    with at_home.client(at_home.write_token) as program:
        assert program.get("/audit").status_code == 401
    sign_in(browser, "engineer")
    assert "user added" in browser.get("/audit").text
    assert 'href="/audit"' in browser.get("/operation").text


def test_signed_in_need_not_sign_in(browser: httpx.Client, at_home: Served) -> None:
    wrong = browser.post("/sign-in", data={"name": "reader", "password": "wrong"})
    assert wrong.status_code == 401
    assert "password" in wrong.json()["remedy"]
    assert "Bearer" not in wrong.json()["remedy"]
    with at_home.client("wrong") as program:
        assert "Bearer" in program.get("/api/status").json()["remedy"]
    sign_in(browser, "reader")
    gone_on = browser.get("/sign-in?next=/alerts")
    assert (gone_on.status_code, gone_on.headers["location"]) == (303, "/alerts")
