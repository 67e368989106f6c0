"""The sequential test of one hanger: has anything changed, what, since when, how far."""

from __future__ import annotations

from shm.watch.sequential.state import WatchState
from shm.watch.sequential.watching import Call, Watch, Watcher, watch_over, watched

__all__ = ["Call", "Watch", "WatchState", "Watcher", "watch_over", "watched"]
