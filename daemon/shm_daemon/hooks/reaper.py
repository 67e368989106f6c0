"""Run a program and end every process that it began, sessions of their own included.

``reaper.py REPORT PARENT PROGRAM [ARGUMENT ...]`` runs PROGRAM with its own standard streams, waits
for its end, for SIGTERM or for the end of process PARENT, then ends all descendants and exits as
PROGRAM did. It writes into the file descriptor REPORT what went wrong on its own side.

It adopts orphans (Linux: a subreaper), which nothing that the program calls can undo. It runs as a
process of its own so that the daemon never adopts anything, and imports nothing of shm, to begin
quickly.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path


def main(arguments: Sequence[str]) -> int:
    """Run the program and return its exit code, a negative one for the signal that ended it."""
    report, parent, command = int(arguments[0]), int(arguments[1]), list(arguments[2:])
    os.set_inheritable(report, False)
    awaited = {signal.SIGCHLD, signal.SIGTERM}
    signal.signal(signal.SIGCHLD, lambda *_: None)  # one that is ignored is never pending
    signal.pthread_sigmask(signal.SIG_BLOCK, awaited)
    adopt_orphans()
    if os.getppid() != parent:
        return -signal.SIGTERM
    try:
        program = os.posix_spawnp(
            command[0],
            command,
            # LC_CTYPE: an interpreter's own doing (PEP 538).
            {name: value for name, value in os.environ.items() if name != "LC_CTYPE"},
            setpgroup=0,
            setsigmask=[],
            setsigdef=[signal.SIGPIPE, signal.SIGXFSZ],
        )
    except OSError as error:
        os.write(report, f"cannot be run: {error}".encode())
        return 127  # as a shell has it
    status = None
    while status is None and signal.sigwait(awaited) != signal.SIGTERM:
        status = reap(program)
    n_left = end_descendants(program)
    if n_left:
        os.write(report, f"{n_left} of its processes could not be ended".encode())
    return -signal.SIGKILL if status is None else os.waitstatus_to_exitcode(status)


def adopt_orphans() -> None:
    """Have orphaned descendants become children of this process, and its parent's death sent."""
    if sys.platform == "linux":
        import ctypes

        prctl = ctypes.CDLL(None).prctl
        prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER, linux/prctl.h
        prctl(1, signal.SIGTERM, 0, 0, 0)  # PR_SET_PDEATHSIG


def reap(program: int) -> int | None:
    """Bury all children that have ended; return the status of the program if it is one of them."""
    found = None
    while True:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return found
        if pid == 0:
            return found
        if pid == program:
            found = status


def end_descendants(program: int, seconds: float = 5.0) -> int:
    """Kill all descendants until none is left, and return the number that cannot be killed."""
    if sys.platform != "linux":  # the program's group at least
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(program, signal.SIGKILL)
        return 0
    latest = time.monotonic() + seconds
    while living := find_descendants():
        for pid in living:
            # It has ended meanwhile, or another user owns it.
            with suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
        reap(program)
        if time.monotonic() > latest:
            return len(living)
        time.sleep(0.01)
    return 0


def find_descendants() -> list[int]:
    """Return the descendants of this process that are not buried, by the parents in /proc."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                line = (folder / "stat").read_text(encoding="utf-8", errors="replace")
                parent = int(line.rpartition(")")[2].split()[1])
            except (OSError, IndexError):  # ended meanwhile
                continue
            children.setdefault(parent, []).append(int(folder.name))
    found: list[int] = []
    parents = [os.getpid()]
    while parents:
        below = children.get(parents.pop(), [])
        found += below
        parents += below
    return found


if __name__ == "__main__":
    code = main(sys.argv[1:])
    if code < 0:
        if code not in (-signal.SIGKILL, -signal.SIGSTOP):
            signal.signal(-code, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {-code})
        os.kill(os.getpid(), -code)
    sys.exit(code)
