"""Work beside the daemon's loop: turns in a thread of its own, and again where one failed."""

from __future__ import annotations

import logging
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Self

from shm.errors import ShmError, retry_pause_s
from shm.pipeline import Clock
from shm.store import Store, Workspace

log = logging.getLogger(__name__)


class Background(ABC):
    """Take turns in a thread, with an open store. For the holder of the workspace's lock.

    `pause_s` lies between two turns, `retry_s` after one that failed.
    """

    name = ""

    def __init__(self, workspace: Workspace, clock: Clock, pause_s: float, retry_s: float):
        self._workspace, self._clock = workspace, clock
        self.pause_s, self.retry_s = pause_s, retry_s
        self._opened: Store | None = None

    def use(self, workspace: Workspace) -> None:
        """Take a changed description over."""
        self._workspace = workspace

    @abstractmethod
    def turn(self) -> object:
        """Do what there is to do."""

    @abstractmethod
    def break_off(self) -> None:
        """End, from another thread, what a turn may wait for."""

    def close(self) -> None:
        if self._opened is not None:
            self._opened.close()

    @contextmanager
    def running(self) -> Iterator[Self]:
        """Take turns while the context lasts."""
        ended = threading.Event()
        thread = threading.Thread(target=self._work, args=(ended,), name=self.name)
        thread.start()
        try:
            yield self
        finally:
            ended.set()
            self.break_off()
            thread.join()

    @property
    def _store(self) -> Store:
        if self._opened is None:
            self._opened = self._workspace.store()
        return self._opened

    def _work(self, ended: threading.Event) -> None:
        while not ended.is_set():
            wait_s = self.pause_s
            try:
                self.turn()
            except Exception as error:  # the daemon goes on without it rather than not at all
                is_known = isinstance(error, ShmError)
                log.warning("%s: waits: %s", self.name, error, exc_info=not is_known)
                wait_s = retry_pause_s(error, self.retry_s)
            ended.wait(wait_s)
