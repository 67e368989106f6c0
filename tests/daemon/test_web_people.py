"""People who sign in by name: what each role may, and that every route asks for one."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack

import argon2
import httpx
import pytest
import sqlalchemy as sa

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store import Workspace
from shm.store.journal import list_changes
from shm.store.rows import Role
from shm.store.tables import users
from shm_daemon.web.site import MOST_WRONG
from tests.helpers.waiting import until
from tests.helpers.web_servers import (
    ELSEWHERE,
    PASSWORD,
    UPLOAD,
    add_a_user_of_each_role,
    served,
    sign_in,
)


@pytest.mark.parametrize(
    ("role", "upload"), [("reader", 403), ("operator", 202), ("engineer", 202)]
)
def test_role_opens_what_it_may(browser: httpx.Client, role: str, upload: int) -> None:
    assert sign_in(browser, role) == 303
    kept = dict(browser.cookies)
    assert browser.get("/api/status").status_code == 200
    assert browser.post(UPLOAD, content=b"x").status_code == upload
    browser.post("/sign-out")
    browser.cookies.update(kept)
    assert browser.get("/api/status").status_code == 401


def test_removed_user_is_out(browser: httpx.Client, workspace: Workspace) -> None:
    sign_in(browser, "operator")
    with workspace.store() as store:
        store.people.remove("operator", utc_now())
    assert browser.get("/api/status").status_code == 401
    told = [sign_in(browser, "reader", "wrong") for _ in range(MOST_WRONG)]
    assert set(told) == {401}
    assert sign_in(browser, "reader") == 429


def test_wrong_passwords_keep_out_nobody_else(browser: httpx.Client) -> None:
    sign_in(browser, "operator")
    for _ in range(MOST_WRONG + 4):
        sign_in(browser, "reader", "wrong")
    assert browser.get("/api/status").status_code == 200
    browser.cookies.clear()
    assert sign_in(browser, "engineer") == 303


def test_new_password_ends_other_sessions(browser: httpx.Client, workspace: Workspace) -> None:
    def change(old: str, new: str, again: str) -> httpx.Response:
        told = {"old": old, "password": new, "again": again}
        return browser.post("/password", data=told, headers={"Accept": "text/html"})

    sign_in(browser, "reader")
    elsewhere = dict(browser.cookies)
    browser.cookies.clear()
    sign_in(browser, "reader")
    new = PASSWORD + "!"
    assert 'href="/password"' in browser.get("/operation").text
    assert change("wrong", new, new).status_code == 403
    assert "passwords differ" in change(PASSWORD, new, "else").text
    assert "15 to" in change(PASSWORD, "short", "short").text
    assert change(PASSWORD, new, new).status_code == 303
    assert browser.get("/password").status_code == 200
    browser.cookies.update(elsewhere)
    assert browser.get("/password").status_code == 401
    browser.cookies.clear()
    assert [sign_in(browser, "reader", each) for each in (PASSWORD, new)] == [401, 303]
    with workspace.store() as store:
        (row,) = list_changes(store, limit=1)
    assert (row.who, row.via, row.kind, row.subject) == (
        "reader", "page", "password changed", "user reader",
    )  # fmt: skip
    assert [change("wrong", new, new).status_code for _ in range(MOST_WRONG)][-1] == 429


def test_a_token_has_no_password(workspace: Workspace) -> None:
    with served(workspace) as site, site.client(Origin=site.url) as client:
        client.post("/sign-in", data={"token": site.write_token})
        assert client.get("/password").status_code == 403


def test_a_short_password_and_a_name_twice_are_refused(workspace: Workspace) -> None:
    with workspace.store() as store:
        with pytest.raises(UsageError, match="15 to"):
            store.people.add("a", Role.READER, "short", utc_now())
        store.people.add("a", Role.READER, PASSWORD, utc_now())
        with pytest.raises(UsageError, match="already"):
            store.people.add("a", Role.READER, PASSWORD, utc_now())


def test_a_name_that_can_pass_for_another_is_refused(workspace: Workspace) -> None:
    with workspace.store() as store:
        for name, said in (
            ("an\u200bna", "invisible"),
            ("anna\u2060", "invisible"),
            ("an\tna", "invisible"),
            ("\u00a0 ", "short text"),
        ):
            with pytest.raises(UsageError, match=said):
                store.people.add(name, Role.READER, PASSWORD, utc_now())


def test_a_name_is_taken_in_every_form_and_case_and_signs_in_so(workspace: Workspace) -> None:
    with workspace.store() as store:
        store.people.add(" Jose\u0301  Huber", Role.READER, PASSWORD, utc_now())
        assert [each.name for each in store.people.list_all()] == ["Jos\u00e9 Huber"]
        for alike in ("jose\u0301  huber ", "JOS\u00c9 HUBER", "\uff2aos\u00e9\u00a0Huber"):
            with pytest.raises(UsageError, match="there is a user Jos\u00e9 Huber already"):
                store.people.add(alike, Role.READER, PASSWORD, utc_now())
            assert store.people.sign_in(alike, PASSWORD, utc_now())
        store.people.add("\u5c71\u7530\u30a8\u30ea\u3005", Role.READER, PASSWORD, utc_now())


def test_names_that_an_older_release_took_keep_working(workspace: Workspace) -> None:
    """Of two that are alike, the one that is written."""
    with workspace.store() as store:
        for old, name in (("one", "anna"), ("two", "Anna "), ("three", "Jose\u0301")):
            store.people.add(old, Role.READER, PASSWORD + old, utc_now())
            with store.people.writing() as connection:
                connection.execute(sa.update(users).where(users.c.name == old).values(name=name))
        assert store.people.sign_in("anna", PASSWORD + "one", utc_now())
        assert store.people.sign_in("Anna ", PASSWORD + "two", utc_now())
        assert store.people.sign_in("ANNA", PASSWORD + "one", utc_now()) is None
        with pytest.raises(UsageError, match="already"):
            store.people.add("ANNA", Role.READER, PASSWORD, utc_now())
        assert store.people.sign_in("Jos\u00e9", PASSWORD + "three", utc_now())
        store.people.remove("Anna ", utc_now())
        assert store.people.sign_in("ANNA", PASSWORD + "one", utc_now())


def test_guesses_from_many_addresses_wait(workspace: Workspace) -> None:
    add_a_user_of_each_role(workspace)

    def attempt(number: int, name: str, password: str) -> int:
        forwarded = {"X-Forwarded-For": f"203.0.113.{number}"}
        told = {"name": name, "password": password}
        return client.post("/sign-in", data=told, headers=forwarded).status_code

    with served(workspace, ELSEWHERE) as site, site.client(Origin=site.url) as client:
        told = [attempt(number // 5, "reader", "wrong") for number in range(100)]
        assert set(told) == {401}
        assert attempt(200, " READER ", PASSWORD) == 429
        assert attempt(201, "engineer", PASSWORD) == 303


def test_sign_ins_leave_pages_free(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    add_a_user_of_each_role(workspace)
    released, lock, hasher = threading.Event(), threading.Lock(), argon2.PasswordHasher()
    under_way, most = [0], [0]

    class Slow:
        def verify(self, *arguments: str) -> bool:
            with lock:
                under_way[0] += 1
                most[0] = max(most[0], under_way[0])
            released.wait(60)
            with lock:
                under_way[0] -= 1
            return hasher.verify(*arguments)

    monkeypatch.setattr(argon2, "PasswordHasher", Slow)
    with served(workspace) as site, ThreadPoolExecutor(40) as callers, ExitStack() as stack:
        clients = [stack.enter_context(site.client(Origin=site.url)) for _ in range(40)]
        signing = [callers.submit(sign_in, each, "reader") for each in clients]
        try:
            until(lambda: most[0] > 0)
            wait(signing, timeout=2)  # the others have come, too
            asked = ("/health", "/sign-in", "/api/status", "/metrics")
            with site.client() as client:
                told = {path: client.get(path).status_code for path in asked}
        finally:
            released.set()
        assert [each.result() for each in signing] == [303] * 40
    assert told == {"/health": 503, "/sign-in": 200, "/api/status": 200, "/metrics": 200}
    assert most == [1]  # so that cores are free for all others; no daemon is running
