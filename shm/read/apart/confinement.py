"""What a reading child may do: limits of the system, and on Linux what it may open and call.

Limits (setrlimit) hold on every Unix: processor time, file sizes, open files, no core dump; that of
memory is enforced by Linux. On Linux Landlock (kernel 5.13; sockets and signals from 6.12) lets a
child open nothing but the file, its sidecar, the folder to unpack in and Python's own files; and
seccomp takes away sockets, new processes and programs. Both are asked of the kernel without a
library, and both are left out where the kernel does not know them; the limits hold all the same.
"""

from __future__ import annotations

import ctypes
import math
import os
import platform
import resource
import struct
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_OPEN_FILES = 64
_LIBRARIES = ("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/usr/share/zoneinfo", "/etc/localtime")
_DEVICES = ("/dev/null", "/dev/urandom")
_NO_NEW_PRIVILEGES, _SET_SECCOMP, _FILTER = 38, 22, 2

# linux/landlock.h
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_ASK_VERSION, _PATH_BENEATH = 1, 1
_READ_FILE, _READ_FOLDER = 1 << 2, 1 << 3
_RIGHTS = {1: 13, 2: 14, 3: 15, 5: 16}  # how many kinds of access each version knows
_NETWORK = 0b11, 4  # bind and connect, from version 4
_SCOPES = 0b11, 6  # abstract sockets and signals, from version 6

# asm/unistd.h: socket, socketpair, connect, clone, fork, vfork, clone3, execve, execveat, ptrace
_CALLS = {
    "x86_64": (0xC000003E, (41, 53, 42, 56, 57, 58, 435, 59, 322, 101)),
    "aarch64": (0xC00000B7, (198, 199, 203, 220, 435, 221, 281, 117)),
}
_LOAD, _JUMP_EQUAL, _JUMP_FROM, _RETURN = 0x20, 0x15, 0x35, 0x06
_ALLOW, _REFUSE, _KILL = 0x7FFF0000, 0x00050001, 0x80000000
_OTHER_NUMBERS = 0x40000000  # a second set of numbers for the same calls


@dataclass(frozen=True)
class Confinement:
    """What one child may use; `folder` is the only place where it may write, if any."""

    readable: tuple[Path, ...]
    folder: Path | None
    seconds: float
    memory_bytes: int
    file_bytes: int


def confine(to: Confinement, keep: int) -> None:
    """Confines this process for good; of its open files only `keep` remains."""
    _let_go(keep)
    limit = resource.setrlimit
    seconds = math.ceil(to.seconds)
    limit(resource.RLIMIT_CORE, (0, 0))
    limit(resource.RLIMIT_CPU, (seconds, seconds + 1))  # the first says why, the second kills
    limit(resource.RLIMIT_FSIZE, (to.file_bytes, to.file_bytes))
    limit(resource.RLIMIT_NOFILE, (_OPEN_FILES, _OPEN_FILES))
    if sys.platform == "linux":
        memory = _memory_in_use() + to.memory_bytes
        limit(resource.RLIMIT_AS, (memory, memory))
        libc = ctypes.CDLL(None, use_errno=True)
        libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
        _open_nothing_but(to, libc)
        _call_nothing_outside(libc)


def _let_go(keep: int) -> None:
    """Input, output and errors lead nowhere."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        if descriptor != keep:
            os.dup2(nowhere, descriptor)
    os.closerange(3, keep)
    os.closerange(max(3, keep + 1), 1024)


def _memory_in_use() -> int:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    return pages * resource.getpagesize()


# ---------------------------------------------------------------- files


def _open_nothing_but(to: Confinement, libc: ctypes.CDLL) -> None:
    version = libc.syscall(_CREATE_RULESET, None, 0, _ASK_VERSION)
    if version < 1:
        return
    everything = (1 << _RIGHTS[max(known for known in _RIGHTS if known <= version)]) - 1
    ruleset = _ruleset(everything, version, libc)
    _allow(to.readable, _READ_FILE, ruleset, libc)
    _allow(map(Path, _DEVICES), _READ_FILE, ruleset, libc)
    _allow(pythons_own(), _READ_FILE | _READ_FOLDER, ruleset, libc)
    if to.folder is not None:
        _allow([to.folder], everything, ruleset, libc)
    libc.syscall(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)


def _ruleset(everything: int, version: int, libc: ctypes.CDLL) -> int:
    """A set of rules that denies all kinds of access that the kernel knows."""
    parts = [everything]
    parts += [rights for rights, since in (_NETWORK, _SCOPES) if version >= since]
    attributes = struct.pack(f"{len(parts)}Q", *parts)
    return int(libc.syscall(_CREATE_RULESET, attributes, len(attributes), 0))


def _allow(paths: Iterable[Path], rights: int, ruleset: int, libc: ctypes.CDLL) -> None:
    for path in paths:
        try:
            place = os.open(path, os.O_PATH | os.O_CLOEXEC)
        except OSError:
            continue  # not there: nothing to allow
        of_a_file = rights if path.is_dir() else rights & _READ_FILE
        rule = struct.pack("=Qi", of_a_file, place)
        libc.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, 0)
        os.close(place)


@cache
def pythons_own() -> tuple[Path, ...]:
    """Where modules come from that are imported late, and the libraries of the system.

    Not all of `sys.path`: that may hold the folder in which the daemon was begun, the workspace.
    """
    top = [module for name, module in list(sys.modules.items()) if "." not in name]
    packages = {str(place) for module in top for place in getattr(module, "__path__", ())}
    return tuple(Path(place) for place in {sys.prefix, sys.base_prefix, *packages, *_LIBRARIES})


# ---------------------------------------------------------------- calls


def _call_nothing_outside(libc: ctypes.CDLL) -> None:
    """No sockets, no processes, no programs: a call of these fails, as if not permitted."""
    known = _CALLS.get(platform.machine())
    if known is None:
        return
    architecture, calls = known
    steps = [(_LOAD, 0, 0, 4), (_JUMP_EQUAL, 1, 0, architecture), (_RETURN, 0, 0, _KILL)]
    steps += [(_LOAD, 0, 0, 0), (_JUMP_FROM, len(calls) + 1, 0, _OTHER_NUMBERS)]
    steps += [(_JUMP_EQUAL, len(calls) - i, 0, call) for i, call in enumerate(calls)]
    steps += [(_RETURN, 0, 0, _ALLOW), (_RETURN, 0, 0, _REFUSE)]
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    heading = struct.pack("@HP", len(steps), ctypes.addressof(program))
    libc.prctl(_SET_SECCOMP, _FILTER, heading, 0, 0)
