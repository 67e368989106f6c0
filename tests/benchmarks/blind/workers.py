"""Processes that make or solve the cases of a trial."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from shm.errors import ShmError
from shm.resources import one_thread_a_process


@contextmanager
def workers(
    jobs: int, prepare: Callable[..., None] | None = None, given: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """A pool of fresh processes, each of which first does `prepare(*given)`.

    They leave an interrupt to the process that started them; linear algebra keeps to one thread.
    What has not begun when an error or an interrupt comes is not begun any more. Raises ShmError
    where a process was ended from outside.
    """
    one_thread_a_process()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, _prepared, (prepare, given)) as pool:
        try:
            yield pool
        except BrokenProcessPool:
            raise ShmError(
                "a process that worked at a case was ended from outside.",
                remedy="Run it again; it goes on where it stopped.",
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _prepared(prepare: Callable[..., None] | None, given: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if prepare is not None:
        prepare(*given)
