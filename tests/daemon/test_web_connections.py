"""Callers that connect and fall silent, or drip: they must not blind the interface."""

from __future__ import annotations

import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx
import pytest

from shm.pipeline import utc_now
from shm.store import Scope, Workspace
from shm_daemon.web import middleware
from shm_daemon.web.address import UPLOADS
from tests.helpers.web_servers import Served, served

MANY = 1000
CADDYFILE = Path(__file__).parents[2] / "config/container/Caddyfile"
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
def callers(url: str, number: int, said: bytes) -> Iterator[list[socket.socket]]:
    """So many connections that say something and no more."""
    port = int(url.rpartition(":")[2])
    with ExitStack() as stack:
        sockets = []
        for _ in range(number):
            one = stack.enter_context(socket.socket())
            one.settimeout(10)
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


@contextmanager
def caddy(upstream: str, folder: Path) -> Iterator[str]:
    """Serve the Caddy file that is shipped before an interface, without a certificate."""
    program = shutil.which("caddy")
    if program is None:
        pytest.skip("Caddy is not installed")
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"http://127.0.0.1:{free.getsockname()[1]}"
    text = CADDYFILE.read_text().replace("{\n\tservers", "{\n\tadmin off\n\tservers", 1)
    text = text.replace("read_header 10s", "read_header 1s")
    (folder / "Caddyfile").write_text(text)
    environment = {"SITE": url, "UPSTREAM": upstream.removeprefix("http://"), "HOME": str(folder)}
    words = [program, "run", "--config", str(folder / "Caddyfile"), "--adapter", "caddyfile"]
    with subprocess.Popen(words, env=environment, stderr=subprocess.DEVNULL) as process:
        try:
            for _ in range(200):
                with suppress(httpx.TransportError):
                    httpx.get(url, trust_env=False)
                    break
                time.sleep(0.1)
            yield url
        finally:
            process.terminate()


def ask_all(site: Served) -> list[int]:
    """Return the status of each page that must answer whatever others do."""
    with site.client(site.read_token) as client:
        return [client.get(path).status_code for path in ("/health", "/metrics", "/")]


@pytest.mark.parametrize("said", [SILENT, DRIPPING_HEADERS, SLOW_BODY, SLOW_UPLOAD])
def test_pages_answer_beside_a_thousand_slow_callers(site: Served, said: bytes) -> None:
    with callers(site.url, MANY, said):
        assert ask_all(site) == [503, 200, 200]  # of health: no daemon


@pytest.mark.parametrize("said", [SILENT, DRIPPING_HEADERS])
def test_the_proxy_cuts_slow_callers_off(workspace: Workspace, tmp_path: Path, said: bytes) -> None:
    with (
        served(workspace) as site,
        caddy(site.url, tmp_path) as url,
        callers(url, MANY, said) as sockets,
    ):
        behind = Served(url, site.read_token, site.write_token)
        assert ask_all(behind) == [503, 200, 200]
        deadline = time.monotonic() + 60
        while any(map(is_open, sockets[:20])):
            assert time.monotonic() < deadline, "they are still open"
            time.sleep(0.2)


def test_slow_uploads_leave_room_for_others(site: Served, workspace: Workspace) -> None:
    with workspace.store() as store:
        logger = store.upkeep.create_token("logger", Scope.WRITE, utc_now())
    authorized = SLOW_UPLOAD.replace(b"\r\n\r\n", b"\r\nAuthorization: Bearer %s\r\n\r\n")
    slow = authorized % site.write_token.encode()
    with callers(site.url, 40, slow) as sockets:
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


def test_too_much_at_once(site: Served, monkeypatch: pytest.MonkeyPatch) -> None:
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
