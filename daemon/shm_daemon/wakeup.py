"""Wake the daemon: by a signal, a change in the spool, a step that has ended."""

from __future__ import annotations

import logging
import queue
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from watchdog.events import FileSystemEvent, FileSystemEventHandler
from watchdog.observers import Observer

SPOOL = "spool"
_CHANGES = ("created", "modified", "moved", "closed")

log = logging.getLogger(__name__)


class Wakeup:
    """May be rung from any thread and from signal handlers; one thread listens."""

    def __init__(self) -> None:
        # A queue of this kind may be put to while the same thread is inside it, as signals do.
        self._rings: queue.SimpleQueue[str] = queue.SimpleQueue()
        self.stopped = False

    def ring(self, why: str = "") -> None:
        self._rings.put(why)

    def stop(self) -> None:
        """Asks the listener to come to an end."""
        self.stopped = True
        self.ring()

    def wait(self, seconds: float) -> set[str]:
        """Waits for a ring or until the time is over; why it rang, over all rings so far."""
        heard: set[str] = set()
        try:
            heard.add(self._rings.get(timeout=seconds))
            while True:
                heard.add(self._rings.get_nowait())
        except queue.Empty:
            return heard


@contextmanager
def stopped_by_signals(wakeup: Wakeup) -> Iterator[None]:
    """SIGTERM and SIGINT end the waiting; in other threads than the main one, nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        wakeup.stop()

    before = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Hints(FileSystemEventHandler):
    def __init__(self, wakeup: Wakeup):
        self._wakeup = wakeup

    def on_any_event(self, event: FileSystemEvent) -> None:
        # Our own looking opens folders: only changes count, or looking would ring for ever.
        if event.event_type in _CHANGES and not event.is_directory:
            self._wakeup.ring(SPOOL)


@contextmanager
def rung_by_changes(wakeup: Wakeup, folder: Path) -> Iterator[None]:
    """Changes in a folder ring the wakeup where the file system tells; scanning finds them too."""
    observer = Observer()
    try:
        observer.schedule(_Hints(wakeup), str(folder), recursive=True)
        observer.start()
    except OSError as error:
        log.warning("no hints of changes in %s (%s); it is scanned only", folder, error)
        yield
        return
    try:
        yield
    finally:
        observer.stop()
        observer.join()
