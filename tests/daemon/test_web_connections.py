"""Callers that connect and fall silent, or drip: they must not blind the interface."""

from __future__ import annotations

import socket
import ssl
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx
import pytest

from shm.pipeline import utc_now
from shm.store import Scope, Workspace
from shm_daemon.web import connections, middleware
from shm_daemon.web.address import UPLOADS
from tests.helpers.slow import few_of
from tests.helpers.web_servers import Served, served

MANY = 1000
ADDRESSES = {
    "one address": ["127.0.0.1"],
    "many addresses": [f"127.0.0.{number}" for number in range(2, 252)],
}
SILENT = b""
DRIPPING_HEADERS = b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Long: "
SLOW_BODY = b"POST /sign-in HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n\r\n"
SLOW_UPLOAD = (
    f"POST {UPLOADS}?name=x.csv HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n\r\n"
).encode()


@pytest.fixture
def site(workspace: Workspace) -> Iterator[Served]:
    with served(workspace) as site:
        yield site


@contextmanager
def callers(
    site: Served, number: int, addresses: list[str], said: bytes
) -> Iterator[list[socket.socket]]:
    """So many connections that say something and no more."""
    port = int(site.url.rpartition(":")[2])
    with ExitStack() as stack:
        sockets = []
        for index in range(number):
            one = stack.enter_context(socket.socket())
            one.settimeout(10)
            one.bind((addresses[index % len(addresses)], 0))
            one.connect(("127.0.0.1", port))
            if said:
                one.sendall(said)
            sockets.append(one)
        yield sockets


def is_open(one: socket.socket) -> bool:
    """Whether the other side still keeps the connection."""
    one.setblocking(False)
    try:
        return bool(one.recv(1, socket.MSG_PEEK))
    except BlockingIOError:
        return True
    except OSError:
        return False


@pytest.mark.parametrize("addresses", ADDRESSES.values(), ids=ADDRESSES)
@pytest.mark.parametrize("said", few_of([SILENT, DRIPPING_HEADERS, SLOW_BODY, SLOW_UPLOAD], 2))
def test_health_and_metrics_answer_while_a_thousand_sockets_are_idle(
    site: Served, addresses: list[str], said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "DEADLINE_S", 600.0)  # nobody is answered for being late
    with callers(site, MANY, addresses, said) as sockets:
        for path in ("/health", "/metrics", "/"):
            for _ in range(5):
                with site.client() as client:
                    answer = client.get(path)
                assert answer.status_code == (503 if path == "/health" else 200)  # no daemon
        kept = sum(map(is_open, sockets))
    most = connections.FROM_AN_ADDRESS if len(addresses) == 1 else connections.FROM_ALL
    assert kept <= (most if said != SLOW_UPLOAD else MANY)


@pytest.mark.parametrize("said", [SILENT, DRIPPING_HEADERS, SLOW_BODY])
def test_who_says_nothing_whole_is_cut_off_in_time(
    site: Served, monkeypatch: pytest.MonkeyPatch, said: bytes
) -> None:
    """However often a byte comes: it is the request that is waited for."""
    assert connections.DEADLINE_S <= 10
    monkeypatch.setattr(connections, "DEADLINE_S", 1.0)
    with callers(site, 1, ["127.0.0.1"], said) as (one,):
        began = time.monotonic()
        while is_open(one):
            assert time.monotonic() - began < 120, "it is still open"
            time.sleep(0.1)
            if said:
                try:
                    one.send(b"x")
                except OSError:
                    break
        assert time.monotonic() - began >= 0.9


def test_who_drips_after_an_answer_is_cut_off_too(
    site: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "DEADLINE_S", 1.0)
    asked = b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with callers(site, 1, ["127.0.0.1"], asked) as (one,):
        one.recv(65536)
        began = time.monotonic()
        while time.monotonic() - began < 120:
            try:
                one.send(b"G")
            except OSError:
                return
            time.sleep(0.1)
    pytest.fail("it is still open")


def test_an_upload_may_take_longer_than_the_deadline(
    site: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "DEADLINE_S", 0.5)

    def slowly() -> Iterator[bytes]:
        for _ in range(6):
            time.sleep(0.3)
            yield b"x"

    with site.client(site.write_token) as client:
        assert client.post(f"{UPLOADS}?name=slow.csv", content=slowly()).status_code == 202


def test_slow_uploads_leave_room_for_others(site: Served, workspace: Workspace) -> None:
    with workspace.store() as store:
        logger = store.upkeep.create_token("logger", Scope.WRITE, utc_now())
    authorized = SLOW_UPLOAD.replace(b"\r\n\r\n", b"\r\nAuthorization: Bearer %s\r\n\r\n")
    slow = authorized % site.write_token.encode()
    with callers(site, 40, ["127.0.0.1"], slow) as sockets:
        refused = []
        for one in sockets:
            one.settimeout(1)
            with suppress(TimeoutError):
                refused.append(one.recv(65536).split(b" ", 2)[1])
        with site.client(logger) as client:
            taken = client.post(f"{UPLOADS}?name=mine.csv", content=b"x")
        with site.client(site.write_token) as client:
            further = client.post(f"{UPLOADS}?name=more.csv", content=b"x")
    assert taken.status_code == 202
    assert further.status_code == 503
    assert "token write sends 4 files already" in further.json()["message"]
    assert "Retry-After" in further.headers
    assert refused == [b"503"] * 36


def test_uploads_may_follow_each_other(site: Served) -> None:
    with site.client(site.write_token) as client:
        for number in range(9):
            sent = client.post(f"{UPLOADS}?name={number}.csv", content=b"%d" % number)
            assert sent.status_code == 202


@pytest.mark.slow
def test_a_long_answer_may_be_taken_slowly_but_not_left(
    site: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A script of some megabytes over a bad line, and who asks for it and never reads on."""
    monkeypatch.setattr(connections, "DEADLINE_S", 0.5)
    asked = b"GET /static/plotly.js HTTP/1.1\r\nHost: localhost\r\n\r\n"
    port = int(site.url.rpartition(":")[2])
    for reads_on in (True, False):
        with socket.socket() as one:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
            one.settimeout(10)
            one.connect(("127.0.0.1", port))
            one.sendall(asked)
            taken = 0
            for _ in range(20):
                time.sleep(0.15)
                if reads_on:
                    taken += len(one.recv(100_000))
            if reads_on:
                assert taken > 500_000
                continue
            with suppress(ConnectionResetError):
                while piece := one.recv(1_000_000):
                    taken += len(piece)
            assert taken < 2_000_000, "what nobody took was kept for them"


def test_too_much_at_once_is_refused_in_our_words_and_health_still_answers(
    site: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(middleware, "PLACES", dict.fromkeys(middleware.Kind, 0))
    with site.client() as client:
        refused = client.get("/")
        assert refused.status_code == 503
        assert "Retry-After" in refused.headers
        assert "X-Frame-Options" in refused.headers
        assert client.get("/health").json()["status"] == "failing"  # no daemon, but an answer


def test_more_than_a_request_needs_is_not_read(site: Served) -> None:
    with site.client(site.write_token) as client:
        assert client.post("/sign-in", content=b"x" * 100_000).status_code == 413


def test_the_places_leave_threads_for_those_who_watch() -> None:
    """Anyio has 40 threads for whatever blocks; each request holds one at most.

    Passwords are hashed in a thread of their own.
    """
    places = dict(middleware.PLACES)
    del places[middleware.Kind.HASHING]
    assert sum(places.values()) < 40


@pytest.mark.slow
def test_a_silent_caller_of_https_is_counted_and_cut_off_before_tls_begins(
    workspace: Workspace, certificate: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    trusted = ssl.create_default_context(cafile=str(certificate[0]))
    monkeypatch.setattr(connections, "DEADLINE_S", 600.0)
    with (
        served(workspace, certificate=certificate) as site,
        callers(site, 200, ["127.0.0.1"], SILENT) as sockets,
    ):
        answer = httpx.get(f"{site.url}/health", verify=trusted, trust_env=False, timeout=120)
        assert answer.json()["status"] == "failing"
        assert "max-age" in answer.headers["Strict-Transport-Security"]
        assert sum(map(is_open, sockets)) <= connections.FROM_AN_ADDRESS
        monkeypatch.setattr(connections, "DEADLINE_S", 0.5)
        with callers(site, 1, ["127.0.0.1"], b"\x16") as (one,):
            time.sleep(2)
            assert not is_open(one)
