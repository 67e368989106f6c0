"""People who sign in by name: what each role may, and that every route asks for one."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack

import argon2
import httpx
import pytest
import sqlalchemy as sa
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute

from shm.errors import UsageError
from shm.pipeline import utc_now
from shm.store import Workspace
from shm.store.journal import list_changes
from shm.store.rows import Role
from shm.store.tables import users
from shm_daemon.web.access import engineering, reading, signed_in_person, writing
from shm_daemon.web.address import Address
from shm_daemon.web.app import make_pages
from shm_daemon.web.site import MOST_WRONG, Description, Site
from tests.helpers.waiting import until
from tests.helpers.web_servers import served

PASSWORD = "correct horse battery"
OPEN = {"/health", "/sign-in", "/sign-in/provider", "/sign-in/back", "/sign-out"}
UPLOAD = "/api/recordings?name=x.csv"


@pytest.fixture
def browser(workspace: Workspace) -> Iterator[httpx.Client]:
    add_a_user_of_each_role(workspace)
    with served(workspace, Address("0.0.0.0")) as site, site.client(Origin=site.url) as client:
        yield client


def add_a_user_of_each_role(workspace: Workspace) -> None:
    """Each named as the role, with the one password."""
    with workspace.store() as store:
        for role in Role:
            store.people.add(role, role, PASSWORD, utc_now())


def sign_in(client: httpx.Client, name: str, password: str = PASSWORD) -> int:
    return client.post("/sign-in", data={"name": name, "password": password}).status_code


@pytest.mark.parametrize(
    ("role", "upload"), [("reader", 403), ("operator", 202), ("engineer", 202)]
)
def test_a_role_opens_what_it_may_until_the_person_signs_out(
    browser: httpx.Client, role: str, upload: int
) -> None:
    assert sign_in(browser, role) == 303
    kept = dict(browser.cookies)
    assert browser.get("/api/status").status_code == 200
    assert browser.post(UPLOAD, content=b"x").status_code == upload
    browser.post("/sign-out")
    browser.cookies.update(kept)
    assert browser.get("/api/status").status_code == 401


def test_a_removed_user_is_out_at_once_and_wrong_passwords_are_throttled(
    browser: httpx.Client, workspace: Workspace
) -> None:
    sign_in(browser, "operator")
    with workspace.store() as store:
        store.people.remove("operator", utc_now())
    assert browser.get("/api/status").status_code == 401
    told = [sign_in(browser, "reader", "wrong") for _ in range(MOST_WRONG)]
    assert set(told) == {401}
    assert sign_in(browser, "reader") == 429


def test_wrong_passwords_keep_out_neither_who_is_in_nor_others_of_the_same_address(
    browser: httpx.Client,
) -> None:
    sign_in(browser, "operator")
    for _ in range(MOST_WRONG + 4):
        sign_in(browser, "reader", "wrong")
    assert browser.get("/api/status").status_code == 200
    browser.cookies.clear()
    assert sign_in(browser, "engineer") == 303


def test_a_person_changes_the_own_password_and_ends_all_other_sessions(
    browser: httpx.Client, workspace: Workspace
) -> None:
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
    assert (row.who, row.via, row.action, row.subject) == (
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


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("an\u200bna", "invisible"),
        ("anna\u2060", "invisible"),
        ("an\tna", "invisible"),
        ("\u00a0 ", "short text"),
    ],
)
def test_a_name_that_can_pass_for_another_is_refused(
    workspace: Workspace, name: str, said: str
) -> None:
    with workspace.store() as store, pytest.raises(UsageError, match=said):
        store.people.add(name, Role.READER, PASSWORD, utc_now())


@pytest.mark.parametrize(
    "alike", ["jose\u0301  huber ", "JOS\u00c9 HUBER", "\uff2aos\u00e9\u00a0Huber"]
)
def test_a_name_is_taken_in_every_form_and_case_and_signs_in_so(
    workspace: Workspace, alike: str
) -> None:
    with workspace.store() as store:
        store.people.add(" Jose\u0301  Huber", Role.READER, PASSWORD, utc_now())
        assert [each.name for each in store.people.list_all()] == ["Jos\u00e9 Huber"]
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


def calls_of(dependant: Dependant) -> Iterator[object]:
    """Yield what a route depends on, and what that depends on."""
    for each in dependant.dependencies:
        yield each.call
        yield from calls_of(each)


def test_guesses_from_many_addresses_wait(workspace: Workspace) -> None:
    add_a_user_of_each_role(workspace)

    def attempt(number: int, name: str, password: str) -> int:
        forwarded = {"X-Forwarded-For": f"203.0.113.{number}"}
        told = {"name": name, "password": password}
        return client.post("/sign-in", data=told, headers=forwarded).status_code

    with served(workspace, Address("0.0.0.0")) as site, site.client(Origin=site.url) as client:
        told = [attempt(number // 5, "reader", "wrong") for number in range(100)]
        assert set(told) == {401}
        assert attempt(200, " READER ", PASSWORD) == 429
        assert attempt(201, "engineer", PASSWORD) == 303


def test_many_sign_ins_leave_pages_free(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_every_route_asks_who_it_is_and_what_changes_something_asks_for_an_operator(
    workspace: Workspace,
) -> None:
    pages = make_pages(Site(Description(workspace), Address()))
    routers = [getattr(each, "original_router", each) for each in pages.routes]
    found = [route for each in routers for route in getattr(each, "routes", [each])]
    routes = [each for each in found if isinstance(each, APIRoute)]
    assert len(routes) > 20
    for route in routes:
        if route.path in OPEN or route.path.startswith("/static"):
            continue
        asked = set(calls_of(route.dependant))
        needed = reading if route.methods <= {"GET", "HEAD"} else writing
        assert {needed, engineering, signed_in_person} & asked, route.path
