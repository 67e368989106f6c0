"""Wake the daemon: by a signal, or a step that has ended."""

from __future__ import annotations

import queue
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType


class Wakeup:
    """May be rung from any thread and from signal handlers; one thread listens."""

    def __init__(self) -> None:
        # A queue of this kind may be put to while the same thread is inside it, as signals do.
        self._rings: queue.SimpleQueue[None] = queue.SimpleQueue()
        self.stopped = False

    def ring(self) -> None:
        self._rings.put(None)

    def stop(self) -> None:
        """Asks the listener to come to an end."""
        self.stopped = True
        self.ring()

    def wait(self, seconds: float) -> bool:
        """Wait for a ring or until the time is over; return True if it rang."""
        try:
            self._rings.get(timeout=seconds)
        except queue.Empty:
            return False
        with suppress(queue.Empty):  # however often
            while True:
                self._rings.get_nowait()
        return True


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
