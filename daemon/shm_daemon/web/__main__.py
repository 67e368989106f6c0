"""`python -m shm_daemon.web WORKSPACE HOST PORT [LOG]`: ends with its standard input."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from pathlib import Path

from shm.errors import ShmError, UsageError
from shm.store import Workspace
from shm_daemon.logs import begin_logging
from shm_daemon.web.address import Address
from shm_daemon.web.serving import serve


def main(arguments: list[str]) -> int:
    """Serves one workspace; the exit code."""
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s")
    threading.Thread(target=_end_with_input, daemon=True).start()
    try:
        if len(arguments) not in (3, 4):
            raise UsageError("3 or 4 arguments are expected.", remedy="Begin it with `shm web`.")
        folder, host, port, *log_file = arguments
        workspace = Workspace.open(folder)
        begin_logging(workspace.settings, Path(log_file[0]) if log_file else None)
        serve(workspace, Address(host, int(port)))
    except ShmError as error:
        logging.getLogger("shm").error("%s", error)
        return error.exit_code
    return 0


def _end_with_input() -> None:
    sys.stdin.buffer.read()
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
