"""The reading process: forks a child for each request, and says how the child ended.

The child takes limits on, reads, writes its answer into the pipe that came with the request, and is
gone. What a file did to it is gone with it.

Limits (setrlimit) hold on every Unix: processor time, file sizes, open files, no core dump; that of
memory is enforced by Linux. Where Python can (3.12), Linux gives the child no network. What else a
process may open and call is the system's to say: see config/shm.service.
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
from shm.read.sandbox.protocol import refusal_document, send
from shm.read.sandbox.reading_process import BEGUN, LARGEST_ANSWER, WALL_SECONDS

_LARGEST_REQUEST = 1 << 16  # three paths of PATH_MAX, 4096 bytes, thrice as long in JSON
_OPEN_FILES = 64  # judgement: a reader opens a file, its sidecar and modules, one after the other


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
            for library in libraries_for(Path(json.loads(message)["path"])):
                # Once, for all children: else each would load it within its limits.
                with suppress(ImportError):  # the child says so, with what to do
                    import_module(library)
            child = os.fork()
            if child == 0:
                _read_and_end(json.loads(message), descriptors[0])
            os.close(descriptors[0])
            _, status = os.waitpid(child, 0)
            requests.sendall(struct.pack("i", os.waitstatus_to_exitcode(status)))


def _read_and_end(request: dict[str, Any], out: int) -> None:
    """Run the whole life of a child; nothing of the parent's runs after it."""
    code = 1
    try:
        allowed = Limits(**request["limits"])
        signal.setitimer(signal.ITIMER_REAL, WALL_SECONDS * allowed.parse_seconds)
        os.chdir(request["working_folder"])
        folder = Path(request["folder"]) if request["folder"] else None
        confine(allowed, unpacks=folder is not None, keep=out)
        os.write(out, BEGUN)
        with limited(allowed), unpacking_in(folder):
            _answer(_VERBS[request["verb"]], Path(request["path"]), out)
        code = 0
    finally:
        os._exit(code)


def confine(allowed: Limits, *, unpacks: bool, keep: int) -> None:
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


def _answer(verb: Callable[[Path], object], path: Path, out: int) -> None:
    most = LARGEST_ANSWER * limits().bytes_at_once
    try:
        if send(verb(path), out, refused=False, most_bytes=most):
            return
        error = too_large(path)
    except BadInput as refusal:
        error = refusal
    except MemoryError:
        error = BadInput(
            "needs more memory than is given to one file.",
            file=path,
            remedy="Export a small file again; split a long one, or raise parse_memory_bytes.",
        )
    except Exception as unforeseen:  # noqa: BLE001 - whatever a file makes a parser raise
        what = f"{type(unforeseen).__name__}: {unforeseen}"
        what = unforeseen.message if isinstance(unforeseen, ShmError) else what
        remedy = "Export or send it again."
        error = BadInput(f"cannot be read ({what[:200]}).", file=path, remedy=remedy)
    send(refusal_document(error), out, refused=True, most_bytes=1 << 20)


_VERBS: dict[str, Callable[[Path], object]] = {
    "read_test": read_test,
    "peek_test": peek_test,
    # A document that holds nothing but what the reader understood.
    "load_modes": lambda path: json.loads(dump(modes_document(load_modes(path)))),
    "missing_bounds": lambda _: (
        {} if sys.platform == "linux" else {"a limit of memory": "only Linux enforces one"}
    ),
    "survey": lambda path: [survey(path)],
    "layout_of": lambda path: [layout_of(path)],
    "foreign_modes": lambda path: [each for each in [foreign_modes(path)] if each],
}
