"""The reading process: forks a child for each request, and says how the child ended.

The child takes limits on, reads, writes its answer into the pipe that came with the request, and is
gone. What a file did to it is gone with it.

Limits (setrlimit) hold on every Unix, that of memory on Linux. Where Python can (3.12), Linux gives
the child no network. What else a process may open and call is for config/shm.service to say.
"""

from __future__ import annotations

import gc
import json
import math
import os
import resource
import signal
import socket
import struct
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shm.documents import compact
from shm.errors import BadInput, ShmError
from shm.read.content import unpacking_in
from shm.read.limits import Limits, limited, limits, too_large, too_much_memory
from shm.read.modal_sets import foreign_modes
from shm.read.registry import layout_of, libraries_for, load_modes, peek_test, read_test, survey
from shm.read.sandbox.reading_process import BEGUN, HEADER, LARGEST_ANSWER

_LARGEST_REQUEST = 1 << 16  # three paths of PATH_MAX, 4096 bytes, thrice as long in JSON
_OPEN_FILES = 64  # judgement: a reader opens a file, its sidecar and modules, one after the other
_WALL_SECONDS = 3.0  # judgement: times its processor time; beyond, it waits for something
_VERBS: dict[str, Callable[[Path], Sequence[object]]] = {
    "read_test": read_test,
    "peek_test": peek_test,
    "load_modes": load_modes,
    "survey": lambda path: [survey(path)],
    "layout_of": lambda path: [layout_of(path)],
    "foreign_modes": lambda path: [each for each in [foreign_modes(path)] if each],
    "do_nothing": lambda _: [],
}


def serve() -> None:
    """Answer requests until the asking process is gone."""
    requests = socket.socket(fileno=0)
    gc.freeze()
    with suppress(ConnectionError):  # it was killed meanwhile
        requests.sendall(BEGUN)
        while True:
            message, descriptors, _, _ = socket.recv_fds(requests, _LARGEST_REQUEST, 1)
            if not message:
                return
            request = json.loads(message)
            for library in libraries_for(Path(request["path"])):
                # Once, for all children: else each would load it within its limits.
                with suppress(ImportError):  # the child says so, with what to do
                    import_module(library)
            child = os.fork()
            if child == 0:
                _read_and_end(request, descriptors[0])
            os.close(descriptors[0])
            _, status = os.waitpid(child, 0)
            requests.sendall(struct.pack("i", os.waitstatus_to_exitcode(status)))


def _read_and_end(request: dict[str, Any], out: int) -> None:
    """Run the whole life of a child; nothing of the parent's runs after it."""
    code = 1
    try:
        allowed = Limits(**request["limits"])
        signal.setitimer(signal.ITIMER_REAL, _WALL_SECONDS * allowed.parse_seconds)
        os.chdir(request["working_folder"])
        folder = Path(request["folder"]) if request["folder"] else None
        _confine(allowed, unpacks=folder is not None, keep=out)
        os.write(out, BEGUN)
        with limited(allowed), unpacking_in(folder):
            _answer(_VERBS[request["verb"]], Path(request["path"]), out)
        code = 0
    finally:
        os._exit(code)


def _confine(allowed: Limits, *, unpacks: bool, keep: int) -> None:
    """Confine this process for good; of its open files only `keep` remains.

    Raises OSError or ValueError where a limit could not be put in force.
    """
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in {0, 1, 2} - {keep}:
        os.dup2(nowhere, descriptor)
    os.closerange(3, keep)
    os.closerange(max(3, keep + 1), 1024)
    seconds, file_bytes = math.ceil(allowed.parse_seconds), allowed.bytes_at_once if unpacks else 0
    bounds = {
        resource.RLIMIT_CORE: (0, 0),
        resource.RLIMIT_CPU: (seconds, seconds + 1),  # the first says why, the second kills
        resource.RLIMIT_FSIZE: (file_bytes, file_bytes),
        resource.RLIMIT_NOFILE: (_OPEN_FILES, _OPEN_FILES),
        resource.RLIMIT_NPROC: (0, 0),  # begins no process, unless it is root's
    }
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        memory = pages * resource.getpagesize() + allowed.parse_memory_bytes
        bounds[resource.RLIMIT_AS] = memory, memory
        if sys.version_info >= (3, 12):
            with suppress(OSError):  # a container may forbid new namespaces
                os.unshare(os.CLONE_NEWUSER | os.CLONE_NEWNET)
    for what, most in bounds.items():
        resource.setrlimit(what, most)


def _answer(verb: Callable[[Path], Sequence[object]], path: Path, out: int) -> None:
    arrays: dict[str, NDArray[Any]] = {}
    try:
        found = [(type(each).__name__, _node(each, arrays)) for each in verb(path)]
        if sum(array.nbytes for array in arrays.values()) > LARGEST_ANSWER * limits().bytes_at_once:
            raise too_large(path)
    except Exception as error:  # noqa: BLE001 - whatever a file makes a parser raise
        arrays, found = {}, [("refusal", _refusal(error, path))]
    header = np.frombuffer(compact(found).encode(), np.uint8)
    packed: dict[str, Any] = {HEADER: header, **arrays}
    with os.fdopen(out, "wb", closefd=False) as stream:
        np.savez(stream, **packed)


def _refusal(error: Exception, path: Path) -> dict[str, object]:
    """Return a refusal with its texts cut to what anybody reads and a database takes."""
    if isinstance(error, MemoryError):
        error = too_much_memory(path, "the file")
    elif not isinstance(error, BadInput):
        what = error.message if isinstance(error, ShmError) else f"{type(error).__name__}: {error}"
        what = f"cannot be read ({what[:200]})."
        error = BadInput(what, file=path, remedy="Export or send it again.")
    texts = {"message": error.message, "remedy": error.remedy, "channel": error.channel[:500]}
    plain = {
        key: "".join(c if c.isprintable() or c == "\n" else "?" for c in text[:2000])
        for key, text in texts.items()
    }
    return {**plain, "file": error.file[:5000], "line": error.line}


def _node(value: object, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return a value as `compact` takes it; arrays are put among the others."""
    if isinstance(value, np.ndarray):
        name = f"array_{len(arrays)}"
        kind = np.complex128 if value.dtype.kind == "c" else np.float64
        arrays[name] = np.ascontiguousarray(value, dtype=kind)
        return {"array": name}
    if is_dataclass(value):
        return {each.name: _node(getattr(value, each.name), arrays) for each in fields(value)}
    if isinstance(value, list | tuple):
        return [_node(each, arrays) for each in value]
    return value.item() if isinstance(value, np.generic) else value
