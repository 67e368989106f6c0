"""Versions, and whether what the settings call for is there. Needs no store."""

from __future__ import annotations

import platform
import sqlite3
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from shm import __version__
from shm.bridge import AppriseHook
from shm.models import competing_names
from shm.read import apart
from shm.store import Workspace
from shm_daemon.doctor.contract import Finding, fault, ok, warning

_MODULES = {
    "alerts": ("apprise",),
    "distributed": ("distributed",),
    "mqtt": ("paho",),
    "postgres": ("psycopg",),
    "web": ("fastapi", "prometheus_client", "uvicorn"),
}
_SHOWN = ("numpy", "scipy", "sqlalchemy")


def check_versions() -> Iterator[Finding]:
    """What results depend on."""
    libraries = ", ".join(f"{name} {_version(name)}" for name in _SHOWN)
    yield ok(
        "versions",
        f"shm {__version__}, Python {platform.python_version()}, {libraries}, "
        f"SQLite {sqlite3.sqlite_version}",
    )


def check_extras(workspace: Workspace) -> Iterator[Finding]:
    """Whether what the settings call for is installed."""
    installed = [extra for extra, modules in _MODULES.items() if all(map(find_spec, modules))]
    settings, hooks = workspace.settings, workspace.bridge.hooks
    needed = {
        "alerts": any(isinstance(hook, AppriseHook) for hook in hooks),
        "distributed": bool(settings.scheduler),
        "mqtt": bool(settings.mqtt_url),
        "postgres": "://" in settings.store,
    }
    missing = [extra for extra, wanted in needed.items() if wanted and extra not in installed]
    if missing:
        names = ",".join(missing)
        yield fault("extras", f"not installed: {names}", f"pip install 'shm[{names}]'")
    else:
        yield ok("extras", f"installed: {', '.join(installed) or 'none'}; none other is needed")


def check_models(workspace: Workspace) -> Iterator[Finding]:
    """Whether each hanger has a model class; raises UsageError, as the daemon does."""
    names = workspace.settings.model_names
    for hanger in workspace.bridge.hangers:
        competing_names(hanger, names)
    yield ok("models", f"{', '.join(names)}; each hanger has one that applies")


def check_confinement() -> Iterator[Finding]:
    """Whether files of others are read within all bounds that we know; ShmError where they cannot.

    A file is read by a child process here, as the daemon's are.
    """
    missing = apart.missing_bounds()
    for name, why in missing.items():
        yield warning(
            "confinement",
            f"files are read without {name}: {why}",
            "A file made to take its reader over could do what this user may: let nobody send "
            "files whom you do not trust, or run shm on a newer Linux, on x86_64 or aarch64.",
        )
    if not missing:
        yield ok("confinement", "files are read within limits, Landlock and a list of system calls")


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
