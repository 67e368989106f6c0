"""Packaged files, found inside the wheel or beside the package; threads of numerical libraries."""

from __future__ import annotations

import os
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
