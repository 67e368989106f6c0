"""Real daemons in processes of their own, to be killed."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def real_daemon(
    folder: Path, *, standby: bool = False, log_name: str = "daemon.log"
) -> Iterator[subprocess.Popen[bytes]]:
    """The daemon as an owner begins it, logging to `log_name`; killed at the end."""
    command = [sys.executable, "-m", "shm_daemon", str(folder)]
    if standby:
        shm = "from shm_cli.main import main; main()"
        words = ("--workspace", str(folder), "daemon", "--standby")
        command = [sys.executable, "-c", shm, *words]
    with (folder / log_name).open("ab") as log, subprocess.Popen(command, stderr=log) as daemon:
        try:
            yield daemon
        finally:
            daemon.kill()


class QuickDaemons:
    """Begins daemons within milliseconds, forked off a process that has everything imported.

    They have the stand-in for the sampler and run their steps in a thread. One at a time.
    """

    def __init__(self, folder: Path):
        self._nursery = subprocess.Popen(
            [sys.executable, "-m", "tests.helpers.daemons", str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
            text=True,
        )

    def begin(self, *, once: bool = False) -> int:
        """Begins one; its process id."""
        assert self._nursery.stdin is not None
        self._nursery.stdin.write("once\n" if once else "serve\n")
        self._nursery.stdin.flush()
        return self._told()

    def kill(self, pid: int) -> int:
        """Kills one without warning; its exit code."""
        os.kill(pid, signal.SIGKILL)
        return self.ended()

    def ended(self) -> int:
        """Waits until the one at work has ended; its exit code."""
        return self._told()

    def close(self) -> None:
        self._nursery.kill()
        self._nursery.communicate()

    def _told(self) -> int:
        assert self._nursery.stdout is not None
        return int(self._nursery.stdout.readline())


@contextmanager
def quick_daemons(folder: Path) -> Iterator[QuickDaemons]:
    daemons = QuickDaemons(folder)
    try:
        yield daemons
    finally:
        daemons.close()


def until_serving(pid: int, folder: Path, seconds: float = 120.0) -> None:
    """Waits until a daemon begun a moment ago holds the workspace: its lock says so, or its log."""
    lock, log, end = folder / "shm.lock", folder / "daemon.log", time.monotonic() + seconds
    while not (_says(lock, str(pid)) or f"{pid} watching" in _text(log)):
        if time.monotonic() > end:
            raise TimeoutError(f"process {pid} does not serve {folder}")
        time.sleep(0.005)


def _says(path: Path, text: str) -> bool:
    return _text(path) == text


def _text(path: Path) -> str:
    return path.read_text() if path.exists() else ""


def _nurse(folder: Path) -> None:
    """Forks off a daemon for each line that comes in; tells its process id, then its exit code."""
    import shm_daemon
    from shm.store import Workspace
    from tests.helpers import quick_update
    from tests.helpers.flows import threads

    logging.basicConfig(
        filename=folder / "daemon.log", level=logging.INFO, format="%(process)d %(message)s"
    )
    quick_update.stand_in(setattr)
    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            once = line == "once\n"
            shm_daemon.run(Workspace.open(folder), once=once, make_executor=threads)
            return
        print(pid, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), flush=True)


if __name__ == "__main__":
    _nurse(Path(sys.argv[1]))
