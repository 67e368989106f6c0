"""Keeps the ring while the daemon serves: rolling files in, segments sealed, what is old out.

In a thread of its own, so that neither holds up the other: a recording that takes long, and samples
that come every few seconds. What was under way when it ends is done the next time.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime

from shm.errors import ShmError
from shm.store import Store, Workspace
from shm.store.ring import ring_of
from shm_daemon.rolling_files import RollingFiles
from shm_daemon.spool import STREAMS

log = logging.getLogger(__name__)

_LOOK_S = 2.0  # technical: chunks are sealed within seconds, of ten minutes
_SWEEP_S = 3600.0  # technical: a thirtieth of a day of samples is no matter
_RETRY_S = 60.0  # technical: a full disk is not mended sooner

Sealed = Callable[[Sequence[tuple[str, datetime]]], object]
"""Is told each stream and beginning of ten minutes that has new samples."""


class StreamKeeper:
    """One turn after the other, in a thread or by whoever calls `turn`."""

    def __init__(
        self,
        workspace: Workspace,
        clock: Callable[[], datetime],
        sealed: Sealed = lambda _: None,
    ):
        self._workspace, self._clock, self._sealed = workspace, clock, sealed
        self._store: Store | None = None
        self._sweep_at = 0.0

    def use(self, workspace: Workspace) -> None:
        """Takes a changed description over."""
        self._workspace = workspace

    def turn(self) -> int:
        """Files in, segments sealed and, once an hour, what is old out; how many files are left.

        Nothing where nobody has thought of streams.
        """
        workspace = self._workspace
        if not workspace.bridge.streams and not (workspace.spool / STREAMS).is_dir():
            return 0
        if self._store is None:
            self._store = workspace.store()
            self._files = RollingFiles(workspace, self._store, self._clock)
        left, now = self._files.take(workspace), self._clock()
        ring = ring_of(workspace, self._clock, self._store.streams.save_event)
        if sealed := ring.seal(now):
            self._sealed(sealed)
        if time.monotonic() >= self._sweep_at:
            self._sweep_at = time.monotonic() + _SWEEP_S
            settings = workspace.settings
            ring.sweep(now, settings.ring_days, settings.ring_bytes)
            self._store.streams.sweep(now, settings.window_days)
        return left

    def close(self) -> None:
        if self._store is not None:
            self._store.close()


@contextmanager
def streams_kept(
    workspace: Workspace,
    clock: Callable[[], datetime],
    *,
    until_done: bool = False,
    sealed: Sealed = lambda _: None,
) -> Iterator[StreamKeeper]:
    """Keeps the ring while the context lasts.

    For the holder of the workspace's lock. With `until_done` all is kept before the context begins,
    and nothing after.
    """
    keeper, ended = StreamKeeper(workspace, clock, sealed), threading.Event()
    thread = threading.Thread(target=_work, args=(keeper, ended), name="streams")
    try:
        if until_done:
            while keeper.turn():
                time.sleep(_LOOK_S / 10)
        else:
            thread.start()
        yield keeper
    finally:
        ended.set()
        if thread.ident is not None:
            thread.join()
        keeper.close()


def _work(keeper: StreamKeeper, ended: threading.Event) -> None:
    while not ended.is_set():
        pause_s = _LOOK_S
        try:
            keeper.turn()
        except Exception as error:  # the daemon goes on without streams rather than not at all
            known = isinstance(error, ShmError)
            log.warning("streams wait: %s", error, exc_info=not known)
            pause_s = getattr(error, "retry_after_s", None) or _RETRY_S
        ended.wait(pause_s)
