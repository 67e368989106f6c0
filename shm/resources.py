"""Packaged files, found inside the wheel or beside the package; threads and memory of a process.

And names of a package that are loaded when they are asked for.
"""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

KILLING = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)
"""What operators, the kernel without memory and its helpers send; nothing that a parser does."""
_PACKAGE = Path(__file__).resolve().parent


def _locate(relative: str) -> Path:
    inside_wheel = _PACKAGE / relative
    return inside_wheel if inside_wheel.exists() else _PACKAGE.parent / relative


def migrations_folder() -> Path:
    """Return the folder of the alembic scripts."""
    return _locate("migrations")


def default_config() -> Path:
    """Return the commented `bridge.toml` of `shm init`, without the lines of the settings."""
    return _locate("config/default.toml")


def unit_file(name: str) -> Path:
    """Return the path of a systemd unit, such as the daemon's `shm.service`."""
    return _locate(f"config/{name}")


def manual() -> Path:
    """Return the first page of the manual, which need not be there."""
    inside_wheel = _PACKAGE / "manual"
    folder = inside_wheel if inside_wheel.exists() else _PACKAGE.parent / "build" / "manual"
    return folder / "index.html"


def when_asked(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Build the `__getattr__` of a package that imports each name from its module in `homes`."""

    def __getattr__(name: str) -> Any:  # noqa: N807 (the name that Python looks up)
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return __getattr__


def one_thread_a_process() -> None:
    """Limit linear algebra here and in children to one thread, unless the environment says else.

    Many threads slow problems of our size down ten times and change the last digits. To be called
    before numpy is imported.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def give_back_memory() -> None:
    """Return the memory that this process has freed to the system, where glibc manages it.

    It keeps what lies below anything still in use. After steps that take and free some 60 MB each,
    a process would hold more of it every day.
    """
    trim = _malloc_trim()
    if trim is not None:
        trim(0)


@cache
def memory_of_machine() -> int:
    """Return the memory of the machine or, if smaller, of our control group, in bytes.

    0 where the system does not tell.
    """
    try:
        known = [os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")]
    except (ValueError, OSError):
        return 0
    try:  # version 2 alone; its last line is 0::/PATH
        group = Path("/proc/self/cgroup").read_text(encoding="utf-8").split("0::/")[-1].strip()
    except OSError:
        return known[0]
    for folder in (Path(group), *Path(group).parents):
        try:
            known.append(int(Path("/sys/fs/cgroup", folder, "memory.max").read_text("ascii")))
        except (OSError, ValueError):  # no such file, or "max"
            continue
    return min(known)


@cache
def _malloc_trim() -> Callable[[int], object] | None:
    return getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
