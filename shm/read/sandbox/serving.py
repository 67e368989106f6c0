"""The reading process: forks a child for each request, and says how the child ended.

The child takes limits on, reads, writes its answer into the pipe that came with the request, and is
gone. What a file did to it is gone with it.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import socket
import struct
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from shm.documents import dump
from shm.errors import BadInput, ShmError
from shm.modes_document import modes_document
from shm.read.content import unpacking_in
from shm.read.limits import Limits, limited, limits, too_large
from shm.read.modal_sets import foreign_modes
from shm.read.registry import layout_of, libraries_for, load_modes, peek_test, read_test, survey
from shm.read.sandbox.confinement import Confinement, confine, pythons_own
from shm.read.sandbox.protocol import BEGUN, LARGEST_HEADER, encoded, refusal_as_value
from shm.read.sandbox.reading_process import ARRAYS_AT_ONCE, WALL_SECONDS
from shm.read.sidecar import sidecar_path

_LARGEST_REQUEST = 1 << 16  # three paths of PATH_MAX, 4096 bytes, thrice as long in JSON


def serve() -> None:
    """Answers requests until the asking process is gone."""
    requests = socket.socket(fileno=0)
    pythons_own()  # found once, for all children
    gc.freeze()
    with suppress(ConnectionError):  # it was killed meanwhile
        requests.sendall(b"+")
        while True:
            message, descriptors, _, _ = socket.recv_fds(requests, _LARGEST_REQUEST, 1)
            if not message:
                return
            _load_for(message)
            child = os.fork()
            if child == 0:
                _read_and_end(requests, message, descriptors[0])
            os.close(descriptors[0])
            _, status = os.waitpid(child, 0)
            requests.sendall(struct.pack("i", os.waitstatus_to_exitcode(status)))


def _load_for(message: bytes) -> None:
    """Loads what reads a file once, for all children: else each would do so within its limits."""
    for library in libraries_for(Path(json.loads(message)["path"])):
        if library not in sys.modules:
            with suppress(ImportError):  # the child says so, with what to do
                import_module(library)
            gc.freeze()


def _read_and_end(requests: socket.socket, message: bytes, out: int) -> None:
    """The whole life of a child; nothing of the parent's runs after it."""
    code = 1
    try:
        requests.close()
        request = json.loads(message)
        allowed = Limits(**request["limits"])
        signal.setitimer(signal.ITIMER_REAL, WALL_SECONDS * allowed.parse_seconds)
        os.chdir(request["working_folder"])
        path, folder = Path(request["path"]), request["folder"]
        missing = confine(
            Confinement(
                readable=(path, sidecar_path(path)),
                folder=Path(folder) if folder else None,
                seconds=allowed.parse_seconds,
                memory_bytes=allowed.parse_memory_bytes,
                file_bytes=allowed.bytes_at_once if folder else 0,
            ),
            keep=out,
        )
        os.write(out, BEGUN)
        verb = _VERBS.get(request["verb"]) or (lambda _: missing)
        with limited(allowed), unpacking_in(Path(folder) if folder else None):
            _write_answer(verb, path, out)
        code = 0
    finally:
        os._exit(code)


def _write_answer(verb: Callable[[Path], object], path: Path, out: int) -> None:
    try:
        head, arrays = encoded(verb(path), refused=False)
        most = ARRAYS_AT_ONCE * limits().bytes_at_once
        if len(head) > LARGEST_HEADER or sum(array.nbytes for array in arrays) > most:
            raise too_large(path)
    except BadInput as error:
        head, arrays = encoded(refusal_as_value(error), refused=True)
    except Exception as error:  # noqa: BLE001 - whatever a file makes a parser raise
        head, arrays = encoded(refusal_as_value(_unforeseen(error, path)), refused=True)
    for part in (memoryview(head), *(array.data for array in arrays)):
        left = part.cast("B")
        while left:
            left = left[os.write(out, left) :]


def _unforeseen(error: Exception, path: Path) -> BadInput:
    """A refusal for what no reader should raise."""
    if isinstance(error, MemoryError):
        return BadInput(
            "needs more memory than is given to one file.",
            file=path,
            remedy="Export a small file again; split a long one, or raise parse_memory_bytes.",
        )
    what = error.message if isinstance(error, ShmError) else f"{type(error).__name__}: {error}"
    return BadInput(f"cannot be read ({what[:200]}).", file=path, remedy="Export or send it again.")


def _modes(path: Path) -> Any:
    """A modal-tests document that holds nothing but what the reader understood."""
    return json.loads(dump(modes_document(load_modes(path))))


_VERBS: dict[str, Callable[[Path], object]] = {
    "read_test": read_test, "peek_test": peek_test, "load_modes": _modes,
    "survey": lambda path: [survey(path)], "layout_of": lambda path: [layout_of(path)],
    "foreign_modes": lambda path: [foreign_modes(path)],
}  # fmt: skip
