"""Begins the web interface: the checks before it listens, and the server's limits.

On its own, or beside the daemon: then in a process of its own, begun again where it dies.
"""

from __future__ import annotations

import atexit
import logging
import os
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from shm.errors import UsageError, needing
from shm.store import Workspace
from shm_daemon.web.address import Address

if TYPE_CHECKING:
    import uvicorn
    from starlette.types import ASGIApp

_HEADERS_BYTES = 16_384  # technical: h11's own default; ours with token and cookie are below 2,000
_OPEN_FILES = 8192  # technical: many times the connections that may wait
ENDING_S = 5
"""Technical: who is being answered at the end may take so long; a page takes less."""
_AGAIN_S = 10.0  # technical: soon for people, and rare enough for the log where it cannot live

log = logging.getLogger(__name__)


def serve(
    workspace: Workspace, address: Address, announce: Callable[[], object] = lambda: None
) -> None:
    """Serve a workspace until SIGTERM or SIGINT; `announce` is called once nothing forbids it.

    Raises UsageError where others could reach it and nobody may sign in, and where the extra
    `[web]` is not installed. HTTPS is the reverse proxy's.
    """
    refuse_uninstalled()
    refuse_unguarded(workspace, address)
    announce()
    if not address.is_loopback:
        log.warning("tokens and data go over the network in clear: put an HTTPS proxy before it")
    _allow_connections()
    app = make_app(workspace, address, warms_up=True)
    with ending_in_order():
        make_server(app, address).run()


def make_app(
    workspace: Workspace, address: Address | None = None, *, warms_up: bool = False
) -> ASGIApp:
    """Return the interface of one workspace that listens at `address` (default: local only)."""
    from shm_daemon.web.app import make_pages
    from shm_daemon.web.middleware import HeadersMiddleware, LimitMiddleware
    from shm_daemon.web.site import Description, Site

    site = Site(Description(workspace), address or Address())
    pages = make_pages(site, warms_up=warms_up)
    return HeadersMiddleware(LimitMiddleware(pages, site), site)


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


def make_server(app: ASGIApp, address: Address) -> uvicorn.Server:
    """Return a server that says little of itself and of callers."""
    import uvicorn

    config = uvicorn.Config(
        app,
        host=address.host,
        port=address.port,
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


def refuse_uninstalled() -> None:
    """Raise UsageError where the extra `[web]` is not installed; loads nothing of it."""
    with needing("web"):
        for name in ("fastapi", "plotly", "prometheus_client", "python_multipart", "uvicorn"):
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
) -> Iterator[None]:
    """Serve the web interface while the context lasts; without an address, nothing.

    What befalls it does not touch the daemon; it ends with the daemon, however that ends. Where the
    daemon writes its log to a file, the interface has one beside it: two processes cannot put one
    file aside. Raises UsageError where it may not be begun at all.
    """
    if address is None:
        yield
        return
    refuse_uninstalled()
    refuse_unguarded(workspace, address)
    if log_file:  # daemon.web.log by daemon.log
        log_file = log_file.with_name(f"{log_file.stem}.web{log_file.suffix}")
    command = _command(workspace.folder, address, log_file)
    stopped = threading.Event()
    thread = threading.Thread(target=_keep, args=(command, stopped), name="web", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()  # it ends the process itself where that does not end in time


def _keep(command: list[str], stopped: threading.Event) -> None:
    """Run the process until stopped, and again some seconds after it has ended."""
    while not stopped.is_set():
        try:
            # It ends when its standard input does, so that it outlives no killed daemon.
            process = subprocess.Popen(command, stdin=subprocess.PIPE)  # noqa: S603
        except OSError as error:
            log.error("the web interface cannot be begun: %s", error)
        else:
            with process:
                while process.poll() is None and not stopped.wait(0.2):
                    pass
                process.terminate()
                try:
                    process.wait(2 * ENDING_S)  # its callers have been cut off by then
                except subprocess.TimeoutExpired:
                    process.kill()
        if not stopped.is_set():
            log.warning("the web interface ended; it is begun again in %.0f s", _AGAIN_S)
            stopped.wait(_AGAIN_S)


def _command(workspace: Path, address: Address, log_file: Path | None) -> list[str]:
    """Return the words that begin it in a process of its own."""
    log_to = ["--log-file", str(log_file)] if log_file else []
    place = [str(workspace), address.host, str(address.port)]
    return [sys.executable, "-m", "shm_daemon.web", *place, *log_to]
