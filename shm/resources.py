"""Packaged files, found inside the wheel or beside the package; threads and memory of a process."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def _locate(relative: str) -> Path:
    inside_wheel = _PACKAGE / relative
    return inside_wheel if inside_wheel.exists() else _PACKAGE.parent / relative


def migrations_folder() -> Path:
    """The alembic scripts."""
    return _locate("migrations")


def default_config() -> Path:
    """The commented `bridge.toml` that `shm init` writes."""
    return _locate("config/default.toml")


def service_unit() -> Path:
    """The systemd unit of the daemon."""
    return _locate("config/shm.service")


def one_thread_a_process() -> None:
    """Keeps the linear algebra of this process and its children to one thread, unless told else.

    Many threads slow problems of our size down ten times and change the last digits. To be called
    before numpy is imported.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def give_back_memory() -> None:
    """Gives the memory that this process has freed back to the system, where glibc manages it.

    It keeps what lies below anything still in use. After steps that take and free some 60 MB each,
    a process would hold more of it every day.
    """
    trim = _malloc_trim()
    if trim is not None:
        trim(0)


@cache
def _malloc_trim() -> Callable[[int], object] | None:
    return getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
