"""Who may do what over HTTP: tokens, the cookie, roles, and what answers and logs give away."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import httpx
import pytest
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute

from shm.errors import NothingThere, UsageError
from shm.pipeline import utc_now
from shm.store import Scope, Workspace
from shm_daemon.web.access import COOKIE, engineering, reading, signed_in_person, writing
from shm_daemon.web.address import Address, caller_of
from shm_daemon.web.app import make_pages
from shm_daemon.web.middleware import HTTPS_ONLY, PROTECTION
from shm_daemon.web.serving import refuse_unguarded
from shm_daemon.web.site import MOST_WRONG, WITHIN_S, Description, Site, WrongAttempts
from tests.helpers.web_servers import ELSEWHERE, HTML, UPLOAD, Served, served

READING = (
    "/api/status", "/api/hangers", "/api/hangers/3", "/api/alerts", "/metrics", "/openapi.json",
)  # fmt: skip
OPEN = {"/health", "/sign-in", "/sign-in/provider", "/sign-in/back", "/sign-out"}


def statuses(client: httpx.Client) -> set[int]:
    return {client.get(path).status_code for path in READING}


def is_protected(answer: httpx.Response) -> bool:
    return {name: answer.headers[name] for name in PROTECTION} == PROTECTION


# ------------------------------------------------------------ tokens


def test_this_machine_reads_without_a_token_but_never_writes(at_home: Served) -> None:
    with at_home.client() as client:
        assert statuses(client) == {200}
        refused = client.post(UPLOAD, content=b"x")
        assert (refused.status_code, refused.headers["WWW-Authenticate"]) == (401, "Bearer")
        acknowledgement = client.post("/api/alerts/1/acknowledgement", json={"why": "seen"})
        assert acknowledgement.status_code == 401
    with at_home.client(**{"X-Forwarded-For": "203.0.113.9"}) as client:
        assert statuses(client) == {401}, "what a proxy passes on needs a token"
    with at_home.client(at_home.read_token) as client:
        refused = client.post(UPLOAD, content=b"x")
    assert refused.status_code == 403
    assert "shm token create" in refused.json()["remedy"]


def test_elsewhere_needs_a_token(elsewhere: Served, workspace: Workspace) -> None:
    """A revoked one is refused at once."""
    with elsewhere.client() as client:
        assert statuses(client) == {401}
        assert client.get("/health").status_code == 503  # no daemon, but an answer
    with elsewhere.client(elsewhere.read_token) as client:
        assert statuses(client) == {200}
        paths = client.get("/openapi.json").json()["paths"]
    guarded = {
        path for path, verbs in paths.items() if all("security" in verb for verb in verbs.values())
    }
    assert set(paths) - guarded == {"/health"}
    with elsewhere.client(elsewhere.write_token) as client:
        assert client.post(UPLOAD, content=b"x").status_code == 202
        with workspace.store() as store:
            store.upkeep.revoke_token("write", utc_now())
        assert client.post(UPLOAD, content=b"x").status_code == 401
        assert statuses(client) == {401}


def test_only_names_of_ours_are_answered_to(at_home: Served) -> None:
    for host in (
        "evil.example", "evil.example:8400", "127.0.0.1.evil.example", "",
        "localhost:8400@evil.example", "localhost@evil.example", "[::1]evil.example",
        "localhost:8400/evil.example",
    ):  # fmt: skip
        with at_home.client(at_home.read_token, Host=host) as client:
            assert client.get("/api/status").status_code == 400
    home = Address()
    assert all(home.answers_to(host, ()) for host in ("localhost:1", "127.0.0.1", "[::1]:8400"))
    assert not home.answers_to("192.0.2.7", ())
    assert ELSEWHERE.answers_to("192.0.2.7:8400", ())
    assert ELSEWHERE.answers_to("Bridge.example:8400", ("bridge.example",))
    assert not ELSEWHERE.answers_to("evil.example", ("bridge.example",))


def test_answers_carry_protecting_headers(at_home: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who came by HTTPS is told to come by nothing else, also where a proxy took it off."""
    paths = ("/", "/api/status", "/no/such/page", "/health", "/metrics", "/openapi.json")
    with at_home.client(at_home.read_token) as client:
        for path in paths:
            plain = client.get(path)
            assert is_protected(plain)
            assert not {"server", "Strict-Transport-Security"} & set(plain.headers)
            secure = client.get(path, headers={"X-Forwarded-Proto": "https"})
            assert is_protected(secure)
            assert {name: secure.headers[name] for name in HTTPS_ONLY} == HTTPS_ONLY

        def broken(*_: object) -> None:
            raise RuntimeError("a fault of ours")

        monkeypatch.setattr("shm_daemon.web.hangers.quarantined", broken)
        failed = client.get("/api/status")
    assert failed.status_code == 500
    assert is_protected(failed)


def test_wrong_tokens_are_throttled(elsewhere: Served, caplog: pytest.LogCaptureFixture) -> None:
    with elsewhere.client("shm_guess") as client:
        told = [client.get("/api/status").status_code for _ in range(MOST_WRONG + 3)]
        refused = client.get("/api/status")
    assert told == [401] * MOST_WRONG + [429] * 3
    assert 0 < int(refused.headers["Retry-After"]) <= WITHIN_S
    with elsewhere.client(elsewhere.read_token) as client:
        assert client.get("/api/status").status_code == 200  # a neighbour
    said = [each.getMessage() for each in caplog.records if not each.name.startswith("http")]
    named = [line for line in said if "127.0.0.1" in line]
    assert len([line for line in named if "wrong or revoked" in line]) == MOST_WRONG
    assert any("has to wait" in line for line in named)
    assert "shm_guess" not in caplog.text


def test_callers_behind_a_proxy(elsewhere: Served, caplog: pytest.LogCaptureFixture) -> None:
    """The proxy adds whom it was called by at the end; what stands before is anybody's word."""
    for number in range(MOST_WRONG + 1):
        forwarded = f"198.51.100.{number}, 203.0.113.9"
        with elsewhere.client("shm_guess", **{"X-Forwarded-For": forwarded}) as client:
            answer = client.get("/api/status")
    assert answer.status_code == 429
    with elsewhere.client("shm_guess", **{"X-Forwarded-For": "203.0.113.10"}) as client:
        assert client.get("/api/status").status_code == 401
    assert "203.0.113.9" in caplog.text
    assert "198.51.100" not in caplog.text
    proxies = "127.0.0.1, 192.0.2.1"
    for peer, forwarded, caller in (
        ("203.0.113.5", "198.51.100.7", "203.0.113.5"),
        ("127.0.0.1", "", "127.0.0.1"),
        ("127.0.0.1", "198.51.100.7, 192.0.2.1", "198.51.100.7"),
        ("127.0.0.1", "no address\n", "127.0.0.1"),
    ):
        assert caller_of(peer, forwarded, proxies) == caller


def test_wrong_passwords_make_wait_by_user_and_far_more_by_address() -> None:
    wrong = WrongAttempts(lambda: 0.0)
    for _ in range(MOST_WRONG):
        wrong.note_wrong("127.0.0.1", "Anna")
    assert wrong.wait_s("127.0.0.1", " anna") == WITHIN_S
    assert wrong.wait_s("127.0.0.1", "Eva") == wrong.wait_s("203.0.113.5", "Anna") == 0
    for number in range(9 * MOST_WRONG):
        wrong.note_wrong("127.0.0.1", f"nobody {number}")
    assert wrong.wait_s("127.0.0.1", "Eva") == WITHIN_S


def test_no_secret_reaches_the_log_or_the_disk(
    elsewhere: Served, workspace: Workspace, caplog: pytest.LogCaptureFixture
) -> None:
    """Of a token its checksum alone is kept; its name is free again after it was revoked."""
    caplog.set_level(logging.DEBUG)
    secret = elsewhere.write_token
    with elsewhere.client(secret) as client:
        client.post(UPLOAD, content=b"x")
        client.get(f"/api/status?token={secret}")
        client.get("/api/status", headers={"Authorization": f"Bearer {secret}x"})
    ours = [record.getMessage() for record in caplog.records if "http" not in record.name]
    assert any("/api/status" in line for line in ours)
    assert not [line for line in ours if secret in line]
    for path in workspace.folder.rglob("*"):
        assert not path.is_file() or secret.encode() not in path.read_bytes()
    now = utc_now()
    with workspace.store() as store:
        first = store.upkeep.create_token("logger", Scope.READ, now)
        with sqlite3.connect(workspace.database) as connection:
            kept = connection.execute("SELECT * FROM tokens WHERE name = 'logger'").fetchone()
        connection.close()
        assert len(first) > 40
        assert first not in map(str, kept)
        with pytest.raises(UsageError, match="in force already"):
            store.upkeep.create_token("logger", Scope.WRITE, now)
        store.upkeep.revoke_token("logger", now)
        with pytest.raises(NothingThere):
            store.upkeep.revoke_token("logger", now)
        second = store.upkeep.create_token("logger", Scope.WRITE, now)
        assert store.upkeep.token_of(first, now) is None
        found = store.upkeep.token_of(second, now)
        assert found is not None
        assert found.scopes == {Scope.READ, Scope.WRITE}
        store.upkeep.token_of(second, now + timedelta(seconds=30))
        used = [each.last_used_at for each in store.upkeep.list_tokens() if each.name == "logger"]
        assert used == [None, now]


def test_it_does_not_open_to_others_without_a_token(workspace: Workspace) -> None:
    refuse_unguarded(workspace, Address())
    with pytest.raises(UsageError, match="nobody may sign in") as refused:
        refuse_unguarded(workspace, ELSEWHERE)
    assert "shm token create" in refused.value.remedy
    with workspace.store() as store:
        store.upkeep.create_token("logger", Scope.READ, utc_now())
    refuse_unguarded(workspace, ELSEWHERE)


def test_a_workspace_folder_is_not_told(at_home: Served, workspace: Workspace) -> None:
    Path(workspace.database).rename(workspace.folder / "gone.db")
    with at_home.client() as client:
        health = client.get("/health")
    assert health.status_code == 503
    assert "The store cannot be used." in health.json()["reasons"]
    assert str(workspace.folder) not in health.text


def calls_of(dependant: Dependant) -> Iterator[object]:
    """Yield what a route depends on, and what that depends on."""
    for each in dependant.dependencies:
        yield each.call
        yield from calls_of(each)


def test_every_route_asks_for_its_role(workspace: Workspace) -> None:
    pages = make_pages(Site(Description(workspace), Address()))
    routers = [getattr(each, "original_router", each) for each in pages.routes]
    found = [route for each in routers for route in getattr(each, "routes", [each])]
    routes = [each for each in found if isinstance(each, APIRoute)]
    assert len(routes) > 20
    for route in routes:
        if route.path not in OPEN and not route.path.startswith("/static"):
            needed = reading if route.methods <= {"GET", "HEAD"} else writing
            asked = set(calls_of(route.dependant))
            assert {needed, engineering, signed_in_person} & asked, route.path


# ------------------------------------------------------------ signing in with a token


@pytest.fixture
def browser(elsewhere: Served) -> Iterator[httpx.Client]:
    """As a browser has it: it names the origin of what it sends."""
    with elsewhere.client(**HTML, Origin=elsewhere.url) as client:
        yield client


def sign_in(client: httpx.Client, token: str, wanted: str = "/", **headers: str) -> httpx.Response:
    return client.post("/sign-in", data={"token": token, "next": wanted}, headers=headers)


def test_token_opens_pages(browser: httpx.Client, elsewhere: Served) -> None:
    refused = browser.get("/alerts")
    assert refused.status_code == 401
    assert 'name="next" value="/alerts"' in refused.text
    entered = sign_in(browser, elsewhere.read_token, "/alerts")
    assert (entered.status_code, entered.headers["Location"]) == (303, "/alerts")
    assert browser.get("/alerts").status_code == 200
    assert browser.get("/api/status").status_code == 200
    wrong = {"Authorization": "Bearer shm_wrong"}  # a header goes before the cookie
    assert browser.get("/api/status", headers=wrong).status_code == 401
    assert browser.post("/sign-out").status_code == 303
    assert COOKIE not in browser.cookies
    assert browser.get("/").status_code == 401


def test_cookie_lasts_a_month(browser: httpx.Client, elsewhere: Served) -> None:
    """Over HTTPS it never travels in clear."""

    def attributes(answer: httpx.Response) -> set[str]:
        found = answer.headers["Set-Cookie"].split("; ")[1:]
        return {each.lower() for each in found if not each.lower().startswith("expires=")}

    kept = {"httponly", "path=/", "samesite=strict"}
    assert attributes(sign_in(browser, elsewhere.read_token)) == kept | {"max-age=2592000"}
    assert attributes(browser.post("/sign-out")) == kept | {"max-age=0"}
    entered = sign_in(browser, elsewhere.read_token, **{"X-Forwarded-Proto": "https"})
    assert "; Secure" in entered.headers["Set-Cookie"]


def test_a_wrong_token_is_said_on_the_page(browser: httpx.Client) -> None:
    for token in ("shm_wrong", "", "é", "x" * 4000):
        refused = sign_in(browser, token)
        assert refused.status_code == 401
        assert "wrong or revoked" in refused.text
        assert "Set-Cookie" not in refused.headers
    assert sign_in(browser, "x" * 10_000).status_code == 413


@pytest.mark.parametrize("origin", ["https://evil.example", "http://127.0.0.1:1", "null", ""])
def test_page_of_another_site(browser: httpx.Client, elsewhere: Served, origin: str) -> None:
    sign_in(browser, elsewhere.write_token)
    foreign = {"Origin": origin}
    assert browser.post(UPLOAD, content=b"x", headers=foreign).status_code == 403
    assert browser.post("/sign-out", headers=foreign).status_code == 403
    assert sign_in(browser, elsewhere.read_token, **foreign).status_code == 403
    told = {"why": "seen"}
    posted = browser.post("/api/alerts/1/acknowledgement", json=told, headers=foreign)
    assert posted.status_code == 403


def test_sign_in_leads_to_no_stranger(browser: httpx.Client, elsewhere: Served) -> None:
    for wanted in (
        "https://evil.example", "//evil.example", "/\\evil.example", "evil", "/\r\nX: y",
    ):  # fmt: skip
        assert sign_in(browser, elsewhere.read_token, wanted).headers["Location"] == "/"


def test_a_cookie_out_of_date_takes_nothing_from_this_machine(workspace: Workspace) -> None:
    with served(workspace) as site, site.client(**HTML) as client:
        client.cookies.set(COOKIE, "shm_old")
        page = client.get("/")
    assert page.status_code == 200
    assert 'href="/sign-in"' in page.text
