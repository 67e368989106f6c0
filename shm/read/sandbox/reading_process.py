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
from dataclasses import asdict, dataclass
from pathlib import Path

from shm.errors import BadInput, ShmError, WorkerDied
from shm.read.limits import Limits
from shm.read.sandbox.protocol import (
    BEGUN,
    LARGEST_HEADER,
    LENGTH_BYTES,
    Answer,
    arrays_of,
    bytes_of_arrays,
    header_of,
)
from shm.resources import KILLING

ARRAYS_AT_ONCE = 2
"""The arrays of an answer may be so many times what is read at once."""
WALL_SECONDS = 3.0
"""A child may take so many times its processor time: beyond, it waits for something."""
# judgement: ending a child takes milliseconds, starting the reader seconds, far longer on a full
# machine; what a kernel refuses is not mended within the minute
_GRACE_S, _START_S, _UNCONFINED_S = 5.0, 120.0, 60.0
_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from shm.read.sandbox.serving import serve; serve()"
)
_KEPT = ("LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")
_DAMAGED = "The file is damaged or made to harm: export it anew from its source."


@dataclass(frozen=True)
class Request:
    """What a child is to do: `folder` is where it may unpack, empty where it may not write."""

    verb: str
    path: str
    working_folder: str
    folder: str
    limits: Limits

    def as_bytes(self) -> bytes:
        return json.dumps(asdict(self)).encode()


def ask(request: Request) -> Answer:
    """The answer of a child that has read the file; raises BadInput where it died of it."""
    with _one_at_a_time:
        try:
            return _asked(request)
        except ConnectionError:  # the reading process died before: not the file's doing
            return _asked(request)


def _asked(request: Request) -> Answer:
    reader = _reader()
    try:
        return reader.ask(request)
    except BaseException as error:
        # After a refusal of ours the child may still write, or the reader still wait for it.
        if not isinstance(error, BadInput) or not reader.at_rest:
            _forget()
        raise


class _Reader:
    """A reading process."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        environment = {name: os.environ[name] for name in _KEPT if name in os.environ}
        environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        environment["HDF5_USE_FILE_LOCKING"] = "FALSE"  # nobody writes what is archived
        paths = json.dumps([str(Path(each).absolute()) for each in sys.path])
        with theirs:
            self.process = subprocess.Popen(  # noqa: S603 - our own program
                [sys.executable, "-I", "-X", "utf8", "-c", _CODE, paths],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                env=environment,
                start_new_session=True,
            )
        self.owner, self.requests, self.at_rest = os.getpid(), ours, True
        self._begin()

    def _begin(self) -> None:
        """Waits until it is there, so that its start does not count as reading."""
        self.requests.settimeout(_START_S)
        try:
            begun = self.requests.recv(1)
        except TimeoutError:
            begun = b""
        if not begun:
            self.end()
            raise ShmError(
                "the process that reads files does not start.",
                remedy="See its message above; try `python -c 'import shm.read'`.",
                retry_after_s=60.0,
            )

    def ask(self, request: Request) -> Answer:
        self.at_rest = False
        out, into = os.pipe()
        with os.fdopen(out, "rb", buffering=0) as answer:
            try:
                socket.send_fds(self.requests, [request.as_bytes()], [into])
            finally:
                os.close(into)
            wall_s = WALL_SECONDS * request.limits.parse_seconds + _GRACE_S
            pipe = _Pipe(answer.fileno(), time.monotonic() + wall_s, request)
            found = _received(pipe, request)
        status = self._status()
        if found is None:
            raise _death(status, request, pipe.begun)
        return found

    def _status(self) -> int:
        """How the child ended: its exit code, or the signal that killed it, negative."""
        self.requests.settimeout(_GRACE_S)
        try:
            said = self.requests.recv(4)
        except (TimeoutError, ConnectionError):
            said = b""
        self.at_rest = len(said) == 4
        return int(struct.unpack("i", said)[0]) if self.at_rest else -signal.SIGKILL

    def end(self) -> None:
        """Ends it and whatever it has begun; a copy in a forked process is only forgotten."""
        self.requests.close()
        if self.owner == os.getpid():
            _kill_session(self.process)
        else:
            self.process.returncode = 0  # ours to forget, not to wait for


def _kill_session(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@dataclass
class _Pipe:
    """The end of a pipe that is read until a deadline; `begun` once the child is confined."""

    descriptor: int
    deadline: float
    request: Request
    begun: bool = False

    def bytes(self, count: int) -> bytearray:
        """So many bytes, or fewer where the child ends before; raises BadInput when time is up."""
        found = bytearray(count)
        view, place = memoryview(found), 0
        with open(self.descriptor, "rb", buffering=0, closefd=False) as stream:
            while place < count:
                self._wait()
                got = stream.readinto(view[place : place + (1 << 20)])
                if not got:
                    break
                place += got
        view.release()
        del found[place:]
        return found

    def _wait(self) -> None:
        left = self.deadline - time.monotonic()
        poll = select.poll()
        poll.register(self.descriptor, select.POLLIN | select.POLLHUP)
        if left <= 0 or not poll.poll(1000 * left):
            raise _death(-signal.SIGALRM, self.request, self.begun)


def _received(pipe: _Pipe, request: Request) -> Answer | None:
    """A whole answer within the limits, or None; raises BadInput when time is up."""
    pipe.begun = pipe.bytes(len(BEGUN)) == BEGUN
    length = int.from_bytes(pipe.bytes(LENGTH_BYTES), "little")
    if not 0 < length <= LARGEST_HEADER:
        return None
    raw = pipe.bytes(length)
    if len(raw) != length:
        return None
    try:
        header = header_of(bytes(raw))
        size = bytes_of_arrays(header)
        if size > ARRAYS_AT_ONCE * request.limits.bytes_at_once:
            return None
        arrays = pipe.bytes(size)
        return Answer(header["refused"], header["found"], arrays_of(header, arrays))
    except ValueError:
        return None


def _death(status: int, request: Request, begun: bool) -> ShmError:
    """Why a child gave no answer: a file is not to blame before it was opened."""
    seconds = request.limits.parse_seconds
    if status in (-signal.SIGXCPU, -signal.SIGALRM):
        what = f"takes more than {seconds:g} s to read."
        remedy = f"{_DAMAGED} Split a long record, or raise the setting parse_seconds."
        return BadInput(what, file=request.path, remedy=remedy)
    if -status in KILLING:
        how = signal.Signals(-status).name
        what = f"the process that read {Path(request.path).name} was killed ({how})."
        return WorkerDied(what, how=how)
    if not begun:
        return ShmError(
            "the process that reads files cannot be confined, so that nothing is read.",
            remedy="See `shm doctor`; it is tried again.",
            retry_after_s=_UNCONFINED_S,
        )
    how = signal.Signals(-status).name if status < 0 else f"exit code {status}"
    return BadInput(f"the file made the reader crash ({how}).", file=request.path, remedy=_DAMAGED)


_one_at_a_time = threading.Lock()
_known: list[_Reader] = []


def _reader() -> _Reader:
    """The reading process of this process, begun at the first file."""
    if _known and (_known[0].owner != os.getpid() or _known[0].process.poll() is not None):
        _forget()
    if not _known:
        _known.append(_Reader())
    return _known[0]


def _forget() -> None:
    while _known:
        _known.pop().end()


def _after_fork() -> None:
    """A forked process must not talk to the reader of its parent, nor inherit a held lock."""
    global _one_at_a_time
    _one_at_a_time = threading.Lock()
    _forget()


atexit.register(_forget)
os.register_at_fork(after_in_child=_after_fork)
