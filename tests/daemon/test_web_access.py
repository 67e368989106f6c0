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
from shm_daemon.web.address import Address
from shm_daemon.web.around import PROTECTION
from shm_daemon.web.serving import refuse_unguarded
from tests.helpers.web_servers import Served, served

READING = ("/api/status", "/api/hangers", "/api/hangers/3", "/api/alerts", "/metrics")
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
            store.revoke_token("write", utc_now())
        assert client.post(UPLOAD, content=b"x").status_code == 401
        assert statuses(client) == {401}


def test_a_wrong_token_is_refused_even_where_none_would_do(at_home: Served) -> None:
    with at_home.client() as client:
        for token in ("shm_wrong", "x" * 4000, "é"):
            headers = {"Authorization": f"Bearer {token}".encode()}
            assert client.get("/api/status", headers=headers).status_code == 401


def test_a_name_that_is_not_ours_is_refused(at_home: Served) -> None:
    for host in ("evil.example", "evil.example:8400", "127.0.0.1.evil.example", ""):
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
        secret = store.create_token("logger", Scope.READ, utc_now())
    with sqlite3.connect(workspace.database) as connection:
        kept = connection.execute("SELECT * FROM tokens").fetchone()
    assert len(secret) > 40
    assert secret not in map(str, kept)


def test_a_name_is_free_again_after_its_token_was_revoked(workspace: Workspace) -> None:
    now = utc_now()
    with workspace.store() as store:
        first = store.create_token("logger", Scope.READ, now)
        with pytest.raises(UsageError, match="in force already"):
            store.create_token("logger", Scope.WRITE, now)
        store.revoke_token("logger", now)
        with pytest.raises(NothingThere):
            store.revoke_token("logger", now)
        second = store.create_token("logger", Scope.WRITE, now)
        assert store.token_of(first, now) is None
        found = store.token_of(second, now)
        assert found is not None
        assert found.scopes == {Scope.READ, Scope.WRITE}
        store.token_of(second, now + timedelta(seconds=30))
        assert [token.last_used_at for token in store.tokens()] == [None, now]


def test_without_a_token_it_does_not_open_to_others(workspace: Workspace) -> None:
    refuse_unguarded(workspace, Address())
    with pytest.raises(UsageError, match="no token is in force") as refused:
        refuse_unguarded(workspace, ELSEWHERE)
    assert "shm token create" in refused.value.remedy
    with workspace.store() as store:
        store.create_token("logger", Scope.READ, utc_now())
    refuse_unguarded(workspace, ELSEWHERE)


def test_every_route_but_health_asks_for_a_token(elsewhere: Served) -> None:
    with elsewhere.client() as client:
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
