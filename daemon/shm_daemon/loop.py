"""The daemon: watches the spool, keeps the flow going, obeys errors that say when to try again."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from contextlib import ExitStack
from pathlib import Path

from shm.errors import ShmError, StoreError
from shm.pipeline import Clock, Flow, Notifier, utc_now
from shm.store import Workspace
from shm_daemon.bell import SPOOL, Bell, rung_by_changes, stopped_by_signals
from shm_daemon.execution import children_ended, process_pool
from shm_daemon.hooks import HookNotifier
from shm_daemon.spool import FileStabilityTracker, scan

_RECEIVING_S = 1.0
_HINT_DELAY_S = 0.1
_UNREADABLE_S = 60.0

log = logging.getLogger(__name__)


def run(
    workspace: Workspace,
    *,
    clock: Clock = utc_now,
    bell: Bell | None = None,
    once: bool = False,
    make_executor: Callable[[int], Executor] = process_pool,
    notifier: Notifier | None = None,
) -> None:
    """Serves a workspace until SIGTERM, SIGINT or `bell.stop()`; with `once` until all is done.

    Raises StoreBusy where another process serves it, SchemaOutdated and other errors of the store
    that waiting cannot mend.
    """
    bell = bell or Bell()
    settings = workspace.settings
    with ExitStack() as stack:
        stack.enter_context(stopped_by_signals(bell))
        stack.enter_context(workspace.lock())
        store = stack.enter_context(workspace.store())
        stack.enter_context(children_ended())
        if notifier is None:
            timeout_s = settings.hook_timeout_seconds
            notifier = HookNotifier(workspace.folder, timeout_s, os.environ)
            stack.callback(notifier.close)
        executor = make_executor(settings.workers)
        flow = Flow(
            workspace,
            store,
            executor,
            notifier=notifier,
            clock=clock,
            lanes=settings.workers + 1,
            wake=bell.ring,
        )
        stack.callback(flow.close)
        stack.enter_context(rung_by_changes(bell, workspace.spool))
        daemon = Daemon(flow, bell, lambda: make_executor(settings.workers))
        stack.callback(daemon.close)
        log.info("watching %s", workspace.spool)
        daemon.serve(once)
        log.info("ended")


class Daemon:
    """One turn after the other: take whole files in, advance the flow, wait for a ring."""

    def __init__(self, flow: Flow, bell: Bell, make_executor: Callable[[], Executor]):
        self._flow, self._bell, self._make_executor = flow, bell, make_executor
        settings = flow.workspace.settings
        self._tracker = FileStabilityTracker(settings.spool_stable_seconds, time.monotonic)
        self._scan_at = 0.0
        self._described_at = _modified_ns(flow.workspace)

    def serve(self, once: bool) -> None:
        """Takes turns until the bell is stopped or, with `once`, until nothing is left to do."""
        while not self._bell.stopped:
            busy = self._turn()
            if once and not busy and not self._tracker.watching:
                return
            heard = self._bell.wait(max(0.0, self._scan_at - time.monotonic()))
            if SPOOL in heard:
                self._scan_at = min(self._scan_at, time.monotonic() + _HINT_DELAY_S)

    def close(self) -> None:
        self._flow.executor.shutdown(wait=False, cancel_futures=True)

    def _turn(self) -> bool:
        """Whether anything is left to do; errors that pass are waited for."""
        try:
            if time.monotonic() >= self._scan_at:
                self._scan()
            return self._flow.advance()
        except BrokenExecutor:
            log.warning("a worker process died; beginning new ones")
            self._flow.executor = self._make_executor()
        except ShmError as error:
            if error.retry_after_s is None:
                raise
            log.warning("%s", error)
            self._scan_at = time.monotonic() + error.retry_after_s
        return True

    def _scan(self) -> None:
        self._heed_description()
        until = time.monotonic() + _RECEIVING_S
        for path in self._tracker.whole(scan(self._flow.workspace.spool)):
            if self._bell.stopped or time.monotonic() > until:
                break
            self._receive(path)
        pause = min(
            self._flow.workspace.settings.spool_scan_seconds, self._tracker.seconds_to_next()
        )
        self._scan_at = time.monotonic() + pause

    def _receive(self, path: Path) -> None:
        """One file that cannot be taken must not hold up the others; a store that cannot, must."""
        try:
            self._flow.receive(path)
        except StoreError:
            raise
        except (ShmError, OSError) as error:
            log.warning("%s is left for now: %s", path.name, error)
            wait_s = error.retry_after_s if isinstance(error, ShmError) else None
            self._tracker.put_off(path, wait_s or _UNREADABLE_S)
        else:
            self._tracker.forget(path)

    def _heed_description(self) -> None:
        """Takes a changed `bridge.toml` over; a wrong one leaves the last good one in force."""
        modified = _modified_ns(self._flow.workspace)
        if modified == self._described_at:
            return
        self._described_at = modified
        try:
            self._flow.use(self._flow.workspace.reopened())
        except ShmError as error:
            log.error("bridge.toml is not taken over: %s", error)
        else:
            log.info("bridge.toml has changed and is taken over")


def _modified_ns(workspace: Workspace) -> int:
    try:
        return Path(workspace.bridge.source).stat().st_mtime_ns
    except OSError:
        return 0
