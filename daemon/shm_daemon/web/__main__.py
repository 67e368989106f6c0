"""Serve a workspace until standard input ends.

`python -m shm_daemon.web WORKSPACE HOST PORT [--log-file LOG]`
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from shm.errors import ShmError
from shm.store import Workspace
from shm_daemon.logs import begin_logging
from shm_daemon.web.address import Address
from shm_daemon.web.serving import leaving, serve


def main(arguments: Sequence[str]) -> int:
    """Serve one workspace and return the exit code."""
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s")
    parser = argparse.ArgumentParser("shm_daemon.web", description="Begin it with `shm web`.")
    parser.add_argument("workspace", type=Path)
    parser.add_argument("host")
    parser.add_argument("port", type=int)
    parser.add_argument("--log-file", type=Path)
    wanted = parser.parse_args(arguments)
    try:
        workspace = Workspace.open(wanted.workspace)
        begin_logging(workspace.settings, wanted.log_file)
        serve(workspace, Address(wanted.host, wanted.port))
    except ShmError as error:
        logging.getLogger("shm").error("%s", error)
        return error.exit_code
    return 0


def _end_with_input() -> None:
    # Not by `sys.stdin`, whose lock this thread would hold while Python ends.
    while os.read(0, 4096):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    threading.Thread(target=_end_with_input, daemon=True).start()
    with leaving():
        sys.exit(main(sys.argv[1:]))
