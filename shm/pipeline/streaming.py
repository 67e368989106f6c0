"""Streams of permanent sensors brought forward: windows, readings, what the watch says of them.

Ten minutes are read as soon as they have come, each stream in order and apart from the others; an
hour, six hours and a day are pooled once their windows are done. What computes runs on the
executor. A window and how far its stream has come are one transaction, and so are a reading, the
watch's state after it and its alert: this may be killed at any instant and simply goes on.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any

from shm.documents import dump
from shm.modes_document import modes_document
from shm.pipeline.clock import Clock, utc_now
from shm.read.atomic import replace_text
from shm.store import Store, Workspace
from shm.store.archive import nothing
from shm.values.stream import Period, Stream, StreamEvent, Window, WindowReading

WINDOW = timedelta(minutes=10)
"""Long enough that a mode at 5 Hz of 0.1 % damping is known to 2e-4 (S. K. Au, 2014)."""
PERIODS: Mapping[Period, timedelta] = {
    "hour": timedelta(hours=1),
    "six hours": timedelta(hours=6),
    "day": timedelta(days=1),
}
_KEPT_BEFORE_ALERT = timedelta(hours=24)
"""Of raw samples, for good: what changed within a day is told within a day."""
_AGAIN = timedelta(minutes=1)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Running:
    future: Future[Any]
    keep: Callable[[Any], object]


class Streaming:
    """All streams of a workspace; `lanes` is how many steps may be under way at once."""

    def __init__(
        self,
        workspace: Workspace,
        store: Store,
        executor: Executor,
        *,
        clock: Clock = utc_now,
        lanes: int = 1,
        wake: Callable[[], object] = nothing,
    ):
        self.store, self.executor, self.clock, self.lanes = store, executor, clock, lanes
        self.wake, self.ring = wake, workspace.ring
        self._running: dict[str, _Running] = {}
        self._pooled: dict[tuple[str, Period], datetime] = {}
        self._not_before: dict[str, datetime] = {}
        self.use(workspace)

    def use(self, workspace: Workspace) -> None:
        """Goes on with another description of the bridge."""
        self.workspace = workspace
        self._turn = 0

    def close(self) -> None:
        """Abandons what is under way: the store still says that it waits."""
        for running in self._running.values():
            running.future.cancel()

    def advance(self) -> bool:
        """Keeps what is finished, begins what has come; whether anything is under way."""
        for name, running in list(self._running.items()):
            if running.future.done():
                del self._running[name]
                self._keep(name, running)
        streams = self.workspace.bridge.streams
        # Each turn begins with another, or the first would keep all lanes while they catch up.
        for stream in (*streams[self._turn :], *streams[: self._turn]):
            if len(self._running) >= self.lanes:
                break
            if stream.name not in self._running and self._may_begin(stream):
                self._begin(stream)
        self._turn = (self._turn + 1) % max(1, len(streams))
        return bool(self._running)
