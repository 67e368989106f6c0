"""Where steps run: a pool of processes that a crash of one step cannot take along, or a cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from multiprocessing.connection import wait

from shm.errors import ShmError
from shm.resources import one_thread_a_process
from shm.settings import Settings


def executor_of(settings: Settings) -> Executor:
    """The workers of the scheduler in the settings or, where there is none, processes of our own.

    Raises ShmError where the extra for a scheduler is not installed.
    """
    one_thread_a_process()
    if not settings.scheduler:
        return process_pool(settings.workers)
    try:
        from shm_daemon.cluster import Cluster
    except ImportError as error:
        raise ShmError(
            f"the setting scheduler needs what is not installed: {error}.",
            remedy="`pip install shm[distributed]`, or leave the setting empty.",
        ) from error
    return Cluster(settings.scheduler)


def process_pool(workers: int) -> ProcessPoolExecutor:
    """Processes that start clean, hold none of our files and locks, and die with us."""
    one_thread_a_process()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([])  # imports there would hold us up until they are done
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin_worker)
    pool.submit(os.getpid)  # the first worker imports what it needs while we go on
    return pool


@contextmanager
def children_ended() -> Iterator[None]:
    """Ends, with the context, the processes that were begun in it."""
    before = {child.pid for child in multiprocessing.active_children()}
    try:
        yield
    finally:
        for child in multiprocessing.active_children():
            if child.pid not in before:
                child.kill()


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the daemon, which ends us
    threading.Thread(target=_end_with_parent, daemon=True).start()
    import_module("shm.pipeline.steps")


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
