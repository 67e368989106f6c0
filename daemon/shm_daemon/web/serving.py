"""Begins the web interface: the checks before it listens, and the server's limits.

On its own, or beside the daemon: then in a process of its own, begun again where it dies.
"""

from __future__ import annotations

import atexit
import logging
import os
import resource
import signal
import ssl
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from shm.errors import BadInput, UsageError, needing
from shm.store import Workspace
from shm_daemon.web.address import Address

if TYPE_CHECKING:
    import uvicorn
    from starlette.types import ASGIApp

_HEADERS_BYTES = 16_384  # technical: h11's own default; ours with token and cookie are below 2,000
_OPEN_FILES = 8192  # technical: many times the connections that may wait
ENDING_S = 5
"""Technical: who is being answered at the end may take so long; a page takes less."""
# Technical: at once where it died by chance, each minute where it cannot live, to spare the log.
_FIRST_WAIT_S, _LONGEST_WAIT_S, _LIVED_WELL_S = 1.0, 60.0, 60.0

_ENDING_WITH_DAEMON_S = 2 * ENDING_S  # its callers have been cut off by then

log = logging.getLogger(__name__)


def serve(
    workspace: Workspace,
    address: Address,
    certificate: Path | None = None,
    key: Path | None = None,
    announce: Callable[[], object] = lambda: None,
) -> None:
    """Serve a workspace until SIGTERM or SIGINT; `announce` is called once nothing forbids it.

    Raises UsageError where others could reach it and nobody may sign in, and where the extra
    `[web]` is not installed; BadInput where the certificate cannot be used.
    """
    refuse_uninstalled()
    refuse_unguarded(workspace, address)
    refuse_bad_certificate(certificate, key)
    announce()
    if not address.is_loopback and certificate is None:
        log.warning("tokens and data go over the network in clear: give --certificate and --key")
    _allow_connections()
    app = make_app(workspace, address, warms_up=True)
    with ending_in_order():
        make_server(app, address, certificate, key).run()


def make_app(
    workspace: Workspace, address: Address | None = None, *, warms_up: bool = False
) -> ASGIApp:
    """Return the interface of one workspace that listens at `address` (default: local only).

    It answers `/health` at once and loads its pages in the background.
    """
    from shm_daemon.web.middleware import HeadersMiddleware, LimitMiddleware, Pages
    from shm_daemon.web.site import Description, Site

    def load() -> Pages:
        from shm_daemon.web.app import load_pages

        return load_pages(site)

    site = Site(Description(workspace), address or Address())
    return HeadersMiddleware(LimitMiddleware(site, load, warms_up=warms_up), site)


@contextmanager
def ending_in_order() -> Iterator[None]:
    """End the process of SIGTERM without uvicorn's signal.

    Once it has ended, uvicorn sends the signal that ended it; killed by that we could not
    release what our processes hold.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def leaving() -> Iterator[None]:
    """End the process with the context, without finalizing Python.

    A thread that still loads pages or writes the log would make that a fatal error. Exceptions
    but an exit pass through.
    """
    code = 0
    try:
        yield
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0
    logging.shutdown()
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(code)


def make_server(
    app: ASGIApp, address: Address, certificate: Path | None = None, key: Path | None = None
) -> uvicorn.Server:
    """Return a server that says little of itself and of callers."""
    import uvicorn

    config = uvicorn.Config(
        app,
        host=address.host,
        port=address.port,
        ssl_certfile=certificate,
        ssl_keyfile=key,
        http="h11",
        ws="none",
        loop="asyncio",
        log_config=None,
        access_log=False,  # ours tells less: no queries, in which people put secrets
        server_header=False,
        proxy_headers=False,
        h11_max_incomplete_event_size=_HEADERS_BYTES,
        timeout_graceful_shutdown=ENDING_S,
    )
    logging.getLogger("uvicorn.access").disabled = True
    return uvicorn.Server(config)


def refuse_bad_certificate(certificate: Path | None, key: Path | None) -> None:
    """Raise BadInput for a certificate that cannot be used, UsageError for a key without one."""
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


def refuse_uninstalled() -> None:
    """Raise UsageError where the extra `[web]` is not installed; loads nothing of it."""
    with needing("web"):
        for name in ("fastapi", "plotly", "prometheus_client", "uvicorn"):
            if find_spec(name) is None:
                raise ImportError(f"No module named {name!r}", name=name)


def _allow_connections() -> None:
    """Raise the limit of open files: a burst of callers is let in before it is sorted out."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _OPEN_FILES if most == resource.RLIM_INFINITY else min(most, _OPEN_FILES)
    if resource.getrlimit(resource.RLIMIT_NOFILE)[0] < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def refuse_unguarded(workspace: Workspace, address: Address) -> None:
    """Raise UsageError where others than this machine could come in and nobody may sign in."""
    if address.is_loopback:
        return
    with workspace.store() as store:
        in_force = [each.revoked_at is None for each in store.upkeep.list_tokens()]
        in_force += [each.removed_at is None for each in store.people.list_all()]
        if any(in_force):
            return
    raise UsageError(
        f"{address.host} can be reached by others, and nobody may sign in: there is no user and "
        "no token.",
        remedy="Add a user with `shm user add NAME`, make a token with `shm token create NAME`, or "
        "listen on 127.0.0.1.",
    )


@contextmanager
def web_with_daemon(
    workspace: Workspace,
    address: Address | None,
    log_file: Path | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
) -> Iterator[None]:
    """Serve the web interface while the context lasts; without an address, nothing.

    What befalls it does not touch the daemon; it ends with the daemon, however that ends. Where the
    daemon writes its log to a file, the interface has one beside it: two processes cannot put one
    file aside. Raises UsageError where it may not be begun at all, BadInput where the certificate
    cannot be used.
    """
    if address is None:
        yield
        return
    refuse_uninstalled()
    refuse_unguarded(workspace, address)
    refuse_bad_certificate(certificate, key)
    if log_file:  # daemon.web.log by daemon.log
        log_file = log_file.with_name(f"{log_file.stem}.web{log_file.suffix}")
    keeper = _Keeper(_command(workspace.folder, address, certificate, key, log_file))
    thread = threading.Thread(target=keeper.keep, name="web", daemon=True)
    thread.start()
    try:
        yield
    finally:
        keeper.stop()
        thread.join()  # it ends the process itself where that does not end in time


class _Keeper:
    def __init__(self, command: list[str]):
        self._command, self._stopped = command, threading.Event()

    def keep(self) -> None:
        """Restart the process whenever it ends, ever later if it ends early."""
        wait_s = _FIRST_WAIT_S
        while not self._stopped.is_set():
            lived_s = self._run()
            if self._stopped.is_set():
                return
            wait_s = _FIRST_WAIT_S if lived_s > _LIVED_WELL_S else min(2 * wait_s, _LONGEST_WAIT_S)
            log.warning("the web interface ended; it is begun again in %.0f s", wait_s)
            self._stopped.wait(wait_s)

    def stop(self) -> None:
        self._stopped.set()

    def _run(self) -> float:
        """Run the process until it ends or we are stopped; return the seconds it lived."""
        lived_s, look_s = 0.0, 0.2
        try:
            # It ends when its standard input does, so that it outlives no killed daemon.
            process = subprocess.Popen(self._command, stdin=subprocess.PIPE)  # noqa: S603
        except OSError as error:
            log.error("the web interface cannot be begun: %s", error)
            return 0.0
        with process:
            while process.poll() is None and not self._stopped.wait(look_s):
                lived_s += look_s
            process.terminate()
            try:
                process.wait(_ENDING_WITH_DAEMON_S)
            except subprocess.TimeoutExpired:
                process.kill()
        return lived_s


def _command(
    workspace: Path,
    address: Address,
    certificate: Path | None,
    key: Path | None,
    log_file: Path | None,
) -> list[str]:
    """Return the words that begin it in a process of its own."""
    options = {"--certificate": certificate, "--key": key, "--log-file": log_file}
    given = [str(word) for option in options.items() if option[1] is not None for word in option]
    place = [str(workspace), address.host, str(address.port)]
    return [sys.executable, "-m", "shm_daemon.web", *place, *given]
