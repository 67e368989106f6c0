"""The daemon: watches the spool, keeps the flow going, obeys errors that say when to try again."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Protocol

from shm.errors import (
    SchemaOutdated,
    ShmError,
    StoreBusy,
    StoreDamaged,
    StoreError,
    TooLarge,
    retry_pause_s,
)
from shm.pipeline import Clock, Flow, Notifier, utc_now
from shm.pipeline.streaming import Streaming
from shm.settings import Settings
from shm.store import Workspace
from shm.store.active import ActiveLock
from shm_daemon.execution import children_ended, executor_of
from shm_daemon.heartbeat import Pulse, longest_wait_s, tell_systemd, turn_failed
from shm_daemon.hooks import HookNotifier
from shm_daemon.hooks.contract import one_line
from shm_daemon.mqtt import messages
from shm_daemon.publishing import Publisher
from shm_daemon.seedlink import StreamAskers
from shm_daemon.spool import FileStabilityTracker, scan
from shm_daemon.streams import StreamKeeper
from shm_daemon.wakeup import Wakeup, stopped_by_signals
from shm_daemon.web.site import modified_ns

# Technical: how soon it looks again, against the work of looking.
_RECEIVING_S = 1.0
_UNREADABLE_S = 60.0
_STANDING_BY_S = 1.0
_DELIVERING_S = 10.0  # technical: an escalation is promised within 60 s, however seldom is scanned

log = logging.getLogger(__name__)


def run(
    workspace: Workspace,
    *,
    clock: Clock = utc_now,
    wakeup: Wakeup | None = None,
    once: bool = False,
    standby: bool = False,
    make_executor: Callable[[Settings], Executor] = executor_of,
    notifier: Notifier | None = None,
) -> None:
    """Serves a workspace until SIGTERM, SIGINT or `wakeup.stop()`; with `once` until all is done.

    With `standby` it waits while another process serves the store and takes over when that one has
    ended; else that raises StoreBusy. Raises SchemaOutdated and other errors of the store that
    waiting cannot mend.
    """
    wakeup = wakeup or Wakeup()
    settings_of = make_executor, notifier, clock, once
    with stopped_by_signals(wakeup), ExitStack() as ending:
        ending.callback(tell_systemd, "STOPPING=1", "STATUS=ending")
        wait_for = Patience(wakeup, standby)
        while not wakeup.stopped:
            try:
                with workspace.lock(wait_for) as lock, ExitStack() as stack:
                    if Daemon(stack, workspace, lock, wakeup, *settings_of).serve():
                        return
            except StoreError as error:
                waiting_helps = error.retry_after_s is not None
                if once and isinstance(error, StoreDamaged):
                    raise
                if not wakeup.stopped and not (waiting_helps and wait_for(error)):
                    if waiting_helps and wakeup.stopped:  # meanwhile: that is no failure
                        return
                    raise


class Described(Protocol):
    """Follow a description of the bridge that may change."""

    def use(self, workspace: Workspace) -> object: ...


class Patience:
    """Waits for a store that is another's, or whose server does not answer, and says so once."""

    def __init__(self, wakeup: Wakeup, standby: bool):
        self._wakeup, self._standby, self._said = wakeup, standby, ""

    def __call__(self, error: StoreError) -> bool:
        """Wait a while; return True to try again, not where the store is another's."""
        if isinstance(error, StoreBusy) and not self._standby:
            return False
        if self._said != error.message:
            self._said = error.message
            log.info("standing by: %s", error.message)
        tell_systemd("READY=1", "WATCHDOG=1", f"STATUS=standing by: {one_line(error.message)}")
        self._wakeup.wait(_STANDING_BY_S)
        return not self._wakeup.stopped


class Daemon:
    """One turn after the other: take whole files in, advance the flow, wait for a ring.

    All that it begins ends with the `stack`.
    """

    def __init__(
        self,
        stack: ExitStack,
        workspace: Workspace,
        lock: ActiveLock,
        wakeup: Wakeup,
        make_executor: Callable[[Settings], Executor],
        notifier: Notifier | None,
        clock: Clock,
        once: bool,
    ):
        settings = workspace.settings
        self._wakeup, self._lock, self._once = wakeup, lock, once
        self._make_executor = partial(make_executor, settings)
        self._pulse = Pulse(workspace)
        store = stack.enter_context(workspace.store())
        stack.enter_context(children_ended())
        if notifier is None:
            timeout_s, pages = settings.hook_timeout_seconds, settings.pages_address
            notifier = HookNotifier(workspace.folder, timeout_s, os.environ, pages)
            stack.callback(notifier.close)
        executor = self._make_executor()
        self._flow = Flow(
            workspace,
            store,
            executor,
            notifier=notifier,
            clock=clock,
            lanes=settings.workers + 1,
            wake=wakeup.ring,
            on_progress=self._pulse,
        )
        stack.callback(self._flow.close)
        self._streaming = Streaming(
            workspace, store, executor, clock=clock, lanes=settings.workers, wake=wakeup.ring
        )
        stack.callback(self._streaming.close)
        stack.enter_context(messages(workspace))
        keeper = StreamKeeper(workspace, clock, self._streaming.note_sealed)
        self._publisher, askers = Publisher(workspace, clock), StreamAskers(clock)
        for each in (keeper, self._publisher, askers):
            stack.callback(each.close)
        self._described: tuple[Described, ...]
        self._described = (self._flow, self._streaming, keeper, self._publisher, askers)
        if once:
            keeper.drain()
        else:
            askers.use(workspace)
            stack.enter_context(keeper.running())
            stack.enter_context(self._publisher.running())
        stack.callback(self._end_executor)
        self._tracker = FileStabilityTracker(settings.spool_stable_seconds, time.monotonic)
        self._longest_wait_s = longest_wait_s()
        self._scan_at, self._failure = 0.0, ""
        self._described_at = modified_ns(workspace), workspace.newest_change
        self._not_taken: dict[Path, str] = {}
        folders = workspace.spool, workspace.archive.folder
        self._devices = {folder: _device(folder) for folder in folders}
        turn_failed(workspace, "")
        log.info("watching %s", workspace.spool)

    def serve(self) -> bool:
        """Takes turns until the wakeup is stopped or, with `once`, until nothing is left to do.

        False where the store is no longer ours: another may have begun what we had under way.
        """
        while not self._wakeup.stopped:
            if not self._lock.held():
                log.warning("the right to the store was lost; it is asked for again")
                return False
            self._pulse.beat()
            busy = self._turn()
            if self._once and not busy and not self._tracker.watching:
                break
            self._rest()
        if self._once:
            self._publisher.turn()
        log.info("ended")
        return True

    def _rest(self) -> None:
        """Waits for a ring, the next scan or the next look at what is owed to hooks, with a sign
        from time to time.
        """
        look_at = time.monotonic() + _DELIVERING_S
        while (pause_s := min(self._scan_at, look_at) - time.monotonic()) > self._longest_wait_s:
            if self._wakeup.wait(self._longest_wait_s) or self._wakeup.stopped:
                return
            self._pulse.beat()
        self._wakeup.wait(max(0.0, pause_s))

    def _end_executor(self) -> None:
        self._flow.executor.shutdown(wait=False, cancel_futures=True)

    def _turn(self) -> bool:
        """Take a turn; return True if anything is left to do.

        Errors that pass are waited for, and shown until a turn with a scan went well.
        """
        is_whole = time.monotonic() >= self._scan_at
        try:
            if is_whole:
                self._scan()
            left = self._advance_streams_and_files()
            if self._once and not left and not self._tracker.watching:
                left = self._streaming.advance(hurry=True) or self._flow.advance(hurry=True)
            if is_whole:
                self._tell_failure(self._describe_delays())
            return left
        except BrokenExecutor:
            log.warning("a worker process died; beginning new ones")
            self._flow.executor = self._streaming.executor = self._make_executor()
        except ShmError as error:
            if self._is_fatal(error):
                raise
            log.warning("%s", error)
            if not isinstance(error, StoreBusy):
                self._tell_failure(str(error))
            self._scan_at = time.monotonic() + retry_pause_s(error, _UNREADABLE_S)
        except Exception as error:
            if self._once:
                raise
            # A service that ends by what it read reads it again when it is begun again.
            log.exception("this turn failed; the next one is tried in %.0f s", _UNREADABLE_S)
            self._tell_failure(f"{type(error).__name__}: {error}")
            self._scan_at = time.monotonic() + _UNREADABLE_S
        return True

    def _advance_streams_and_files(self) -> bool:
        """Return True if anything is left to do; files advance although a stream fails."""
        left = False
        try:
            left = self._streaming.advance()
        finally:
            left = self._flow.advance() or self._flow.suspects_due_s() is not None or left
        return left

    def _tell_failure(self, why: str) -> None:
        if why != self._failure:
            self._failure = why
            turn_failed(self._flow.workspace, one_line(why))

    def _describe_delays(self) -> str:
        """Return which files wait for something that a person must mend, and why; empty if none."""
        self._not_taken = {p: why for p, why in self._not_taken.items() if os.path.lexists(p)}
        spooled = [f"{path.name} is not taken in: {why}" for path, why in self._not_taken.items()]
        delays = [*spooled, *self._flow.delays.values()]
        more = f" ({len(delays) - 1} other files wait, too)" if delays[1:] else ""
        return "".join(delays[:1]) + more

    def _is_fatal(self, error: ShmError) -> bool:
        """Return True if the service ends by an error: not by a damaged store, but with once."""
        if isinstance(error, StoreDamaged):
            return self._once
        mends = isinstance(error, StoreError) and not isinstance(error, SchemaOutdated)
        return error.retry_after_s is None and (self._once or not mends)

    def _scan(self) -> None:
        self._take_over_description()
        self._refuse_other_disks()
        whole = self._tracker.whole(scan(self._flow.workspace.spool, self._pulse))
        until = time.monotonic() + _RECEIVING_S
        for path in whole:
            if self._wakeup.stopped:
                break
            self._receive(path)
            if time.monotonic() > until:  # after one at least, however slow the disk is
                break
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
        except TooLarge as error:
            log.warning("%s is refused: %s %s", path.name, error.message, error.remedy)
            if path.exists():
                self._tracker.leave(path)
            else:
                self._tracker.forget(path)
        except (ShmError, OSError) as error:
            log.warning("%s is left for now: %s", path.name, error)
            self._put_off(path, str(error), retry_pause_s(error, _UNREADABLE_S))
        except Exception as error:
            log.exception("%s is left for now", path.name)
            self._put_off(path, f"{type(error).__name__}: {error}", _UNREADABLE_S)
        else:
            self._tracker.forget(path)
            self._not_taken.pop(path, None)

    def _put_off(self, path: Path, why: str, wait_s: float) -> None:
        """Try a file again later; say why where it will not pass by itself at once."""
        self._tracker.put_off(path, wait_s)
        if wait_s >= _UNREADABLE_S:
            self._not_taken[path] = why

    def _refuse_other_disks(self) -> None:
        """Raises StoreError where a folder is gone or another disk than at the beginning.

        What is written under a mount point whose disk is away is hidden once it is back.
        """
        for folder, device in self._devices.items():
            if _device(folder) != device:
                raise StoreError(
                    f"{folder.name}/ is gone, or is not on the disk that it was on when the daemon "
                    "began: nothing is taken in.",
                    remedy="Mount its disk. If it was moved for good, begin the daemon again.",
                    retry_after_s=_UNREADABLE_S,
                )

    def _take_over_description(self) -> None:
        """Takes a changed `bridge.toml` or setting over; a wrong one leaves the last in force."""
        workspace = self._flow.workspace
        described = modified_ns(workspace), self._flow.store.settings.newest()
        if described == self._described_at:
            return
        self._described_at = described
        try:
            changed = workspace.reopened()
            for each in self._described:  # the flow first, which refuses what is wrong
                each.use(changed)
        except ShmError as error:
            log.error("bridge.toml is not taken over: %s", error)
        else:
            log.info("bridge.toml or a setting has changed and is taken over")


def _device(folder: Path) -> int | None:
    try:
        return folder.stat().st_dev
    except OSError:
        return None
