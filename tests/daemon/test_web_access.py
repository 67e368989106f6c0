"""Who may do what over HTTP, and what an answer and the log give away."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import httpx
import pytest

from shm.errors import NothingThere, UsageError
from shm.pipeline import utc_now
from shm.store import Scope, Workspace
from shm_daemon.web.address import Address, caller_of
from shm_daemon.web.middleware import HTTPS_ONLY, PROTECTION
from shm_daemon.web.serving import refuse_unguarded
from shm_daemon.web.site import MOST_WRONG, WITHIN_S, WrongAttempts
from tests.helpers.web_servers import Served, served

READING = (
    "/api/status", "/api/hangers", "/api/hangers/3", "/api/alerts", "/metrics", "/openapi.json",
)  # fmt: skip
UPLOAD = "/api/recordings?name=x.csv"
ELSEWHERE = Address("0.0.0.0")


@pytest.fixture
def at_home(workspace: Workspace) -> Iterator[Served]:
    with served(workspace) as site:
        yield site


@pytest.fixture
def elsewhere(workspace: Workspace) -> Iterator[Served]:
    with served(workspace, ELSEWHERE) as site:
        yield site


def statuses(client: httpx.Client) -> set[int]:
    return {client.get(path).status_code for path in READING}


def test_this_machine_reads_without_a_token_but_never_writes(at_home: Served) -> None:
    with at_home.client() as client:
        assert statuses(client) == {200}
        refused = client.post(UPLOAD, content=b"x")
        assert refused.status_code == 401
        assert refused.headers["WWW-Authenticate"] == "Bearer"
        acknowledgement = client.post("/api/alerts/1/acknowledgement", json={"why": "seen"})
        assert acknowledgement.status_code == 401


def test_what_a_proxy_passes_on_needs_a_token(at_home: Served) -> None:
    with at_home.client(**{"X-Forwarded-For": "203.0.113.9"}) as client:
        assert statuses(client) == {401}


def test_from_elsewhere_all_but_health_needs_a_token(elsewhere: Served) -> None:
    with elsewhere.client() as client:
        assert statuses(client) == {401}
        assert client.get("/health").status_code == 503  # no daemon, but an answer
    with elsewhere.client(elsewhere.read_token) as client:
        assert statuses(client) == {200}


def test_a_token_that_may_read_may_not_write(at_home: Served) -> None:
    with at_home.client(at_home.read_token) as client:
        refused = client.post(UPLOAD, content=b"x")
    assert refused.status_code == 403
    assert "shm token create" in refused.json()["remedy"]


def test_a_revoked_token_is_refused_at_once(elsewhere: Served, workspace: Workspace) -> None:
    with elsewhere.client(elsewhere.write_token) as client:
        assert client.post(UPLOAD, content=b"x").status_code == 202
        with workspace.store() as store:
            store.upkeep.revoke_token("write", utc_now())
        assert client.post(UPLOAD, content=b"x").status_code == 401
        assert statuses(client) == {401}


def test_a_name_that_is_not_ours_is_refused(at_home: Served) -> None:
    for host in (
        "evil.example",
        "evil.example:8400",
        "127.0.0.1.evil.example",
        "",
        "localhost:8400@evil.example",
        "localhost@evil.example",
        "[::1]evil.example",
        "localhost:8400/evil.example",
    ):
        with at_home.client(at_home.read_token, Host=host) as client:
            assert client.get("/api/status").status_code == 400


def test_names_of_ours_are_answered_to() -> None:
    home = Address()
    assert all(home.answers_to(host, ()) for host in ("localhost:1", "127.0.0.1", "[::1]:8400"))
    assert not home.answers_to("192.0.2.7", ())
    assert ELSEWHERE.answers_to("192.0.2.7:8400", ())
    assert ELSEWHERE.answers_to("Bridge.example:8400", ("bridge.example",))
    assert not ELSEWHERE.answers_to("evil.example", ("bridge.example",))


def test_every_answer_carries_the_protecting_headers(at_home: Served) -> None:
    with at_home.client() as client:
        for path in ("/api/status", "/no/such/page", "/health", "/metrics", "/openapi.json"):
            headers = client.get(path).headers
            assert {name: headers[name] for name in PROTECTION} == PROTECTION
            assert "server" not in headers


def test_who_came_by_https_is_told_to_come_by_nothing_else(at_home: Served) -> None:
    """Also where a proxy took HTTPS off; a page that fails is protected as any other."""
    with at_home.client(at_home.read_token) as client:
        assert "Strict-Transport-Security" not in client.get("/").headers
        for path in ("/", "/health", "/metrics", "/no/such/page", "/openapi.json"):
            headers = client.get(path, headers={"X-Forwarded-Proto": "https"}).headers
            assert headers["Strict-Transport-Security"] == HTTPS_ONLY["Strict-Transport-Security"]
            assert {name: headers[name] for name in PROTECTION} == PROTECTION


def test_an_error_of_ours_is_protected_as_well(
    at_home: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("a fault of ours")

    monkeypatch.setattr("shm_daemon.web.hangers.quarantined", broken)
    with at_home.client() as client:
        answer = client.get("/api/status")
    assert answer.status_code == 500
    assert {name: answer.headers[name] for name in PROTECTION} == PROTECTION


def test_wrong_tokens_are_throttled_and_logged_by_address_without_the_token(
    elsewhere: Served, caplog: pytest.LogCaptureFixture
) -> None:
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


def test_behind_a_proxy_the_callers_are_told_apart(
    elsewhere: Served, caplog: pytest.LogCaptureFixture
) -> None:
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


def test_whom_a_stranger_names_is_not_believed() -> None:
    proxies = "127.0.0.1, 192.0.2.1"
    assert caller_of("203.0.113.5", "198.51.100.7", proxies) == "203.0.113.5"
    assert caller_of("127.0.0.1", "", proxies) == "127.0.0.1"
    assert caller_of("127.0.0.1", "198.51.100.7, 192.0.2.1", proxies) == "198.51.100.7"
    assert caller_of("127.0.0.1", "no address\n", proxies) == "127.0.0.1"


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


def test_only_the_checksum_of_a_token_is_kept(workspace: Workspace) -> None:
    with workspace.store() as store:
        secret = store.upkeep.create_token("logger", Scope.READ, utc_now())
    with sqlite3.connect(workspace.database) as connection:
        kept = connection.execute("SELECT * FROM tokens").fetchone()
    assert len(secret) > 40
    assert secret not in map(str, kept)


def test_a_name_is_free_again_after_its_token_was_revoked(workspace: Workspace) -> None:
    now = utc_now()
    with workspace.store() as store:
        first = store.upkeep.create_token("logger", Scope.READ, now)
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
        assert [token.last_used_at for token in store.upkeep.list_tokens()] == [None, now]


def test_without_a_token_it_does_not_open_to_others(workspace: Workspace) -> None:
    refuse_unguarded(workspace, Address())
    with pytest.raises(UsageError, match="nobody may sign in") as refused:
        refuse_unguarded(workspace, ELSEWHERE)
    assert "shm token create" in refused.value.remedy
    with workspace.store() as store:
        store.upkeep.create_token("logger", Scope.READ, utc_now())
    refuse_unguarded(workspace, ELSEWHERE)


def test_every_route_but_health_asks_for_a_token(elsewhere: Served) -> None:
    with elsewhere.client(elsewhere.read_token) as client:
        paths = client.get("/openapi.json").json()["paths"]
    guarded = {
        path for path, verbs in paths.items() if all("security" in verb for verb in verbs.values())
    }
    assert set(paths) - guarded == {"/health"}


def test_a_workspace_folder_is_not_told(at_home: Served, workspace: Workspace) -> None:
    Path(workspace.database).rename(workspace.folder / "gone.db")
    with at_home.client() as client:
        health = client.get("/health")
    assert health.status_code == 503
    assert "The store cannot be used." in health.json()["reasons"]
    assert str(workspace.folder) not in health.text
