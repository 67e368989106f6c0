"""The loop's body: keep what is finished, begin what waits, refuse what fails.

Steps run on the executor; only this process touches the store. A step's result and the mark that
it is done are one transaction, and what waits is asked of the store each time: the flow may be
killed at any instant and simply goes on.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from shm.errors import ShmError, StoreError
from shm.pipeline.intake import Sharing, receive
from shm.pipeline.jobs import DELIVERIES, Clock, DeliveryRefused, Job, Jobs, Notifier, Step
from shm.pipeline.terms import competing, reason_document
from shm.read import sidecar_path
from shm.store import Delivery, Receipt, Store, StoredAlert, Workspace
from shm.values import Alert

_CRASHES = 2
_LONGEST_S = 86400.0

log = logging.getLogger(__name__)


def utc_now() -> datetime:
    """The time, in UTC."""
    return datetime.now(UTC)


@dataclass(frozen=True)
class Running:
    """A job under way."""

    job: Job
    step: Step
    future: Future[Any]


class Flow:
    """Takes files in and brings them through all stages.

    `lanes` is how many steps may be under way at once; without a `notifier` alerts wait in the
    outbox; `wake` is called, from any thread, whenever something under way has ended. Use a flow
    while holding the workspace's lock.
    """

    def __init__(
        self,
        workspace: Workspace,
        store: Store,
        executor: Executor,
        *,
        notifier: Notifier | None = None,
        clock: Clock = utc_now,
        lanes: int = 1,
        wake: Callable[[], object] = lambda: None,
    ):
        self.store, self.executor, self.clock, self.lanes = store, executor, clock, lanes
        self.notifier, self.wake = notifier, wake
        self._running: dict[tuple[str, int], Running] = {}
        self._couriers = ThreadPoolExecutor(DELIVERIES, thread_name_prefix="hook")
        self._crashes: Counter[int] = Counter()
        self._postponed: dict[int, datetime] = {}
        self.use(workspace)
        workspace.archive.sweep()

    def use(self, workspace: Workspace) -> None:
        """Goes on with another description of the bridge; raises UsageError where it is wrong."""
        selected = self.store.selected_models()
        for hanger in workspace.bridge.hangers:
            competing(hanger, workspace.settings, {})
            competing(hanger, workspace.settings, selected)
        self.workspace = workspace
        self.jobs = Jobs(workspace, self.store, self.clock)

    def close(self) -> None:
        """Abandons what is under way; the store still says that it waits."""
        for running in self._running.values():
            running.future.cancel()
        self._couriers.shutdown(wait=False, cancel_futures=True)

    def receive(self, path: Path, sharing: Sharing | None = None) -> Receipt:
        """Takes a whole file in; see `shm.pipeline.intake`."""
        receipt = receive(path, self.workspace, self.store, self.clock(), sharing)
        recording = receipt.recording
        about = {"recording": recording.id, "file": recording.file.file_name, "stage": "received"}
        log.info("%s: %s", recording.file.file_name, receipt.outcome, extra=about)
        return receipt

    def drain(self, after_each: Callable[[], object] = lambda: None) -> None:
        """Works until nothing waits that could be done now; calls `after_each` on the way."""
        while self.advance():
            after_each()
            under_way = [running.future for running in self._running.values()]
            wait(under_way, return_when=FIRST_COMPLETED)

    def advance(self) -> bool:
        """Keeps what is finished, begins what waits; whether anything is under way."""
        for key, running in list(self._running.items()):
            if running.future.done():
                self._finish(running)
                del self._running[key]
        self._begin_deliveries()
        self._begin_steps()
        return bool(self._running)

    # ------------------------------------------------------------ begin

    def _begin_deliveries(self) -> None:
        if self.notifier is not None:
            under_way = [run.job.delivery for run in self._running.values() if run.job.delivery]
            for job in self.jobs.owed(self.notifier, under_way):
                self._begin(job, self._couriers)

    def _begin_steps(self) -> None:
        now = self.clock()
        held = {id_ for id_, until in self._postponed.items() if until > now}
        for job in self.jobs.waiting(2 * self.lanes, held):
            if not self._has_room(job):
                return
            if job.key not in self._running:
                self._begin(job, self.executor)

    def _has_room(self, job: Job) -> bool:
        """Whether a step may begin now; one whose process died before runs alone."""
        steps = [running.job for running in self._running.values() if not running.job.delivery]
        suspects = [j for j in (*steps, job) if any(self._crashes[r] for r in j.recordings)]
        return len(steps) < self.lanes and not (steps and suspects)

    def _begin(self, job: Job, executor: Executor) -> None:
        step = job.prepare()
        future = executor.submit(step.run)
        self._running[job.key] = Running(job, step, future)
        future.add_done_callback(lambda _: self.wake())

    # ------------------------------------------------------------ finish

    def _finish(self, running: Running) -> None:
        job, error = running.job, running.future.exception()
        if error is None:
            self._keep(running)
        elif job.delivery is not None:
            self._put_off(job.delivery, error)
        elif isinstance(error, BrokenExecutor):
            self._note_crash(job, error)
        elif isinstance(error, ShmError) and error.retry_after_s is not None:
            until = self.clock() + timedelta(seconds=error.retry_after_s)
            self._postponed.update(dict.fromkeys(job.recordings, until))
            log.warning("%s %s is tried again: %s", *job.key, error, extra=_about(job))
        else:
            self._refuse(job, error)

    def _keep(self, running: Running) -> None:
        try:
            kept = running.step.keep(running.future.result())
            if isinstance(kept, StoredAlert):
                log.warning(
                    "alert %s: %s",
                    kept.alert.key,
                    kept.alert.message,
                    extra=_about_alert(kept.alert),
                )
            log.info("%s %d: done", *running.job.key, extra=_about(running.job))
        except StoreError as error:
            if error.retry_after_s is not None:
                raise
            self._refuse(running.job, error)
        self._forget(running.job)

    def _forget(self, job: Job) -> None:
        """Earlier troubles of a job that has come to an end count no more."""
        for recording_id in job.recordings:
            self._crashes.pop(recording_id, None)
            self._postponed.pop(recording_id, None)

    def _note_crash(self, job: Job, error: BaseException) -> None:
        """A worker died: perhaps because of this job, perhaps because of one beside it."""
        self._crashes.update(job.recordings)
        log.warning("%s %s: the process that worked on it died", *job.key, extra=_about(job))
        if any(self._crashes[recording_id] >= _CRASHES for recording_id in job.recordings):
            self._refuse(job, error)

    def _refuse(self, job: Job, error: BaseException) -> None:
        """Lays the files of a failed step in the quarantine, then marks them refused.

        Not where the step was done meanwhile, by a process that serves in place of this one.
        """
        self._forget(job)
        if not isinstance(error, ShmError):
            log.error("%s %s failed", *job.key, exc_info=error, extra=_about(job))
        for recording_id in job.recordings:
            if not self.store.waits(recording_id, job.stage, job.tests):
                continue
            recording, now = self.store.recording(recording_id), self.clock()
            reason = reason_document(error, recording, now)
            name, archive = recording.file.file_name, self.workspace.archive
            if archive.holds(recording.file):
                with archive.opened(recording.file) as path:
                    self.workspace.quarantine.put(path, name, reason, sidecar_path(path))
            self.store.refuse(recording_id, reason, now, job.tests, stage=job.stage)
            about = {**_about(job), "recording": recording_id, "file": name}
            why = (reason["message"], reason["remedy"])
            log.warning("%s is refused: %s %s", name, *why, extra=about)

    def _put_off(self, delivery: Delivery, error: BaseException) -> None:
        """A delivery that failed is tried again, ever later, until it has failed too often.

        One that the hook refused is given up at once.
        """
        settings, now = self.workspace.settings, self.clock()
        wait_s = settings.hook_backoff_seconds * 2.0**delivery.attempts
        refused = isinstance(error, DeliveryRefused)
        again = not refused and delivery.attempts + 1 < settings.hook_attempts
        next_attempt_at = now + timedelta(seconds=min(wait_s, _LONGEST_S)) if again else None
        self.store.delivery_failed(delivery, str(error), now, next_attempt_at)
        about = {**_about_alert(delivery.alert), "hook": delivery.hook}
        log.warning(
            "hook %s failed on %s: %s", delivery.hook, delivery.alert.key, error, extra=about
        )


def _about(job: Job) -> dict[str, object]:
    """What a job is about, for those who look for it in the log."""
    if job.delivery is not None:
        about = _about_alert(job.delivery.alert)
        return {**about, "hook": job.delivery.hook, "stage": job.key[0]}
    named = {"recording": job.recordings, "hanger": (job.hanger,), "test": job.names}
    single = {key: ids[0] for key, ids in named.items() if len(ids) == 1 and ids[0] is not None}
    return {**single, "stage": job.key[0]}


def _about_alert(alert: Alert) -> dict[str, object]:
    return {"alert": alert.key, "hanger": alert.hanger, "test": alert.test}
