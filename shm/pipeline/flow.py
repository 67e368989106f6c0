"""The loop's body: keep what is finished, begin what waits, refuse what fails.

Steps run on the executor; only this process touches the store. A step's result and the mark that
it is done are one transaction, and what waits is asked of the store each time: the flow may be
killed at any instant and simply goes on.
"""

from __future__ import annotations

import errno
import logging
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
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from shm.errors import DISK_FULL, ShmError, StoreDamaged, StoreError, WorkerDied
from shm.pipeline import Clock, utc_now
from shm.pipeline.intake import Sharing, receive
from shm.pipeline.jobs import DELIVERIES, DeliveryRefused, Job, Jobs, Notifier, Step, wait_after
from shm.pipeline.limits import heed_limits
from shm.pipeline.lineage import competing, reason_document
from shm.pipeline.watching import JudgedAgain
from shm.read import sidecar_path
from shm.store import Death, Deaths, Delivery, Outcome, Receipt, Store, StoredAlert, Workspace
from shm.store.archive import Meanwhile, nothing
from shm.values import Alert

_MOST_DEATHS, _MOST_KILLS = 3, 5
"""A recording is refused when so many processes died of it, or were killed at it alone in a row."""
_FIRST_PAUSE_S, _PAUSE_GROWS = 2.0, 4
"""2, 8, 32, 128, 512 s: who kills for less than eleven minutes has no file refused."""
_LONGEST_PAUSE_S = 86400.0  # judgement: what stands still for a day, somebody has looked at
_AGAIN_S = 60.0
_OF_THE_MACHINE = (*DISK_FULL, errno.EROFS, errno.EIO, errno.ENFILE)
"""What a step meets that is no fault of its recording, and passes when somebody sees to it."""

_NO_MORE = (
    " What it gave with its former sidecar counts no more: correct the sidecar and drop both again."
)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Running:
    """A job under way."""

    job: Job
    step: Step
    future: Future[Any]
    alone: bool = False


@runtime_checkable
class BeginsFresh(Protocol):
    """An executor that can run a step in a process which does nothing else, before or after."""

    def submit_fresh(self, fn: Callable[[], Any], /) -> Future[Any]: ...


class Flow:
    """Takes files in and brings them through all stages.

    `lanes` is how many steps may be under way at once; without a `notifier` alerts wait in the
    outbox; `wake` is called, from any thread, whenever something under way has ended; `meanwhile`
    again and again while a file is copied. Use a flow while holding the workspace's lock.
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
        wake: Callable[[], object] = nothing,
        meanwhile: Meanwhile = nothing,
    ):
        self.store, self.executor, self.clock, self.lanes = store, executor, clock, lanes
        self.notifier, self.wake, self.meanwhile = notifier, wake, meanwhile
        self._running: dict[tuple[str, int], Running] = {}
        self._couriers = ThreadPoolExecutor(DELIVERIES, thread_name_prefix="hook")
        self._damaged: dict[int, datetime] = {}  # hangers that stand still, and until when
        self.delays: dict[int, str] = {}
        """Why recordings wait that something outside keeps from being worked on, by number."""
        deaths = store.recordings.deaths()
        self._suspects = set(deaths)
        self._postponed = {key: each.last_at + _pause(each) for key, each in deaths.items()}
        self.use(workspace)
        workspace.archive.sweep()

    def use(self, workspace: Workspace) -> None:
        """Goes on with another description of the bridge; raises UsageError where it is wrong."""
        selected = self.store.posteriors.selected_models()
        for hanger in workspace.bridge.hangers:
            competing(hanger, workspace.settings, {})
            if hanger.id in selected:
                competing(hanger, workspace.settings, selected)
        self.workspace = workspace
        self._judged_again = JudgedAgain(workspace, self.store)
        heed_limits(workspace, self.store, workspace.bridge.hangers, self.clock())
        self.jobs = Jobs(workspace, self.store, self.clock)

    def close(self) -> None:
        """Abandons what is under way; the store still says that it waits."""
        for running in self._running.values():
            running.future.cancel()
        self._couriers.shutdown(wait=False, cancel_futures=True)

    def receive(self, path: Path, sharing: Sharing | None = None) -> Receipt:
        """Takes a whole file in; see `shm.pipeline.intake`."""
        now = self.clock()
        receipt = receive(path, self.workspace, self.store, now, sharing, self.meanwhile)
        recording = receipt.recording
        about = {"recording": recording.id, "file": recording.file.file_name, "stage": "received"}
        first = recording.file.file_name
        came_as = f", known as {first}" if Path(first).name != path.name else ""
        log.info("%s: %s%s", path.name, receipt.outcome, came_as, extra=about)
        return receipt

    def drain(self, after_each: Callable[[], object] = lambda: None) -> None:
        """Works until nothing waits that could be done now; calls `after_each` on the way."""
        while self.advance() or self.advance(hurry=True):
            after_each()
            under_way = [running.future for running in self._running.values()]
            wait(under_way, return_when=FIRST_COMPLETED)

    def advance(self, *, hurry: bool = False) -> bool:
        """Keeps what is finished, begins what waits; whether anything is under way.

        With `hurry` alerts are not held for alike ones: who calls is about to end.
        """
        for key, running in list(self._running.items()):
            if running.future.done():
                self._finish(running)
                del self._running[key]
        try:
            self._begin_deliveries(hurry)
        finally:  # an alert that cannot be sent must not keep files from being worked on
            self._begin_steps()
        return bool(self._running)

    def suspects_due_s(self) -> float | None:
        """How long until a recording is tried again whose process died; None without such."""
        times = [self._postponed[key] for key in self._suspects if key in self._postponed]
        if not times:
            return None
        return max(0.0, (min(times) - self.clock()).total_seconds())

    # ------------------------------------------------------------ begin

    def _begin_deliveries(self, hurry: bool) -> None:
        if self.notifier is not None:
            self.jobs.begin_messages(hurry=hurry)
            under_way = [run.job.delivery for run in self._running.values() if run.job.delivery]
            for job in self.jobs.owed(self.notifier, under_way):
                self._begin(job, self._couriers)

    def _begin_steps(self) -> None:
        now = self.clock()
        held = {id_ for id_, until in self._postponed.items() if _still_waits(until, now)}
        damaged: set[int | None] = {
            hanger for hanger, until in self._damaged.items() if _still_waits(until, now)
        }
        self._judged_again.go_on(now, held, damaged)
        for job in self.jobs.waiting(2 * self.lanes, held):
            if job.hanger in damaged or job.key in self._running:
                continue
            if not self._has_room(job):
                return
            try:
                self._begin(job, self.executor)
            except Exception as error:  # what one hanger's rows hold must not stop the others
                if isinstance(error, ShmError | BrokenExecutor) and not isinstance(
                    error, StoreDamaged
                ):
                    raise
                log.exception("%s %s cannot begin", *job.key, extra=_about(job))
                self._hold(job)
                damaged |= {job.hanger} - {None}

    def _has_room(self, job: Job) -> bool:
        """Whether a step may begin now; one whose process died before runs alone."""
        steps = [running.job for running in self._running.values() if not running.job.delivery]
        suspects = any(self._is_suspect(each) for each in (*steps, job))
        return len(steps) < self.lanes and not (steps and suspects)

    def _is_suspect(self, job: Job) -> bool:
        return not self._suspects.isdisjoint(job.recordings)

    def _begin(self, job: Job, executor: Executor) -> None:
        step, alone = job.prepare(), self._is_suspect(job)
        if alone and isinstance(executor, BeginsFresh):
            future = executor.submit_fresh(step.run)
        else:
            future = executor.submit(step.run)
        self._running[job.key] = Running(job, step, future, alone)
        future.add_done_callback(lambda _: self.wake())

    # ------------------------------------------------------------ finish

    def _finish(self, running: Running) -> None:
        """Store the result of a step that has ended, or handle the error that it ended with.

        Raises StoreError where the store cannot be used now: the result is stored at a later turn.
        """
        error = running.future.exception()
        try:
            if error is None:
                self._keep(running)
                return
        except StoreError as refusal:
            if refusal.retry_after_s is not None:
                raise
            error = refusal
        except Exception as fault:  # noqa: BLE001 - one file must not stop the others
            error = fault
        try:
            self._handle_error(running, error)
        except ShmError:
            raise
        except Exception:
            log.exception("%s %s: its error cannot be noted", *running.job.key)
            self._hold(running.job)

    def _keep(self, running: Running) -> None:
        kept = running.step.keep(running.future.result())
        if isinstance(kept, StoredAlert):
            about = _about_alert(kept.alert)
            log.warning("alert %s: %s", kept.alert.key, kept.alert.message, extra=about)
        log.info("%s %d: done", *running.job.key, extra=_about(running.job))
        self._forget(running.job)

    def _handle_error(self, running: Running, error: BaseException) -> None:
        job = running.job
        if job.delivery is not None:
            self._put_off(job.delivery, job.message or job.delivery.alert, error)
        elif isinstance(error, BrokenExecutor | WorkerDied | MemoryError):
            self._note_death(running, error)
        elif (wait_s := _passes_in_s(error)) is not None:
            until = self.clock() + timedelta(seconds=wait_s)
            self._postponed.update(dict.fromkeys(job.recordings, until))
            names = ", ".join(map(str, job.recordings))
            self.delays |= dict.fromkeys(job.recordings, f"recording {names} waits: {error}")
            said = "%s %s is tried again in %.0f s: %s"
            log.warning(said, *job.key, wait_s, error, extra=_about(job))
        else:
            self._refuse(job, error)

    def _hold(self, job: Job) -> None:
        until = self.clock() + timedelta(seconds=_AGAIN_S)
        if job.hanger is None:
            self._postponed.update(dict.fromkeys(job.recordings, until))
        else:
            self._damaged[job.hanger] = until

    def _forget(self, job: Job) -> None:
        """Earlier troubles of a job that has come to an end count no more."""
        for recording_id in job.recordings:
            self._suspects.discard(recording_id)
            self._postponed.pop(recording_id, None)
            self.delays.pop(recording_id, None)

    def _note_death(self, running: Running, error: BaseException) -> None:
        """A process died: of what it worked on, of a neighbour's memory, or somebody killed it.

        Its recording is tried again alone, after ever longer pauses, and only what happens to it
        then is held against it. The store keeps account. Of several recordings at once none is
        refused, for it cannot be said which it was.
        """
        job, now = running.job, self.clock()
        log.warning("%s %s: %s", *job.key, _how_it_died(error), extra=_about(job))
        outside = isinstance(error, WorkerDied) and error.from_outside
        death = Death.FROM_OUTSIDE if outside else Death.BY_ITSELF
        for recording_id in job.recordings:
            noted = death if running.alone else Death.BESIDE_OTHERS
            self.store.recordings.note_death(recording_id, noted, _how_it_died(error), now)
        known = self.store.recordings.deaths()
        deaths = [known.get(key, Deaths(0, 0, now)) for key in job.recordings]
        if len(deaths) == 1 and _is_enough(deaths[0]):
            self._refuse(job, _refusal(deaths[0], error))
            return
        self._suspects.update(job.recordings)
        again_at = now + max(map(_pause, deaths))
        self._postponed.update(dict.fromkeys(job.recordings, again_at))

    def _refuse(self, job: Job, error: BaseException) -> None:
        """Lays the files of a failed step in the quarantine, then marks them refused.

        Not where the step was done meanwhile, by a process that serves in place of this one.
        """
        self._forget(job)
        if not isinstance(error, ShmError):
            log.error("%s %s failed", *job.key, exc_info=error, extra=_about(job))
        for recording_id in job.recordings:
            if not self.store.recordings.is_waiting(recording_id, job.stage, job.tests):
                continue
            recording, now = self.store.recordings.get(recording_id), self.clock()
            reason = reason_document(error, recording, now)
            if self.store.recordings.list_events(Outcome.REDESCRIBED, recording_id=recording_id):
                reason["remedy"] += _NO_MORE
            name, archive = recording.file.file_name, self.workspace.archive
            try:
                with archive.opened(recording.file) as path:
                    sidecar = sidecar_path(path)
                    self.workspace.quarantine.put(path, name, reason, sidecar, self.meanwhile)
            except StoreError as damage:
                if damage.retry_after_s is not None:
                    raise
                log.error("%s is not laid in the quarantine: %s", name, damage)
            self.store.recordings.refuse(recording_id, reason, now, job.tests, stage=job.stage)
            about = {**_about(job), "recording": recording_id, "file": name}
            why = (reason["message"], reason["remedy"])
            log.warning("%s is refused: %s %s", name, *why, extra=about)

    def _put_off(self, delivery: Delivery, message: Alert, error: BaseException) -> None:
        """A delivery that failed is tried again, ever later, until it has failed too often.

        One that the hook refused is given up at once.
        """
        settings, now = self.workspace.settings, self.clock()
        wait = wait_after(delivery.attempts + 1, settings)
        refused = isinstance(error, DeliveryRefused)
        again = not refused and delivery.attempts + 1 < settings.hook_attempts
        next_attempt_at = now + wait if again else None
        self.store.alerts.save_failure(delivery, str(error), now, next_attempt_at)
        about = {**_about_alert(message), "hook": delivery.hook}
        end = "" if again else "; given up: nobody is told of it by this hook"
        said = "hook %s failed on %s: %s%s"
        log.warning(said, delivery.hook, message.key, error, end, extra=about)


def _still_waits(until: datetime, now: datetime) -> bool:
    """Not beyond the longest pause: there the clock was ahead when it was set, or is late now."""
    return now < until <= now + timedelta(seconds=_LONGEST_PAUSE_S)


def _passes_in_s(error: BaseException) -> float | None:
    """After how long a step may do what it could not; None where trying again is of no use."""
    of_the_machine = isinstance(error, OSError) and error.errno in _OF_THE_MACHINE
    # An installation that is being replaced says nothing against a file.
    if of_the_machine or isinstance(error, ImportError):
        return _AGAIN_S
    return error.retry_after_s if isinstance(error, ShmError) else None


def _how_it_died(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "needs more memory than one step is given on this machine."
    return error.message if isinstance(error, WorkerDied) else "the process that worked on it died."


def _is_enough(deaths: Deaths) -> bool:
    return deaths.by_itself >= _MOST_DEATHS or deaths.from_outside >= _MOST_KILLS


def _pause(deaths: Deaths) -> timedelta:
    """How long to wait before the next try: the longer, the more tries alone have failed."""
    failed = max(deaths.by_itself, deaths.from_outside)
    return timedelta(seconds=min(_FIRST_PAUSE_S * _PAUSE_GROWS**failed, _LONGEST_PAUSE_S))


def _refusal(deaths: Deaths, error: BaseException) -> ShmError:
    """Why a recording is given up of which processes died."""
    how = _how_it_died(error).removesuffix(".")
    if deaths.by_itself >= _MOST_DEATHS:
        return ShmError(
            f"{how}; so it went {deaths.by_itself} times, each time with nothing else at work.",
            remedy="The file is damaged, too large or made to harm: export it anew from its "
            "source, or split it. If it is sound, report this with the log.",
        )
    return ShmError(
        f"{how}; so it went {deaths.from_outside} times in a row, and to no other file meanwhile.",
        remedy="Find out who kills it: an operator, or a guard of the memory (`journalctl -k`, "
        "earlyoom). Then drop the file again.",
    )


def _about(job: Job) -> dict[str, object]:
    """What a job is about, for those who look for it in the log."""
    if job.delivery is not None:
        about = _about_alert(job.message or job.delivery.alert)
        return {**about, "hook": job.delivery.hook, "stage": job.key[0]}
    named = {"recording": job.recordings, "hanger": (job.hanger,), "test": job.names}
    single = {key: ids[0] for key, ids in named.items() if len(ids) == 1 and ids[0] is not None}
    return {**single, "stage": job.key[0]}


def _about_alert(alert: Alert) -> dict[str, object]:
    return {"alert": alert.key, "hanger": alert.hanger, "test": alert.test}
