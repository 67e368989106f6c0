"""The side that asks: one reading process for each of ours, which forks a child for every file.

The reading process has read nothing itself, so that no file can touch the reading of the next; it
begins with an empty environment, in a session of its own, and ends when we do. Values come back as
an .npz of arrays with a header in JSON, never a pickle, and become values by the types that their
classes declare.
"""

from __future__ import annotations

import atexit
import io
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args, get_origin

import numpy as np
from cattrs import Converter
from numpy.typing import NDArray

from shm.documents import finite, reader, value_of
from shm.errors import BadInput, ShmError, WorkerDied
from shm.read.content import holds_test, is_gzipped
from shm.read.limits import Limits
from shm.resources import KILLING

BEGUN = b"+"
"""A child writes it once its limits are in force."""
HEADER = "header"
"""The JSON among the arrays of an answer: the name of its class and a node for each value."""
LARGEST_ANSWER = 2
"""An answer may be so many times what is read at once."""
_DAMAGED = "The file is damaged or made to harm: export it again from its source."
# judgement: ending a child takes milliseconds, starting the reader seconds, far longer on a full
# machine; what fails at the start is not mended within the minute
_GRACE_S, _START_S, _RETRY_S = 5.0, 120.0, 60.0
_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from shm.read.registry import VERBS, libraries_for; "
    "from shm.read.sandbox.serving import serve; serve(VERBS, libraries_for)"
)
_ARRAY: Any = np.ndarray
_OURS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "HDF5_USE_FILE_LOCKING": "FALSE"}
_PASSED_ON = {"LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH"}


def ask(verb: str, path: Path, limits: Limits, kinds: Mapping[str, type]) -> list[Any]:
    """Return the values that a child found in a file, each of a class among `kinds`.

    Raises BadInput, also where the child died of the file.
    """
    request: dict[str, Any] = {"verb": verb, "path": str(path), "folder": ""}
    request |= {"working_folder": str(Path.cwd()), "limits": asdict(limits)}
    if not holds_test(path) and not is_gzipped(path):
        return _answer(request, path, limits, kinds)
    # It is unpacked in a folder of ours, which also goes where the child is killed.
    with tempfile.TemporaryDirectory(prefix="shm-read-") as folder:
        return _answer({**request, "folder": folder}, path, limits, kinds)


def _answer(
    request: dict[str, Any], path: Path, limits: Limits, kinds: Mapping[str, type]
) -> list[Any]:
    with _one_at_a_time:
        try:
            raw, status = _reader().ask(request, limits)
        except ConnectionError:  # the reading process died before: not the file's doing
            _forget()
            raw, status = _reader().ask(request, limits)
    try:
        with np.load(io.BytesIO(raw[len(BEGUN) :]), allow_pickle=False) as packed:
            arrays = {name: packed[name] for name in packed.files}
        found = [(str(kind), node) for kind, node in json.loads(arrays.pop(HEADER).tobytes())]
    except Exception:  # noqa: BLE001 - whatever a child has left
        raise _death(status, path, limits, begun=raw.startswith(BEGUN)) from None
    if found and found[0][0] == "refusal":
        raise BadInput(**found[0][1])
    try:
        by = _reader_with(arrays)
        return [value_of(kinds[kind], node, by=by) for kind, node in found]
    except (ValueError, TypeError) as error:
        raise BadInput(
            f"the file made the reader give an answer that cannot be: {error}.",
            file=path,
            remedy=_DAMAGED,
        ) from error


def _reader_with(arrays: Mapping[str, NDArray[Any]]) -> Converter:
    """Return what takes a value from its node, where each part is of the type that it must be."""

    def array(node: Any, kind: Any) -> NDArray[Any]:
        found = arrays.get(str(node.get("array"))) if isinstance(node, dict) else None
        if found is None or found.dtype != np.dtype(get_args(get_args(kind)[1])[0]):
            raise ValueError("an array is not there, or of another type")
        return found

    by = reader(finite)
    by.register_structure_hook_func(lambda kind: get_origin(kind) is _ARRAY, array)
    return by


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
                env={key: os.environ[key] for key in _PASSED_ON & set(os.environ)} | _OURS,
                start_new_session=True,
            )
        self.requests = ours
        if not self._heard(1, _START_S):  # its start does not count as reading
            self.end()
            raise ShmError(
                "the process that reads files does not start.",
                remedy="See its message above; try `python -c 'import shm.read'`.",
                retry_after_s=_RETRY_S,
            )

    def _heard(self, count: int, seconds: float) -> bytes:
        self.requests.settimeout(seconds)
        try:
            return self.requests.recv(count)
        except (TimeoutError, ConnectionError):
            return b""

    def ask(self, request: dict[str, Any], limits: Limits) -> tuple[bytes, int]:
        """Return an answer and how the child ended; a reader that does not say it is ended."""
        out, into = os.pipe()
        with os.fdopen(out, "rb") as stream:
            try:
                socket.send_fds(self.requests, [json.dumps(request).encode()], [into])
            finally:
                os.close(into)
            raw = stream.read(LARGEST_ANSWER * limits.bytes_at_once + (1 << 21))
        received = self._heard(4, _GRACE_S)
        if len(received) == 4:
            return raw, int(struct.unpack("i", received)[0])
        _forget()
        return raw, -signal.SIGKILL

    def end(self) -> None:
        """End it and whatever it has begun."""
        self.requests.close()
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


def _death(status: int, path: Path, limits: Limits, *, begun: bool) -> ShmError:
    """Return why a child gave no answer: a file is not to blame before it was opened."""
    if status in (-signal.SIGXCPU, -signal.SIGALRM):
        remedy = f"{_DAMAGED} Split a long record, or raise the setting parse_seconds."
        what = f"takes more than {limits.parse_seconds:g} s to read."
        return BadInput(what, file=path, remedy=remedy)
    if -status in KILLING:
        how = signal.Signals(-status).name
        what = f"the process that read {path.name} was killed ({how})."
        return WorkerDied(what, how=how)
    if not begun:
        return ShmError(
            "the process that reads files cannot be confined, so that nothing is read.",
            remedy="See `shm doctor`; it is tried again.",
            retry_after_s=_RETRY_S,
        )
    how = signal.Signals(-status).name if status < 0 else f"exit code {status}"
    return BadInput(f"the file made the reader crash ({how}).", file=path, remedy=_DAMAGED)


_one_at_a_time = threading.Lock()
_known: list[_Reader] = []


def _reader() -> _Reader:
    """Return the reading process of this process, begun at the first file."""
    if _known and _known[0].process.poll() is not None:
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
    while _known:
        reader = _known.pop()
        reader.requests.close()
        reader.process.returncode = 0  # ours to forget, not to wait for


atexit.register(_forget)
os.register_at_fork(after_in_child=_after_fork)
