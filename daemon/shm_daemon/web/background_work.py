"""Work of seconds to minutes that pages ask for: one request at a time, in a process beside ours.

The process ends when nothing was asked for a while. Results stay in memory, within a limit. A page
may also place an order, which is made once, and ask for its outcome by a word.
"""

from __future__ import annotations

import logging
import pickle
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import dataclass, field
from queue import Empty, Queue
from typing import Any, Generic, Protocol, TypeVar

from fastapi import Request, Response
from fastapi.responses import HTMLResponse

from shm.errors import NothingThere, ShmError
from shm_daemon.execution import children_ended, process_pool

# Technical: requests take seconds; after ten minutes one hangs, and who asks again within a minute
# of a failure is told of it.
_MOST_WAITING, _MOST_ORDERS = 8, 50
_MAX_STORED_BYTES = 64_000_000
_IDLE_S, _LONGEST_S, _FAILURE_LASTS_S, _LOOK_S = 60.0, 600.0, 60.0, 0.2

RETRY_AFTER = {"Retry-After": "2"}
"""Seconds after which to ask again for what takes some of them to work out."""

log = logging.getLogger(__name__)


class WorkRequest(Protocol):
    """A request for work: equal ones have the same result. `make` runs in the other process."""

    def __hash__(self) -> int: ...

    def make(self) -> object: ...


Made = TypeVar("Made")


@dataclass(frozen=True)
class _Result(Generic[Made]):
    """The result of a request with its size, or the error with which it failed."""

    made: Made | None = None
    size_bytes: int = 0
    error: ShmError | None = None
    at_s: float = field(default_factory=time.monotonic)


@dataclass(frozen=True)
class _Order:
    request: WorkRequest
    begun_s: float = field(default_factory=time.monotonic)


class BackgroundWorker(Generic[Made]):
    """Makes what is requested and stores it. May be used from many threads."""

    def __init__(
        self,
        longest_s: float = _LONGEST_S,
        pool: Callable[[int], ProcessPoolExecutor] = process_pool,
    ):
        self._longest_s, self._new_pool = longest_s, pool
        self._results: OrderedDict[WorkRequest, _Result[Made]] = OrderedDict()
        self._orders: OrderedDict[str, _Order] = OrderedDict()
        self._waiting: set[WorkRequest] = set()
        self._queue: Queue[WorkRequest | None] = Queue()
        self._lock, self._closed = threading.RLock(), threading.Event()
        self._thread: threading.Thread | None = None
        self._pool: ProcessPoolExecutor | None = None
        self._ending = ExitStack()

    def stored(self, request: WorkRequest) -> Made | None:
        """Return the stored result of a request, None if there is none; start nothing."""
        with self._lock:
            found = self._results.get(request)
            if found is None or found.error:
                return None
            self._results.move_to_end(request)
            return found.made

    def get_or_start(self, request: WorkRequest) -> Made | None:
        """Return the result of a request; None while it is made, or while many others wait.

        Raises the ShmError with which it failed a short while ago.
        """
        with self._lock:
            if (made := self.stored(request)) is not None:
                return made
            failed = self._results.get(request)
            if failed and failed.error and self._is_valid(request, failed):
                raise failed.error.with_traceback(None)
            is_full = len(self._waiting) >= _MOST_WAITING or self._closed.is_set()
            if request not in self._waiting and not is_full:
                self._waiting.add(request)
                self._queue.put(request)
                if self._thread is None:
                    self._thread = threading.Thread(target=self._work, name="work", daemon=True)
                    self._thread.start()
        return None

    def place(self, request: WorkRequest) -> str:
        """Order what is made once, and return the word by which its page asks for the outcome."""
        word = secrets.token_urlsafe(9)
        with self._lock:
            self._orders[word] = _Order(request)
            while len(self._orders) > _MOST_ORDERS:
                self._orders.popitem(last=False)
        self.get_or_start(request)
        return word

    def outcome(self, word: str, remedy: str) -> Made | None:
        """Return the outcome of an order, None while it is made.

        Raises the ShmError with which it failed, NothingThere with a remedy for an unknown word.
        """
        order = self._orders.get(word)
        if order is None:
            raise NothingThere("this order is not known any more.", remedy=remedy)
        return self.get_or_start(order.request)

    def seconds(self, word: str) -> float:
        """Return for how long an order is waited for."""
        order = self._orders.get(word)
        return time.monotonic() - order.begun_s if order else 0.0

    def close(self) -> None:
        """End the work and its process."""
        self._closed.set()
        self._queue.put(None)
        if self._thread is not None:
            self._thread.join()

    def _is_valid(self, request: WorkRequest, failed: _Result[Made]) -> bool:
        is_order = any(each.request == request for each in self._orders.values())
        return is_order or time.monotonic() - failed.at_s < _FAILURE_LASTS_S

    def _work(self) -> None:
        """Make each request until closed; end the process where none comes for a while."""
        while not self._closed.is_set():
            try:
                request = self._queue.get(timeout=_IDLE_S)
            except Empty:
                self._end_process()
                request = self._queue.get()
            if request is not None and not self._closed.is_set():
                self._store(request, self._make(request))
        self._end_process()

    def _make(self, request: WorkRequest) -> _Result[Made]:
        # Whoever ends all our processes often ends that one first: once, its death is no fault.
        for _ in range(2):
            try:
                packed = self._made_in_process(request)
                made: Made = pickle.loads(packed)  # noqa: S301 - our own process has made it
                return _Result(made, len(packed))
            except BrokenProcessPool:
                self._end_process()
            except TimeoutError:
                self._end_process()
                return _failed(
                    f"it took more than {self._longest_s:g} s and was given up.",
                    "Have it written at leisure with `shm report`; see the log of the web "
                    "interface.",
                )
            except ShmError as error:
                return _Result(error=error)
            except Exception:
                log.exception("working out %r failed", request)
                return _failed("an internal error.", "The log of the web interface says more.")
        return _failed(
            "the process that worked on it died.",
            "It may lack memory: see the log, and try again in a minute.",
        )

    def _made_in_process(self, request: WorkRequest) -> bytes:
        if self._pool is None:
            self._ending.enter_context(children_ended())
            self._pool = self._new_pool(1)
            self._ending.callback(self._pool.shutdown, wait=False, cancel_futures=True)
        future = self._pool.submit(_pack, request)
        deadline = time.monotonic() + self._longest_s
        while not self._closed.is_set() and time.monotonic() < deadline:
            if wait([future], timeout=_LOOK_S).done:
                break
        return future.result(timeout=0)

    def _end_process(self) -> None:
        self._ending.close()
        self._pool = None

    def _store(self, request: WorkRequest, result: _Result[Made]) -> None:
        """Store a result; forget the oldest beyond the limit, but none of an order."""
        with self._lock:
            self._waiting.discard(request)
            if self._closed.is_set():  # that may be why it failed
                return
            self._results[request] = result
            self._results.move_to_end(request)
            ordered = [each.request for each in self._orders.values()]
            for old in [each for each in self._results if each not in (*ordered, request)]:
                if sum(each.size_bytes for each in self._results.values()) <= _MAX_STORED_BYTES:
                    break
                del self._results[old]


def _failed(problem: str, remedy: str) -> _Result[Any]:
    return _Result(error=ShmError(problem, remedy=remedy))


def _pack(request: WorkRequest) -> bytes:
    """Return the result of a request, packed in the other process: its length is its size here."""
    return pickle.dumps(request.make())


def background_worker_of(request: Request) -> BackgroundWorker[Any]:
    """Return the background worker of the app, for all that is requested there."""
    found: BackgroundWorker[Any] = request.app.state.background_worker
    return found


def still_at_work(text: str) -> Response:
    """Return the answer that asks the page to come again."""
    return HTMLResponse(f'<p class="note" role="status">{text}</p>', 202, RETRY_AFTER)
