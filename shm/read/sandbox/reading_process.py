"""The side that asks: one reading process for each of ours, which forks a child for every file.

The reading process has read nothing itself, so that no file can touch the reading of the next; it
begins with an empty environment, in a session of its own, and ends when we do.
"""

from __future__ import annotations

import atexit
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from shm.errors import BadInput, ShmError, WorkerDied
from shm.read.limits import Limits
from shm.read.sandbox.protocol import Answer, decoded
from shm.resources import KILLING

BEGUN = b"+"
"""A child writes it once its limits are in force."""
LARGEST_ANSWER = 2
"""An answer may be so many times what is read at once."""
WALL_SECONDS = 3.0
"""A child may take so many times its processor time: beyond, it waits for something."""
# judgement: ending a child takes milliseconds, starting the reader seconds, far longer on a full
# machine; what a kernel refuses is not mended within the minute
_GRACE_S, _START_S, _UNCONFINED_S = 5.0, 120.0, 60.0
_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from shm.read.sandbox.serving import serve; serve()"
)
_TIME_IS_UP = b"late"
_PASSED_ON = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
_OURS = {
    "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
    "HDF5_USE_FILE_LOCKING": "FALSE",  # nobody writes what is archived
}  # fmt: skip
_DAMAGED = "The file is damaged or made to harm: export it anew from its source."


def ask(verb: str, path: Path, folder: str, limits: Limits) -> Answer:
    """Return the answer of a child that has read a file, and may unpack it in a folder if any.

    Raises BadInput where the child died of the file.
    """
    request = {
        "verb": verb, "path": str(path), "working_folder": str(Path.cwd()), "folder": folder,
        "limits": asdict(limits),
    }  # fmt: skip
    with _one_at_a_time:
        try:
            return _reader().ask(request, limits)
        except ConnectionError:  # the reading process died before: not the file's doing
            _forget()
            return _reader().ask(request, limits)


class _Reader:
    """A reading process."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        paths = json.dumps([str(Path(each).absolute()) for each in sys.path])
        with theirs:
            self.process = subprocess.Popen(  # noqa: S603 - our own program
                [sys.executable, "-I", "-X", "utf8", "-c", _CODE, paths],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                env={name: os.environ[name] for name in _PASSED_ON if name in os.environ} | _OURS,
                start_new_session=True,
            )
        self.owner, self.requests = os.getpid(), ours
        if not self._heard(1, _START_S):  # its start does not count as reading
            self.end()
            raise ShmError(
                "the process that reads files does not start.",
                remedy="See its message above; try `python -c 'import shm.read'`.",
                retry_after_s=60.0,
            )

    def _heard(self, count: int, seconds: float) -> bytes:
        self.requests.settimeout(seconds)
        try:
            return self.requests.recv(count)
        except (TimeoutError, ConnectionError):
            return b""

    def ask(self, request: dict[str, Any], limits: Limits) -> Answer:
        """Return an answer; where none comes this reader is ended, as it may still wait."""
        out, into = os.pipe()
        status = None
        try:
            try:
                socket.send_fds(self.requests, [json.dumps(request).encode()], [into])
            finally:
                os.close(into)
            raw = _received(out, limits)
            received = self._heard(4, _GRACE_S)
            status = int(struct.unpack("i", received)[0]) if len(received) == 4 else None
        finally:
            os.close(out)
            if status is None:
                _forget()
        try:
            return decoded(raw)
        except ValueError:
            timed_out = -signal.SIGALRM if raw.startswith(_TIME_IS_UP) else -signal.SIGKILL
            status = timed_out if status is None else status
            raise _death(status, request["path"], limits, begun=raw[:1] == BEGUN) from None

    def end(self) -> None:
        """End it and whatever it has begun; a copy in a forked process is only forgotten."""
        self.requests.close()
        if self.owner != os.getpid():
            self.process.returncode = 0  # ours to forget, not to wait for
        elif self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


def _received(pipe: int, limits: Limits) -> bytes:
    """Return all that a child writes, `_TIME_IS_UP` where that takes too long."""
    deadline = time.monotonic() + WALL_SECONDS * limits.parse_seconds + _GRACE_S
    most = LARGEST_ANSWER * limits.bytes_at_once + (1 << 21)
    parts, poll = [b""], select.poll()
    poll.register(pipe, select.POLLIN | select.POLLHUP)
    while most > 0:
        left = deadline - time.monotonic()
        if left <= 0 or not poll.poll(1000 * left):
            return _TIME_IS_UP
        parts.append(os.read(pipe, 1 << 20))
        most -= len(parts[-1])
        if not parts[-1]:
            break
    return b"".join(parts)


def _death(status: int, path: str, limits: Limits, *, begun: bool) -> ShmError:
    """Return why a child gave no answer: a file is not to blame before it was opened."""
    if status in (-signal.SIGXCPU, -signal.SIGALRM):
        remedy = f"{_DAMAGED} Split a long record, or raise the setting parse_seconds."
        what = f"takes more than {limits.parse_seconds:g} s to read."
        return BadInput(what, file=path, remedy=remedy)
    if -status in KILLING:
        how = signal.Signals(-status).name
        what = f"the process that read {Path(path).name} was killed ({how})."
        return WorkerDied(what, how=how)
    if not begun:
        return ShmError(
            "the process that reads files cannot be confined, so that nothing is read.",
            remedy="See `shm doctor`; it is tried again.",
            retry_after_s=_UNCONFINED_S,
        )
    how = signal.Signals(-status).name if status < 0 else f"exit code {status}"
    return BadInput(f"the file made the reader crash ({how}).", file=path, remedy=_DAMAGED)


_one_at_a_time = threading.Lock()
_known: list[_Reader] = []


def _reader() -> _Reader:
    """Return the reading process of this process, begun at the first file."""
    if _known and (_known[0].owner != os.getpid() or _known[0].process.poll() is not None):
        _forget()
    if not _known:
        _known.append(_Reader())
    return _known[0]


def _forget() -> None:
    while _known:
        _known.pop().end()


def _after_fork() -> None:
    """Let a forked process neither talk to its parent's reader nor inherit a held lock."""
    global _one_at_a_time
    _one_at_a_time = threading.Lock()
    _forget()


atexit.register(_forget)
os.register_at_fork(after_in_child=_after_fork)
