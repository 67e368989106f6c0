"""`python -m shm_daemon WORKSPACE`: the daemon without the command line's comforts."""

from __future__ import annotations

import logging
import sys

from shm.errors import ShmError, UsageError
from shm.store import Workspace
from shm_daemon.logs import begin_logging
from shm_daemon.loop import run


def main(arguments: list[str]) -> int:
    """Serves the workspace named by the only argument; the exit code."""
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s")
    try:
        if len(arguments) != 1:
            raise UsageError("one workspace is expected.", remedy="python -m shm_daemon WORKSPACE")
        workspace = Workspace.open(arguments[0])
        begin_logging(workspace.settings)
        run(workspace)
    except ShmError as error:
        logging.getLogger("shm").error("%s", error)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
