"""The web interface behind a real server on a free port of this machine."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from shm.pipeline import utc_now
from shm.store import Scope, Workspace
from shm_daemon.web.address import Address
from shm_daemon.web.serving import make_app, make_server


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
