"""Steps on other machines: a Dask cluster behind the interface of `concurrent.futures`.

Dask holds nothing that matters: what is lost with it is done again, because the store says that it
still waits. Workers must give the same results to the bit, so they are asked for their versions;
equal versions give equal bits on processors of one kind, for which they are not asked.
"""

from __future__ import annotations

import logging
import os
import platform
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from functools import partial
from typing import ParamSpec, TypeVar

import dask
import numpy as np
import scipy
from distributed import Client, KilledWorker
from distributed.client import FutureCancelledError
from distributed.comm import CommClosedError

import shm
from shm.errors import ShmError
from shm_daemon.execution import AGAIN_S

_CONNECTING_S = 5.0  # technical: a scheduler in one's own network answers in a fraction of that
_LOST = (CancelledError, FutureCancelledError, CommClosedError)

P = ParamSpec("P")
T = TypeVar("T")
log = logging.getLogger(__name__)


class Cluster(Executor):
    """The workers of a Dask scheduler, at `tcp://HOST:PORT` or `tls://HOST:PORT`.

    It connects when the first step is submitted, and anew where the connection was lost. A step
    whose workers died again and again raises BrokenExecutor; one that was lost with the scheduler,
    or sent to a worker of another version, raises ShmError with `retry_after_s`.
    """

    def __init__(self, scheduler: str):
        self._scheduler = scheduler
        self._client: Client | None = None

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Raises ShmError with `retry_after_s` where no cluster can be had or one is unlike us."""
        step = partial(run_if_same_versions, traits(), partial(fn, *args, **kwargs))
        there = self._connected().get_executor(pure=False).submit(step)
        here: Future[T] = Future()
        here.add_done_callback(lambda done: there.cancel() if done.cancelled() else None)
        there.add_done_callback(partial(_pass_on, here=here, scheduler=self._scheduler))
        return here

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leaves the cluster, whose workers go on for others."""
        if self._client is not None:
            self._client.close(timeout=_CONNECTING_S)
            self._client = None

    def _connected(self) -> Client:
        if self._client is None or self._client.status not in ("running", "connecting"):
            self.shutdown()
            self._client = _connect(self._scheduler)
        return self._client


def traits() -> dict[str, str]:
    """Return versions that must be the same wherever a step runs, for equal results to the bit."""
    return {
        "shm": shm.__version__,
        "Python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "not set"),
    }


def run_if_same_versions(expected: Mapping[str, str], step: Callable[[], T]) -> T:
    """Runs a step on a worker; raises ShmError where the worker is unlike the daemon."""
    _refuse_unlike(platform.node(), traits(), expected)
    return step()


def _connect(scheduler: str) -> Client:
    # A recording is carried to its worker in one piece.
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "2GB"})
    try:
        client = Client(scheduler, timeout=_CONNECTING_S, set_as_default=False, name="shm")
    except (OSError, ValueError) as error:
        raise ShmError(
            f"the scheduler {scheduler} cannot be reached: {error}.",
            remedy="Begin it with `dask scheduler`, or correct the setting `scheduler`.",
            retry_after_s=AGAIN_S,
        ) from error
    try:
        found = client.run(traits, on_error="return")
        for worker, its in found.items():
            _refuse_unlike(worker, its, traits())
    except ShmError:
        client.close(timeout=_CONNECTING_S)
        raise
    log.info("steps run on %s, workers: %d", scheduler, len(found))
    return client


def _refuse_unlike(worker: str, its: object, expected: Mapping[str, str]) -> None:
    if isinstance(its, Mapping):
        unlike = [name for name, version in expected.items() if its.get(name) != version]
        if not unlike:
            return
        how = f"has {unlike[0]} {its.get(unlike[0])}, the daemon {expected[unlike[0]]}"
    else:
        how = f"cannot run shm: {its!r}"
    raise ShmError(
        f"the worker {worker} {how}.",
        remedy="Install the same there, set OMP_NUM_THREADS=1, and begin it again.",
        retry_after_s=AGAIN_S,
    )


def _pass_on(there: Future[T], *, here: Future[T], scheduler: str) -> None:
    """Ends our future as the cluster's has ended, in terms that the flow knows."""
    if not here.set_running_or_notify_cancel():
        return
    error = CancelledError() if there.cancelled() else there.exception()
    if error is None:
        here.set_result(there.result())
    elif isinstance(error, KilledWorker):
        here.set_exception(BrokenExecutor(str(error)))
    elif isinstance(error, _LOST):
        lost = f"a step was lost with the connection to {scheduler}."
        here.set_exception(ShmError(lost, remedy="It is tried again.", retry_after_s=AGAIN_S))
    else:
        here.set_exception(error)
