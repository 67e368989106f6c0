"""Finds packaged files: inside the wheel beside this module, in a checkout beside the package."""

from __future__ import annotations

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
