"""The shm daemon: spool, loop, hooks.

Its names are loaded when they are asked for: the web interface, a process of its own, begins
without loop and hooks.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shm_daemon.execution import process_pool as process_pool
    from shm_daemon.hooks import HookFailed as HookFailed
    from shm_daemon.hooks import HookNotifier as HookNotifier
    from shm_daemon.loop import run as run
    from shm_daemon.wakeup import Wakeup as Wakeup

_HOMES = {
    "Wakeup": "wakeup",
    "HookFailed": "hooks",
    "HookNotifier": "hooks",
    "process_pool": "execution",
    "run": "loop",
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"shm_daemon.{_HOMES[name]}"), name)
