"""The web interface beside the daemon: a process of its own, begun again where it dies."""

from __future__ import annotations

import logging
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shm.store import Workspace
from shm_daemon.web.__main__ import command
from shm_daemon.web.address import Address
from shm_daemon.web.serving import ENDING_S, context_of, refuse_unguarded, refuse_uninstalled

# Technical: at once where it died by chance, each minute where it cannot live, to spare the log.
_FIRST_WAIT_S, _LONGEST_WAIT_S, _LIVED_WELL_S = 1.0, 60.0, 60.0

_ENDING_S = 2 * ENDING_S  # its callers have been cut off by then

log = logging.getLogger(__name__)


@contextmanager
def web_beside(
    workspace: Workspace,
    address: Address | None,
    log_file: Path | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
) -> Iterator[None]:
    """Serves the web interface while the context lasts; without an address, nothing.

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
    context_of(certificate, key)
    log_file = log_beside(log_file) if log_file else None
    keeper = _Keeper(command(workspace.folder, address, certificate, key, log_file))
    thread = threading.Thread(target=keeper.keep, name="web", daemon=True)
    thread.start()
    try:
        yield
    finally:
        keeper.stop()
        thread.join()  # it ends the process itself where that does not end in time


def log_beside(file: Path) -> Path:
    """Where the web interface writes its log beside a daemon's: daemon.web.log by daemon.log."""
    return file.with_name(f"{file.stem}.web{file.suffix}")


class _Keeper:
    def __init__(self, command: list[str]):
        self._command, self._stopped = command, threading.Event()

    def keep(self) -> None:
        """Begins the process again whenever it ends, ever later where it does not live long."""
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
        """Until the process ends or we are stopped; how many seconds it lived."""
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
                process.wait(_ENDING_S)
            except subprocess.TimeoutExpired:
                process.kill()
        return lived_s
