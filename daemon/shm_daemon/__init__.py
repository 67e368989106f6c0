"""The shm daemon: spool, loop, hooks."""

from shm_daemon.bell import Bell
from shm_daemon.execution import process_pool
from shm_daemon.hooks import HookFailed, HookNotifier
from shm_daemon.loop import run

__all__ = ["Bell", "HookFailed", "HookNotifier", "process_pool", "run"]
