"""Executors of steps: processes of our own, of which each may die for itself, or a cluster."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from typing import ParamSpec, TypeVar

from shm.errors import ShmError, WorkerDied
from shm.resources import memory_of_machine, one_thread_a_process
from shm.settings import Settings

_ENDING_S = 5.0  # technical: a process that has died is buried within it
AGAIN_S = 5.0
"""Technical: after so long a place to work in is looked for again; files wait meanwhile."""
_MOST_OF_MEMORY = 0.8
"""One step may have so much of the machine's memory; beyond, it is told that there is none."""

P = ParamSpec("P")
T = TypeVar("T")


def executor_of(settings: Settings) -> Executor:
    """The workers of the scheduler in the settings or, where there is none, processes of our own.

    Raises ShmError where the extra for a scheduler is not installed.
    """
    one_thread_a_process()
    if not settings.scheduler:
        return Workers(settings.workers)
    try:
        from shm_daemon.cluster import Cluster
    except ImportError as error:
        raise ShmError(
            f"the setting scheduler needs what is not installed: {error}.",
            remedy="`pip install shm[distributed]`, or leave the setting empty.",
        ) from error
    return Cluster(settings.scheduler)


class Workers(Executor):
    """Run each step in one of some processes; one that dies takes no other along.

    Each process is a pool of its own. A step whose process died raises WorkerDied; the others go
    on, and a new process takes the place. Raises ShmError with `retry_after_s` where no process can
    be begun. `prepare` is called in each new process.
    """

    def __init__(self, count: int, prepare: Callable[[], object] | None = None):
        self._threads = ThreadPoolExecutor(count, thread_name_prefix="worker")
        self._prepare, self._idle, self._ended = prepare, list[_Worker](), False
        self._changing = threading.Lock()  # of what is at rest, and whether any more may begin
        self._threads.submit(self._begin_early)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        return self._threads.submit(self._run, partial(fn, *args, **kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends the processes that are at rest; those at work end with their step, or with us.

        None is begun from here on: a step that has none yet raises WorkerDied.
        """
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)
        with self._changing:
            self._ended = True
            resting, self._idle = self._idle, []
        for worker in resting:
            worker.end()

    def _begin_early(self) -> None:
        """The first process imports what it needs while we go on."""
        with suppress(ShmError):
            self._rest(self._worker())

    def _worker(self) -> _Worker:
        """Return a process at rest, or a new one."""
        from shm.pipeline import steps as steps  # before the lock: it can take seconds

        with self._changing:
            if self._ended:  # whoever ended us has looked for our processes: none would find it
                raise WorkerDied("its process was not begun, because all end.")
            self._idle = [each for each in self._idle if each.lives]
            if self._idle:
                return self._idle.pop()
            worker = _Worker(self._prepare)
        worker.wait_until_begun()
        return worker

    def _run(self, step: Callable[[], T]) -> T:
        worker = self._worker()
        try:
            return worker.pool.submit(step).result()
        except BrokenProcessPool:
            raise worker.death() from None
        finally:
            self._rest(worker)

    def _rest(self, worker: _Worker) -> None:
        with self._changing:
            rests = worker.lives and not self._ended
            if rests:
                self._idle.append(worker)
        if not rests:
            worker.end()


class _Worker:
    """A pool of one process."""

    process: BaseProcess | None = None

    def __init__(self, prepare: Callable[[], object] | None):
        from shm.pipeline import steps  # in a thread: nobody waits for it

        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([steps.__name__, "scipy.optimize"])
        self.pool = ProcessPoolExecutor(
            1, mp_context=context, initializer=_begin_step_worker, initargs=(prepare,)
        )
        try:
            self._pid = self.pool.submit(os.getpid)
        except (OSError, EOFError, BrokenProcessPool) as error:
            raise _none_begins(repr(error)) from error

    def wait_until_begun(self) -> None:
        """Raise ShmError where the process ends before it takes on a step."""
        with suppress(BrokenProcessPool):
            pid = self._pid.result()
            self.process = next(
                (p for p in multiprocessing.active_children() if p.pid == pid), None
            )
        if self.process is None:
            self.end()
            raise _none_begins("it ended before it took on a step")

    @property
    def lives(self) -> bool:
        return self.process is not None and self.process.is_alive()

    def death(self) -> WorkerDied:
        """Return how the process died."""
        assert self.process is not None
        self.process.join(_ENDING_S)
        code = self.process.exitcode or 0
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return WorkerDied(f"the process that worked on it died ({how}).", how=how)

    def end(self) -> None:
        """End the process once it is at rest."""
        self.pool.shutdown(wait=False, cancel_futures=True)


def _none_begins(why: str) -> ShmError:
    return ShmError(
        f"no process can be begun to work in: {why}.",
        remedy="See memory and processes of this machine; it is tried again.",
        retry_after_s=AGAIN_S,
    )


def _begin_step_worker(prepare: Callable[[], object] | None) -> None:
    _begin_worker()
    _bound_memory()
    if prepare is not None:
        prepare()


def _bound_memory() -> None:
    """A step that grows without end gets a MemoryError before the machine has no memory left."""
    most = int(_MOST_OF_MEMORY * memory_of_machine())
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if most and (hard == resource.RLIM_INFINITY or hard > most):
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


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
    from shm.pipeline import steps as steps  # what most will be asked for


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
