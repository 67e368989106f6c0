"""Background work: requests that take seconds to compute, one at a time, a few waiting.

It runs in a process of its own that ends when nothing has been wanted for a while, so that neither
a heavy file nor a crash of what reads it touches the interface. The latest results are kept in
memory, within a limit.
"""

from __future__ import annotations

import logging
import pickle
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Generic, Protocol, TypeVar

from fastapi import Request

from shm.errors import ShmError
from shm_daemon.execution import children_ended, process_pool

# Technical: each order takes seconds; the process goes when nobody looks at pages. Judgement: after
# ten minutes it hangs, and who asks again within a minute is told why it failed.
_MOST_WAITING = 8
_MAX_STORED_BYTES = 64_000_000
_IDLE_S = 60.0
_LONGEST_S = 600.0
_FAILURE_LASTS_S = 60.0
_LOOK_S = 0.2

RETRY_AFTER = {"Retry-After": "2"}
"""Seconds after which to ask again for what takes some of them to work out."""

log = logging.getLogger(__name__)


class WorkRequest(Protocol):
    """A request for work: equal ones have the same result. `make` runs in the other process."""

    def __hash__(self) -> int: ...

    def make(self) -> object: ...


Made = TypeVar("Made")


class BackgroundWorker(Generic[Made]):
    """Makes what is ordered and keeps it. May be used from many threads."""

    def __init__(
        self,
        longest_s: float = _LONGEST_S,
        pool: Callable[[int], ProcessPoolExecutor] = process_pool,
    ):
        self._longest_s, self._pool = longest_s, pool
        self._kept: OrderedDict[WorkRequest, tuple[Made, int]] = OrderedDict()
        self._failures: dict[WorkRequest, tuple[ShmError, float]] = {}
        self._waiting: OrderedDict[WorkRequest, None] = OrderedDict()
        self._lost: WorkRequest | None = None
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False

    def stored(self, request: WorkRequest) -> Made | None:
        """Return the stored result of a request, None if there is none; start nothing."""
        with self._changed:
            if request not in self._kept:
                return None
            self._kept.move_to_end(request)
            return self._kept[request][0]

    def get_or_start(self, request: WorkRequest) -> Made | None:
        """Return the result of a request; None while it is computed, or while many others wait.

        Raises the ShmError with which it failed a short while ago.
        """
        with self._changed:
            found = self.stored(request)
            if found is not None:
                return found
            error, failed_at_s = self._failures.get(request, (None, 0.0))
            if error and time.monotonic() - failed_at_s < _FAILURE_LASTS_S:
                raise error.with_traceback(None)
            if len(self._waiting) < _MOST_WAITING and not self._closed:
                self._waiting[request] = None
                if self._thread is None:
                    self._thread = threading.Thread(target=self._work, name="workshop", daemon=True)
                    self._thread.start()
                self._changed.notify_all()
            return None

    def close(self) -> None:
        """End the work and its process."""
        with self._changed:
            self._closed, thread = True, self._thread
            self._waiting.clear()
            self._changed.notify_all()
        if thread is not None:
            thread.join()

    def _work(self) -> None:
        while self._run():
            pass

    def _run(self) -> bool:
        """Work with one process until no request waits or it is lost; return whether to go on.

        The request in work remains among those waiting, so that it is started only once.
        """
        with children_ended():
            pool = self._pool(1)
            try:
                while (request := self._next()) is not None:
                    if not self._run_request(pool, request):
                        return not self._closed
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
        with self._changed:
            if self._waiting and not self._closed:
                return True
            self._thread = None
            return False

    def _next(self) -> WorkRequest | None:
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closed, _IDLE_S)
            return next(iter(self._waiting), None)

    def _run_request(self, pool: ProcessPoolExecutor, request: WorkRequest) -> bool:
        """Run a request and record its result; return whether the process can be used further."""
        try:
            future = pool.submit(_packed, request)
            self._await(future)
            packed = future.result(timeout=0)
        except TimeoutError:
            remedy = (
                "Have it written at leisure with `shm report`; see the log of the web interface."
            )
            problem = f"it took more than {self._longest_s:g} s and was given up."
            self._failed(request, ShmError(problem, remedy=remedy))
            return False
        except BrokenProcessPool:
            self._tried_again(request)
            return False
        except ShmError as error:
            self._failed(request, error)
        except Exception:
            log.exception("working out %r failed", request)
            remedy = "The log of the web interface says more."
            self._failed(request, ShmError("an internal error.", remedy=remedy))
        else:
            self._keep(request, packed)
        return True

    def _await(self, future: Future[bytes]) -> None:
        deadline = time.monotonic() + self._longest_s
        while not self._closed and time.monotonic() < deadline:
            if wait([future], timeout=_LOOK_S).done:
                return

    def _keep(self, request: WorkRequest, packed: bytes) -> None:
        made: Made = pickle.loads(packed)  # noqa: S301 - our own process has made it
        with self._changed:
            self._waiting.pop(request, None)
            self._failures.pop(request, None)
            self._kept[request] = made, len(packed)
            while len(self._kept) > 1 and (
                sum(size_bytes for _, size_bytes in self._kept.values()) > _MAX_STORED_BYTES
            ):
                self._kept.popitem(last=False)

    def _tried_again(self, request: WorkRequest) -> None:
        """Fail a request whose process died twice.

        Once may be no fault of its own: who ends all our processes often ends that one first, and
        whoever asks in the moment before we end as well must not be told of a fault.
        """
        if self._lost != request:
            self._lost = request
            return
        self._lost = None
        remedy = "It may lack memory: see the log, and try again in a minute."
        self._failed(request, ShmError("the process that worked on it died.", remedy=remedy))

    def _failed(self, request: WorkRequest, error: ShmError) -> None:
        now = time.monotonic()
        with self._changed:
            if self._closed:  # that is why it was not made
                return
            self._waiting.pop(request, None)
            fresh = {o: f for o, f in self._failures.items() if now - f[1] < _FAILURE_LASTS_S}
            self._failures = {**fresh, request: (error, now)}


def background_worker_of(request: Request) -> BackgroundWorker[Any]:
    """Return the background worker of the app, for all that is ordered there."""
    found: BackgroundWorker[Any] = request.app.state.background_worker
    return found


def _packed(request: WorkRequest) -> bytes:
    """Return the result of a request, packed in the other process: its length is its size here."""
    return pickle.dumps(request.make())
