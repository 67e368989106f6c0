"""Keeps a process that diagnoses from reading anything but its cases: the key above all.

An audit hook (Python's PEP 578), which cannot be removed again, sees every file that Python opens,
whatever its path: links are resolved first. It guards against any slip of our own code, and against
a cause that is looked up instead of found. It is no prison for foreign machine code; who wants that
as well keeps the key on another machine until the answers are sealed.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

_KEY_NAME = ".key.json"
_SYSTEM = ("/usr", "/lib", "/lib64", "/etc", "/proc", "/sys", "/dev", "/System", "/Library")
_TWO_PATHS = ("os.link", "os.symlink", "os.rename")
_ELSEWHERE = (
    "subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork",
    "os.forkpty", "os.startfile", "socket.connect", "socket.bind", "sqlite3.connect",
)  # fmt: skip


class Refused(PermissionError):
    """A guarded process asked for what a diagnosis does not need."""


def guard(readable: Sequence[Path], hidden: Sequence[Path]) -> None:
    """From now on this process opens files only in `readable` folders and where Python lies.

    Never the `hidden` ones, be it through a link of either kind. It starts no process and no
    connection either.
    """
    roots = tuple(os.path.realpath(root) for root in [*map(str, readable), *_python()])
    identities = {_identity(path) for path in hidden if path.exists()}

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event in _ELSEWHERE:
            raise Refused(f"a diagnosis of a blind trial does without {event}")
        paths = {"open": 1, **dict.fromkeys(_TWO_PATHS, 2)}.get(event, 0)
        for path in arguments[:paths]:
            if isinstance(path, str | bytes | os.PathLike):  # else it is open already
                _refuse_unless_free(os.fsdecode(path), roots, identities)

    sys.addaudithook(hook)


def _python() -> list[str]:
    """Where the interpreter, its libraries and this package lie."""
    package = Path(__file__).resolve().parents[2]
    return [
        sys.prefix, sys.base_prefix, sys.exec_prefix, *sysconfig.get_paths().values(),
        str(package), *_SYSTEM,
    ]  # fmt: skip


def _identity(path: str | Path) -> tuple[int, int]:
    """Device and inode: the same for every name of a file."""
    found = Path(path).stat()
    return found.st_dev, found.st_ino


def _refuse_unless_free(path: str, roots: Sequence[str], hidden: set[tuple[int, int]]) -> None:
    real = os.path.realpath(path)
    within = any(real == root or real.startswith(root + os.sep) for root in roots)
    linked = bool(hidden) and Path(real).exists() and _identity(real) in hidden
    if not within or linked or real.endswith(_KEY_NAME):
        raise Refused(f"a diagnosis of a blind trial may not open {path}")
