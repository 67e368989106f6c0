"""Work beside the daemon's loop: turns in a thread of its own, and again where one failed."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from shm.errors import ShmError, retry_pause_s

log = logging.getLogger(__name__)


@contextmanager
def repeated(
    name: str, turn: Callable[[], object], *, pause_s: float, retry_s: float
) -> Iterator[None]:
    """Call `turn` in a thread while the context lasts, after an error later than else."""
    ended = threading.Event()
    arguments = name, turn, pause_s, retry_s, ended
    thread = threading.Thread(target=_work, args=arguments, name=name)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _work(
    name: str, turn: Callable[[], object], pause_s: float, retry_s: float, ended: threading.Event
) -> None:
    while not ended.is_set():
        wait_s = pause_s
        try:
            turn()
        except Exception as error:  # the daemon goes on without it rather than not at all
            log.warning("%s: waits: %s", name, error, exc_info=not isinstance(error, ShmError))
            wait_s = retry_pause_s(error, retry_s)
        ended.wait(wait_s)
