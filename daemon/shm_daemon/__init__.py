"""Run the daemon: spool, loop, hooks, web interface.

Its names are loaded when they are asked for: the web interface, a process of its own, begins
without loop and hooks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shm.resources import when_asked

if TYPE_CHECKING:
    from shm_daemon.execution import process_pool as process_pool
    from shm_daemon.hooks import HookFailed as HookFailed
    from shm_daemon.hooks import HookNotifier as HookNotifier
    from shm_daemon.loop import run as run
    from shm_daemon.wakeup import Wakeup as Wakeup

_HOMES = {
    "Wakeup": "shm_daemon.wakeup",
    "HookFailed": "shm_daemon.hooks",
    "HookNotifier": "shm_daemon.hooks",
    "process_pool": "shm_daemon.execution",
    "run": "shm_daemon.loop",
}
__all__ = sorted(_HOMES)
__getattr__ = when_asked(__name__, _HOMES)
