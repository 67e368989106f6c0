"""`python -m shm_daemon WORKSPACE`: the daemon without the command line's comforts."""

from __future__ import annotations

import logging
import sys

from shm.errors import ShmError, UsageError
from shm.store import Workspace
from shm_daemon.loop import run


def main(arguments: list[str]) -> int:
    """Serves the workspace named by the only argument; the exit code."""
    logging.basicConfig(
        level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s"
    )
    try:
        if len(arguments) != 1:
            raise UsageError("one workspace is expected.", remedy="python -m shm_daemon WORKSPACE")
        run(Workspace.open(arguments[0]))
    except ShmError as error:
        logging.getLogger("shm").error("%s", error)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
