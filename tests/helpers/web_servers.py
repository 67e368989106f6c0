"""The web interface behind a real server on a free port of this machine."""

from __future__ import annotations

import html
import re
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import httpx
import pytest

from shm.pipeline import utc_now
from shm.store import Scope, Workspace
from shm.store.rows import Role
from shm_daemon.web.address import Address
from shm_daemon.web.background_work import BackgroundWorker
from shm_daemon.web.serving import make_app, make_server

PASSWORD = "correct horse battery"
UPLOAD = "/api/recordings?name=x.csv"
ELSEWHERE = Address("0.0.0.0")
HTML = {"Accept": "text/html"}


@dataclass(frozen=True)
class Served:
    """A running interface, and tokens that it takes."""

    url: str
    read_token: str
    write_token: str

    def client(self, token: str = "", **headers: str) -> httpx.Client:
        """A caller with that token, or with none."""
        if token:
            headers["Authorization"] = f"Bearer {token}"
        verify = self.url.startswith("https")  # whom the machine trusts takes 29 ms to load
        return httpx.Client(
            base_url=self.url, headers=headers, timeout=120, trust_env=False, verify=verify
        )


@contextmanager
def served(
    workspace: Workspace,
    address: Address | None = None,
    certificate: tuple[Path, Path] | None = None,
) -> Iterator[Served]:
    """Serves until the end of the block, on this machine only, as if it listened at `address`;
    over HTTPS with a certificate and its key.
    """
    with workspace.store() as store:
        tokens = [store.upkeep.create_token(scope, scope, utc_now()) for scope in Scope]
    server = make_server(make_app(workspace, address), Address(port=0))
    if certificate:  # as a proxy before it would
        server.config.ssl_certfile, server.config.ssl_keyfile = map(str, certificate)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        url = f"http{'s' if certificate else ''}://127.0.0.1:{listening.getsockname()[1]}"
        thread = threading.Thread(target=server.run, args=([listening],))
        thread.start()
        try:
            yield Served(url, *tokens)
        finally:
            server.should_exit = True
            thread.join()


def a_thread(workers: int) -> ProcessPoolExecutor:
    """Where a background_worker works without a process of its own."""
    return ThreadPoolExecutor(workers)  # type: ignore[return-value]


@contextmanager
def in_a_thread() -> Iterator[None]:
    """Work out in a thread what takes long: its processes are tested by themselves."""
    worker = partial(BackgroundWorker, pool=a_thread)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shm_daemon.web.app.BackgroundWorker", worker)
        yield


def at_last(client: httpx.Client, address: str) -> httpx.Response:
    """Return the answer once nothing more is worked out."""
    for _ in range(600):
        answer = client.get(address)
        if answer.status_code != 202 and "Retry-After" not in answer.headers:
            return answer
        time.sleep(0.1)
    raise AssertionError(f"{address} never came")


def outcome(client: httpx.Client, ordered: httpx.Response) -> httpx.Response:
    """Return the outcome of an order that its page follows, once it was made."""
    assert ordered.status_code == 303
    page = ordered.headers["location"]
    address = page.replace("?", "/outcome?")
    assert f'data-fragment="{address}"' in client.get(page).text
    return at_last(client, address)


def add_a_user_of_each_role(workspace: Workspace) -> None:
    """Add users that are named as their roles, with the one password."""
    with workspace.store() as store:
        for role in Role:
            store.people.add(role, role, PASSWORD, utc_now())


def sign_in(client: httpx.Client, name: str, password: str = PASSWORD) -> int:
    return client.post("/sign-in", data={"name": name, "password": password}).status_code


def words_of(page: str) -> str:
    """Return the visible text of a page on one line."""
    return " ".join(html.unescape(re.sub(r"<(?:.|\n)*?>", " ", page)).split())
