"""What a reading child may do: limits of the system, and on Linux what it may open and call.

Limits (setrlimit) hold on every Unix: processor time, file sizes, open files, no core dump; that of
memory is enforced by Linux. On Linux Landlock (kernel 5.13; sockets and signals from 6.12) lets a
child open nothing but the file, its sidecar, the folder to unpack in and Python's own files; and
seccomp lets it make only the system calls that reading needs, every other one fails. Both are asked
of the kernel without a library. A kernel that does not know one of them is told to who asks, and
the rest holds; where one is known and cannot be had, nothing is read.
"""

from __future__ import annotations

import ctypes
import errno
import math
import os
import platform
import resource
import struct
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

# judgement: a reader opens a file, its sidecar and modules, one after the other; far below 1024
_OPEN_FILES = 64
_LIBRARIES = ("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/usr/share/zoneinfo", "/etc/localtime")
_DEVICES = ("/dev/null", "/dev/urandom")
# linux/landlock.h
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_ASK_VERSION, _PATH_BENEATH = 1, 1
_READ_FILE, _READ_FOLDER = 1 << 2, 1 << 3
_WRITE_FILE, _MAKE_FOLDER, _MAKE_FILE = 1 << 1, 1 << 7, 1 << 8
_RIGHTS = {1: 13, 2: 14, 3: 15, 5: 16}  # how many kinds of access each version knows
_NETWORK = 0b11, 4  # bind and connect, from version 4
_SCOPES = 0b11, 6  # abstract sockets and signals, from version 6

_NO_LANDLOCK = {
    errno.ENOSYS: "this kernel has none; Linux has it from 5.13",
    errno.EOPNOTSUPP: "it is switched off; see lsm= of the kernel's command line",
    errno.EPERM: "a filter around this process, as of a container, forbids it",
}

# linux/prctl.h, linux/seccomp.h
_NO_NEW_PRIVILEGES, _SET_SECCOMP, _FILTER = 38, 22, 2

# What reading needs, by number on each machine (asm/unistd_64.h, asm-generic/unistd.h): looking
# at files, reading and answering, memory, time, signals to itself, its end. The second entry of
# CALLS are those that are looked at more closely: see `_closely`.
CALLS: dict[str, tuple[int, tuple[int, ...], dict[str, int]]] = {
    "x86_64": (
        0xC000003E,
        (
            # read, write, close, stat, fstat, lstat, poll, lseek, mmap, mprotect, munmap, brk,
            # rt_sigaction, rt_sigprocmask, rt_sigreturn, pread64, readv, writev, access, select,
            # sched_yield, mremap, mincore, madvise, dup, nanosleep, getpid, exit, uname, getdents,
            0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 17, 19, 20, 21, 23, 24, 25, 27, 28,
            32, 35, 39, 60, 63, 78,
            # getcwd, readlink, gettimeofday, getrlimit, getrusage, sysinfo, times, getuid, getgid,
            # geteuid, getegid, getppid, getpgrp, sigaltstack, statfs, fstatfs, gettid, time, futex,
            # sched_getaffinity, getdents64, restart_syscall, clock_gettime, clock_getres,
            79, 89, 96, 97, 98, 99, 100, 102, 104, 107, 108, 110, 111, 131, 137, 138, 186, 201, 202,
            204, 217, 219, 228, 229,
            # clock_nanosleep, exit_group, newfstatat, readlinkat, faccessat, pselect6, ppoll,
            # set_robust_list, preadv, getcpu, getrandom, membarrier, statx, rseq, faccessat2
            230, 231, 262, 267, 269, 270, 271, 273, 295, 309, 318, 324, 332, 334, 439,
        ),
        {"open": 2, "openat": 257, "mkdir": 83, "mkdirat": 258, "ioctl": 16, "fcntl": 72,
         "prlimit64": 302, "kill": 62, "tgkill": 234, "clone3": 435},
    ),
    "aarch64": (
        0xC00000B7,
        (
            # getcwd, dup, statfs, fstatfs, faccessat, close, getdents64, lseek, read, write, readv,
            # writev, pread64, preadv, pselect6, ppoll, readlinkat, newfstatat, fstat, exit,
            # exit_group, futex, set_robust_list, nanosleep, clock_gettime, clock_getres,
            17, 23, 43, 44, 48, 57, 61, 62, 63, 64, 65, 66, 67, 69, 72, 73, 78, 79, 80, 93, 94, 98,
            99, 101, 113, 114,
            # clock_nanosleep, sched_getaffinity, sched_yield, restart_syscall, sigaltstack,
            # rt_sigaction, rt_sigprocmask, rt_sigreturn, times, uname, getrlimit, getrusage,
            # getcpu, gettimeofday, getpid, getppid, getuid, geteuid, getgid, getegid, gettid,
            115, 123, 124, 128, 132, 134, 135, 139, 153, 160, 163, 165, 168, 169, 172, 173, 174,
            175, 176, 177, 178,
            # sysinfo, brk, munmap, mremap, mmap, mprotect, mincore, madvise, getrandom, membarrier,
            # statx, rseq, faccessat2
            179, 214, 215, 216, 222, 226, 232, 233, 278, 283, 291, 293, 439,
        ),
        {"openat": 56, "mkdirat": 34, "ioctl": 29, "fcntl": 25, "prlimit64": 261, "kill": 129,
         "tgkill": 131, "clone3": 435},
    ),
}  # fmt: skip
_LOAD, _AND, _JUMP_EQUAL, _JUMP_FROM, _RETURN = 0x20, 0x54, 0x15, 0x35, 0x06
_ALLOW, _REFUSE, _KILL = 0x7FFF0000, 0x00050000 | errno.EPERM, 0x80000000
_UNKNOWN = 0x00050000 | errno.ENOSYS  # C libraries then make do with an older call
_NEWER_THAN_WE, _OTHER_NUMBERS = 450, 0x40000000  # the latter: x32, a second set of numbers
_CREATE, _EXCLUSIVE, _OTHER_WAYS = 0x40, 0x80, 0x400603  # truncate, append, nameless, write
_ASK_IF_TERMINAL, _KEEP_OPEN, _CLOSE_ON_EXEC = 0x5401, 0x5450, 0x5451
_PLAIN_FCNTL = (0, 1, 2, 3, 1030)  # F_DUPFD, F_GETFD, F_SETFD, F_GETFL, F_DUPFD_CLOEXEC

Step = tuple[int, int, int, int]
"""Of a filter (linux/filter.h): code, how far to jump where it is true, and where not, value."""


class Unconfined(Exception):
    """A bound that this kernel knows could not be put in force."""


@dataclass(frozen=True)
class Confinement:
    """What one child may use; `folder` is the only place where it may write, if any."""

    readable: tuple[Path, ...]
    folder: Path | None
    seconds: float
    memory_bytes: int
    file_bytes: int


def confine(to: Confinement, keep: int) -> dict[str, str]:
    """Confines this process for good; of its open files only `keep` remains.

    Gives what this system does not know, by name, and why. Raises Unconfined, OSError or ValueError
    where a bound that it knows could not be put in force.
    """
    _let_go(keep)
    limit = resource.setrlimit
    seconds = math.ceil(to.seconds)
    limit(resource.RLIMIT_CORE, (0, 0))
    limit(resource.RLIMIT_CPU, (seconds, seconds + 1))  # the first says why, the second kills
    limit(resource.RLIMIT_FSIZE, (to.file_bytes, to.file_bytes))
    limit(resource.RLIMIT_NOFILE, (_OPEN_FILES, _OPEN_FILES))
    if sys.platform != "linux":
        return {"Landlock, seccomp": f"{platform.system()} has neither; Linux has"}
    memory = _memory_in_use() + to.memory_bytes
    limit(resource.RLIMIT_AS, (memory, memory))
    libc = ctypes.CDLL(None, use_errno=True)
    _succeed(libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0), "no new privileges")
    missing = {
        "Landlock": _open_nothing_but(to, libc),
        "seccomp": _call_nothing_but(to.folder is not None, libc),
    }
    return {name: why for name, why in missing.items() if why}


def _succeed(result: int, what: str) -> int:
    """The result of a call that may not fail."""
    if result < 0:
        raise Unconfined(f"{what}: {os.strerror(ctypes.get_errno())}")
    return result


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


def _open_nothing_but(to: Confinement, libc: ctypes.CDLL) -> str:
    """Why files are not confined; empty where they are."""
    version = libc.syscall(_CREATE_RULESET, None, 0, _ASK_VERSION)
    if version < 0 and ctypes.get_errno() in _NO_LANDLOCK:
        return _NO_LANDLOCK[ctypes.get_errno()]
    _succeed(version, "the version of Landlock")
    everything = (1 << _RIGHTS[max(known for known in _RIGHTS if known <= version)]) - 1
    ruleset = _ruleset(everything, version, libc)
    _allow(to.readable, _READ_FILE, ruleset, libc)
    _allow(map(Path, _DEVICES), _READ_FILE, ruleset, libc)
    _allow(pythons_own(), _READ_FILE | _READ_FOLDER, ruleset, libc)
    if to.folder is not None:
        unpacking = _READ_FILE | _READ_FOLDER | _WRITE_FILE | _MAKE_FILE | _MAKE_FOLDER
        _allow([to.folder], unpacking, ruleset, libc)
    _succeed(libc.syscall(_RESTRICT_SELF, ruleset, 0), "Landlock")
    os.close(ruleset)
    return ""


def _ruleset(everything: int, version: int, libc: ctypes.CDLL) -> int:
    """A set of rules that denies all kinds of access that the kernel knows."""
    parts = [everything]
    parts += [rights for rights, since in (_NETWORK, _SCOPES) if version >= since]
    attributes = struct.pack(f"{len(parts)}Q", *parts)
    made = libc.syscall(_CREATE_RULESET, attributes, len(attributes), 0)
    return _succeed(int(made), "a set of rules for Landlock")


def _allow(paths: Iterable[Path], rights: int, ruleset: int, libc: ctypes.CDLL) -> None:
    for path in paths:
        try:
            place = os.open(path, os.O_PATH | os.O_CLOEXEC)
        except OSError:
            continue  # not there: nothing to allow
        of_a_file = rights if path.is_dir() else rights & _READ_FILE
        rule = struct.pack("=Qi", of_a_file, place)
        added = libc.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, 0)
        os.close(place)
        _succeed(added, f"a rule of Landlock for {path}")


@cache
def pythons_own() -> tuple[Path, ...]:
    """Where modules come from that are imported late, and the libraries of the system.

    Not all of `sys.path`: that may hold the folder in which the daemon was begun, the workspace.
    """
    top = [module for name, module in list(sys.modules.items()) if "." not in name]
    packages = {str(place) for module in top for place in getattr(module, "__path__", ())}
    return tuple(Path(place) for place in {sys.prefix, sys.base_prefix, *packages, *_LIBRARIES})


# ---------------------------------------------------------------- calls


def _call_nothing_but(unpacks: bool, libc: ctypes.CDLL) -> str:
    """Why system calls are not confined; empty where they are."""
    machine = platform.machine()
    if machine not in CALLS:
        return f"the calls of {machine} are not known to shm; those of {' and '.join(CALLS)} are"
    # Without a program, as prctl(2) has it: EINVAL where filters are not compiled in, else EFAULT.
    if libc.prctl(_SET_SECCOMP, _FILTER, None, 0, 0) < 0 and ctypes.get_errno() == errno.EINVAL:
        return "this kernel is built without filters of system calls"
    steps = filter_of(machine, unpacks, os.getpid())
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    heading = struct.pack("@HP", len(steps), ctypes.addressof(program))
    _succeed(libc.prctl(_SET_SECCOMP, _FILTER, heading, 0, 0), "seccomp")
    return ""


def filter_of(machine: str, unpacks: bool, own: int) -> list[Step]:
    """The steps of a filter: what may be called, by the process `own`; all else fails.

    A call by another machine's numbers kills, those of x32 fail, and one that is newer than this
    list is answered as by a kernel that does not know it.
    """
    architecture, plain, by_name = CALLS[machine]
    steps: list[Step] = [
        (_LOAD, 0, 0, 4),
        (_JUMP_EQUAL, 1, 0, architecture),
        (_RETURN, 0, 0, _KILL),
    ]
    steps += [(_LOAD, 0, 0, 0)]
    steps += [(_JUMP_FROM, 0, 1, _OTHER_NUMBERS), (_RETURN, 0, 0, _REFUSE)]
    steps += [(_JUMP_FROM, 0, 1, _NEWER_THAN_WE), (_RETURN, 0, 0, _UNKNOWN)]
    closely = _closely(unpacks, own)
    for name, number in by_name.items():
        steps += [(_JUMP_EQUAL, 0, len(closely[name]), number), *closely[name]]
    steps += [(_JUMP_EQUAL, len(plain) - i, 0, call) for i, call in enumerate(plain)]
    return [*steps, (_RETURN, 0, 0, _REFUSE), (_RETURN, 0, 0, _ALLOW)]


def _closely(unpacks: bool, own: int) -> dict[str, list[Step]]:
    """What decides on calls that are allowed with some arguments only."""
    refused: list[Step] = [(_RETURN, 0, 0, _REFUSE)]
    in_folder: list[Step] = [(_RETURN, 0, 0, _ALLOW)] if unpacks else refused
    return {
        "open": _opening(1, unpacks),
        "openat": _opening(2, unpacks),
        "mkdir": in_folder,
        "mkdirat": in_folder,
        "ioctl": _one_of(1, (_ASK_IF_TERMINAL, _KEEP_OPEN, _CLOSE_ON_EXEC)),
        "fcntl": _one_of(1, _PLAIN_FCNTL),
        "prlimit64": [  # a look at its own: process 0, and no new limits
            (_LOAD, 0, 0, _argument(0)), (_JUMP_EQUAL, 0, 4, 0),
            (_LOAD, 0, 0, _argument(2)), (_JUMP_EQUAL, 0, 2, 0),
            (_LOAD, 0, 0, _argument(2) + 4), (_JUMP_EQUAL, 1, 0, 0),
            (_RETURN, 0, 0, _REFUSE), (_RETURN, 0, 0, _ALLOW),
        ],
        "kill": _one_of(0, (own,)),
        "tgkill": _one_of(0, (own,)),
        "clone3": [(_RETURN, 0, 0, _UNKNOWN)],
    }  # fmt: skip


def _argument(number: int) -> int:
    """Where the lower half of a call's argument stands (both machines are little-endian)."""
    return 16 + 8 * number


def _one_of(argument: int, values: Sequence[int]) -> list[Step]:
    """Allows a call where one of its arguments, of 32 bits, has one of these values."""
    tests = [(_JUMP_EQUAL, len(values) - i, 0, value) for i, value in enumerate(values)]
    ends = [(_RETURN, 0, 0, _REFUSE), (_RETURN, 0, 0, _ALLOW)]
    return [(_LOAD, 0, 0, _argument(argument)), *tests, *ends]


def _opening(flags: int, unpacks: bool) -> list[Step]:
    """Allows to read; where it unpacks also to make a file, never to touch one that is there."""
    steps: list[Step] = [(_LOAD, 0, 0, _argument(flags)), (_AND, 0, 0, _CREATE | _OTHER_WAYS)]
    if not unpacks:
        return [*steps, (_JUMP_EQUAL, 1, 0, 0), (_RETURN, 0, 0, _REFUSE), (_RETURN, 0, 0, _ALLOW)]
    new, but_not = _CREATE | _EXCLUSIVE, _OTHER_WAYS & ~3
    steps += [(_JUMP_EQUAL, 4, 0, 0)]
    steps += [(_LOAD, 0, 0, _argument(flags)), (_AND, 0, 0, new | but_not)]
    return [*steps, (_JUMP_EQUAL, 1, 0, new), (_RETURN, 0, 0, _REFUSE), (_RETURN, 0, 0, _ALLOW)]
