"""Begins the web interface: the checks before it listens, and the server's limits."""

from __future__ import annotations

import logging
import signal
import ssl
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shm.errors import BadInput, UsageError
from shm.store import Workspace
from shm_daemon.extras import needing
from shm_daemon.web.address import Address

if TYPE_CHECKING:
    import uvicorn
    from fastapi import FastAPI

_HEADERS_BYTES = 16_384
_REQUESTS_AT_ONCE = 64
_ENDING_S = 5

log = logging.getLogger(__name__)


def serve(
    workspace: Workspace,
    address: Address,
    certificate: Path | None = None,
    key: Path | None = None,
    announce: Callable[[], object] = lambda: None,
) -> None:
    """Serves a workspace until SIGTERM or SIGINT; `announce` is called once nothing forbids it.

    Raises UsageError where others could reach it and no token is in force, and where the extra
    `[web]` is not installed; BadInput where the certificate cannot be used.
    """
    with needing("web"):
        from shm_daemon.web.app import make_app
        from shm_daemon.web.warming import warm_up
    refuse_unguarded(workspace, address)
    refuse_useless(certificate, key)
    announce()
    if not address.is_loopback and certificate is None:
        log.warning("tokens and data go over the network in clear: give --certificate and --key")
    app = make_app(workspace, address)
    threading.Thread(target=warm_up, args=(app,), name="warm-up", daemon=True).start()
    with ending_in_order():
        make_server(app, address, certificate, key).run()


@contextmanager
def ending_in_order() -> Iterator[None]:
    """Ends the process of SIGTERM as of itself: once it has ended, uvicorn sends us the signal that
    ended it, and killed by that we would give nothing back that our processes hold.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def make_server(
    app: FastAPI, address: Address, certificate: Path | None = None, key: Path | None = None
) -> uvicorn.Server:
    """A server that limits what a caller may take, and tells little of itself and of callers."""
    import uvicorn

    config = uvicorn.Config(
        app,
        host=address.host,
        port=address.port,
        ssl_certfile=certificate,
        ssl_keyfile=key,
        log_config=None,
        access_log=False,  # ours tells less: no queries, in which people put secrets
        server_header=False,
        proxy_headers=False,
        h11_max_incomplete_event_size=_HEADERS_BYTES,
        limit_concurrency=_REQUESTS_AT_ONCE,
        timeout_graceful_shutdown=_ENDING_S,
    )
    logging.getLogger("uvicorn.access").disabled = True
    return uvicorn.Server(config)


def refuse_useless(certificate: Path | None, key: Path | None) -> None:
    """Raises BadInput where a certificate cannot be used, UsageError for a key without one."""
    if certificate is None:
        if key is not None:
            raise UsageError("--key is of no use alone.", remedy="Give its --certificate as well.")
        return
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key)
    except OSError as error:  # of which ssl.SSLError is a kind
        raise BadInput(
            "it holds no certificate with a key that fits.",
            file=certificate,
            remedy="Give both as PEM files, with --certificate and --key.",
        ) from error


def refuse_unguarded(workspace: Workspace, address: Address) -> None:
    """Raises UsageError where others than this machine could come in and no token is in force."""
    if address.is_loopback:
        return
    with workspace.store() as store:
        if any(token.revoked_at is None for token in store.tokens()):
            return
    raise UsageError(
        f"{address.host} can be reached by others, and no token is in force.",
        remedy="Make one with `shm token create NAME`, or listen on 127.0.0.1.",
    )
