"""The flow takes files in and works on them: begins what waits, stores results, refuses what fails.

What is computed runs on the executor; only this process uses the store. A result and the mark that
it is done are one transaction, and what waits is asked of the store each time: the flow may be
killed at any instant and simply goes on.
"""

from __future__ import annotations

import errno
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from shm.errors import DISK_FULL, ShmError, StoreDamaged, StoreError, WorkerDied
from shm.pipeline import Clock, utc_now
from shm.pipeline.courier import Courier, Notifier, alert_fields
from shm.pipeline.faults import contained, explain_refusal
from shm.pipeline.intake import receive
from shm.pipeline.limits import evaluate_limit_alerts
from shm.pipeline.lineage import competing
from shm.pipeline.watching import judge_again
from shm.pipeline.work import Queue, Task, Work
from shm.read import sidecar_path
from shm.store import Outcome, Receipt, Store, StoredAlert, Workspace
from shm.store.archive import ProgressCallback, do_nothing
from shm.store.journal import list_events
from shm.store.recordings import count_deaths, is_waiting
from shm.store.watch import list_selected_models

_MOST_DEATHS = 6
"""A recording is refused when so many processes died at it, whoever ended them."""
_FIRST_PAUSE_S, _PAUSE_GROWS = 2.0, 4
"""2, 8, 32, 128, 512 s: who kills for less than eleven minutes has no file refused."""
_LONGEST_PAUSE_S = 86400.0  # judgement: what stands still for a day, somebody has looked at
_AGAIN_S = 60.0
_OF_THE_MACHINE = (*DISK_FULL, errno.EROFS, errno.EIO, errno.ENFILE)
"""What a step meets that is no fault of its recording, and passes when somebody sees to it."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Running:
    """A task under way; its work waits to be sent the result, or is to be begun again for that.

    `alone`: nothing else is computed meanwhile, since a process died at it before.
    """

    task: Task
    work: Work | None
    future: Future[Any]
    alone: bool


class Flow:
    """Takes files in and brings them through all stages.

    `lanes` is how many steps may be under way at once; without a `notifier` alerts wait in the
    outbox; `wake` is called, from any thread, whenever something under way has ended; `on_progress`
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
        wake: Callable[[], object] = do_nothing,
        on_progress: ProgressCallback = do_nothing,
    ):
        self.store, self.executor, self.clock, self.lanes = store, executor, clock, lanes
        self.wake, self.on_progress = wake, on_progress
        self._courier = Courier(store, notifier, clock, wake)
        self._running: dict[tuple[str, int], _Running] = {}
        self._stopped: dict[int, datetime] = {}  # hangers, and until when
        self.delays: dict[int, str] = {}
        """Why recordings wait that something outside keeps from being worked on, by number."""
        deaths = count_deaths(store)
        self._suspects = set(deaths)
        self._postponed = {key: each.last_at + _pause(each.count) for key, each in deaths.items()}
        self.use(workspace)
        workspace.archive.sweep()

    def use(self, workspace: Workspace) -> None:
        """Goes on with another description of the bridge; raises UsageError where it is wrong."""
        selected = list_selected_models(self.store)
        for hanger in workspace.bridge.hangers:
            competing(hanger, workspace.settings, {})
            if hanger.id in selected:
                competing(hanger, workspace.settings, selected)
        self.workspace = workspace
        self._to_judge_again = list(workspace.bridge.watched)
        self._queue = Queue(workspace, self.store, self.clock)

    def close(self) -> None:
        """Abandons what is under way; the store still says that it waits."""
        for running in self._running.values():
            running.future.cancel()
        self._courier.close()

    def receive(self, path: Path) -> Receipt:
        """Takes a whole file in; see `shm.pipeline.intake`."""
        receipt = receive(path, self.workspace, self.store, self.clock(), self.on_progress)
        recording = receipt.recording
        name = recording.file.file_name
        fields = {"recording": recording.id, "file": name, "stage": "received"}
        known_as = f", known as {name}" if Path(name).name != path.name else ""
        log.info("%s: %s%s", path.name, receipt.outcome, known_as, extra=fields)
        return receipt

    def drain(self, after_each: Callable[[], object] = lambda: None) -> None:
        """Works until nothing waits that could be done now; calls `after_each` on the way."""
        while self.advance() or self.advance(hurry=True):
            after_each()
            wait(self.under_way, return_when=FIRST_COMPLETED)

    @property
    def under_way(self) -> list[Future[Any]]:
        """Return what is being computed, and sent to hooks."""
        computed = [running.future for running in self._running.values()]
        return [*computed, *self._courier.under_way]

    def advance(self, *, hurry: bool = False) -> bool:
        """Store what is finished, begin what waits; return True if anything is under way.

        With `hurry` alerts are not held for similar ones: who calls is about to end.
        """
        for key, running in list(self._running.items()):
            if running.future.done():
                self._finish(running)
                del self._running[key]
        try:
            self._courier.store_outcomes(self.workspace.settings)
            self._courier.begin(self.workspace, hurry=hurry)
        finally:  # an alert that cannot be sent must not keep files from being worked on
            self._begin_tasks()
        return bool(self.under_way)

    def suspects_due_s(self) -> float | None:
        """Return the seconds until a recording whose process died is tried again.

        None without one.
        """
        times = [self._postponed[key] for key in self._suspects if key in self._postponed]
        return max(0.0, (min(times) - self.clock()).total_seconds()) if times else None

    def _begin_tasks(self) -> None:
        now = self.clock()
        postponed = {id_ for id_, until in self._postponed.items() if _still_waits(until, now)}
        stopped = {id_ for id_, until in self._stopped.items() if _still_waits(until, now)}
        while self._to_judge_again:
            hanger = self._to_judge_again[0]
            with contained(log, "hanger %d cannot be judged again", hanger.id):
                judge_again(self.workspace, self.store, hanger, now)
                if not hanger.is_control:
                    evaluate_limit_alerts(self.workspace, self.store, [hanger], now)
            self._to_judge_again.pop(0)
        for task in self._queue.list_waiting(2 * self.lanes, postponed):
            if task.hanger in stopped or task.key in self._running:
                continue
            if not self._has_room(task):
                return
            begun = False
            with contained(log, "%s %s cannot begin", *task.key):
                self._begin(task)
                begun = True
            if not begun:
                self._postpone(task)
                if task.hanger is not None:
                    stopped.add(task.hanger)

    def _has_room(self, task: Task) -> bool:
        """Return True if a task may begin now; one whose process died before runs alone."""
        others = [running.task for running in self._running.values()]
        suspect = any(self._is_suspect(each) for each in (*others, task))
        return len(others) < self.lanes and not (others and suspect)

    def _is_suspect(self, task: Task) -> bool:
        return not self._suspects.isdisjoint(task.recordings)

    def _begin(self, task: Task) -> None:
        work = task.work()
        future = self.executor.submit(next(work))
        self._running[task.key] = _Running(task, work, future, self._is_suspect(task))
        future.add_done_callback(lambda _: self.wake())

    def _finish(self, running: _Running) -> None:
        """Store the result of a task that has ended, or handle the error that it ended with.

        Raises StoreError where the store cannot be used now: the result is stored at a later turn.
        """
        task, error = running.task, running.future.exception()
        try:
            if error is None:
                self._store_result(running)
                return
        except StoreDamaged:  # what one hanger's rows hold must not stop the others
            log.exception("%s %s cannot be stored", *task.key, extra=task.log_fields)
            self._postpone(task)
            return
        except Exception as fault:  # one file must not stop the others
            if isinstance(fault, StoreError) and fault.retry_after_s is not None:
                self._running[task.key] = replace(running, work=None)
                raise
            error = fault
        try:
            self._handle_error(running, error)
        except ShmError:
            raise
        except Exception:
            log.exception("%s %s: its error cannot be noted", *task.key)
            self._postpone(task)

    def _store_result(self, running: _Running) -> None:
        task, work = running.task, running.work
        if work is None:
            work = task.work()
            next(work)
        stored = _end(work, running.future.result())
        for alert in (each.alert for each in stored or ()):
            log.warning("alert %s: %s", alert.key, alert.message, extra=alert_fields(alert))
        log.info("%s %d: done", *task.key, extra=task.log_fields)
        self._forget(task)

    def _handle_error(self, running: _Running, error: BaseException) -> None:
        task = running.task
        if isinstance(error, BrokenExecutor | WorkerDied | MemoryError):
            self._note_death(running, error)
        elif (wait_s := _passes_in_s(error)) is not None:
            until = self.clock() + timedelta(seconds=wait_s)
            self._postponed.update(dict.fromkeys(task.recordings, until))
            names = ", ".join(map(str, task.recordings))
            self.delays |= dict.fromkeys(task.recordings, f"recording {names} waits: {error}")
            text = "%s %s is tried again in %.0f s: %s"
            log.warning(text, *task.key, wait_s, error, extra=task.log_fields)
        else:
            self._refuse(task, error)

    def _postpone(self, task: Task) -> None:
        until = self.clock() + timedelta(seconds=_AGAIN_S)
        if task.hanger is None:
            self._postponed.update(dict.fromkeys(task.recordings, until))
        else:
            self._stopped[task.hanger] = until

    def _forget(self, task: Task) -> None:
        """Drop earlier troubles of a task that has come to an end."""
        for recording_id in task.recordings:
            self._suspects.discard(recording_id)
            self._postponed.pop(recording_id, None)
            self.delays.pop(recording_id, None)

    def _note_death(self, running: _Running, error: BaseException) -> None:
        """Count a process that died: by what it worked on, or ended by somebody.

        The recording is tried again, with nothing else beside it, after ever longer pauses; the
        store keeps account. Of several recordings at once none is refused, for it cannot be said
        which it was. A step that lacks memory even alone is refused at once.
        """
        task, now, how = running.task, self.clock(), _how_it_died(error)
        log.warning("%s %s: %s", *task.key, how, extra=task.log_fields)
        for recording_id in task.recordings:
            self.store.recordings.note_death(recording_id, how, now)
        known = count_deaths(self.store)
        most = max(known[key].count if key in known else 1 for key in task.recordings)
        lacks_memory = running.alone and isinstance(error, MemoryError)
        if len(task.recordings) == 1 and (lacks_memory or most >= _MOST_DEATHS):
            self._refuse(task, _refusal(most, how))
            return
        self._suspects.update(task.recordings)
        again_at = now + _pause(most)
        self._postponed.update(dict.fromkeys(task.recordings, again_at))

    def _refuse(self, task: Task, error: BaseException) -> None:
        """Put the files of a failed task into the quarantine, then mark them refused.

        Not where the task was done meanwhile, by a process that serves in place of this one.
        """
        self._forget(task)
        if not isinstance(error, ShmError):
            log.error("%s %s failed", *task.key, exc_info=error, extra=task.log_fields)
        for recording_id in task.recordings:
            if is_waiting(self.store, recording_id, task.stage, task.tests):
                self._refuse_recording(task, recording_id, error)

    def _refuse_recording(self, task: Task, recording_id: int, error: BaseException) -> None:
        recordings, now = self.store.recordings, self.clock()
        recording = recordings.get(recording_id)
        name = recording.file.file_name
        reason = explain_refusal(error, name, recording.file.sha256, now)
        if list_events(self.store, Outcome.REDESCRIBED, recording_id=recording_id):
            reason["remedy"] += (
                " What it gave with its former sidecar counts no more: correct the sidecar and "
                "drop both again."
            )
        try:
            with self.workspace.archive.opened(recording.file) as path:
                sidecar = sidecar_path(path)
                self.workspace.quarantine.put(path, name, reason, sidecar, self.on_progress)
        except StoreError as damage:
            if damage.retry_after_s is not None:
                raise
            log.error("%s is not laid in the quarantine: %s", name, damage)
        recordings.refuse(recording_id, reason, now, task.tests, stage=task.stage)
        fields = {**task.log_fields, "recording": recording_id, "file": name}
        log.warning("%s is refused: %s %s", name, reason["message"], reason["remedy"], extra=fields)


def _end(work: Work, result: object) -> Sequence[StoredAlert] | None:
    """Return the alerts that work has raised once it is sent the result of its computation."""
    try:
        work.send(result)
    except StopIteration as end:
        raised: Sequence[StoredAlert] | None = end.value
        return raised
    raise AssertionError("work computes once")


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


def _pause(deaths: int) -> timedelta:
    """Return the wait before the next try: the longer, the more have failed."""
    seconds = _FIRST_PAUSE_S * _PAUSE_GROWS ** (deaths - 1)
    return timedelta(seconds=min(seconds, _LONGEST_PAUSE_S))


def _refusal(deaths: int, how: str) -> ShmError:
    """Return why a recording is given up of which processes died."""
    return ShmError(
        f"{how.removesuffix('.')}; so it went {deaths} times in a row.",
        remedy="The file is damaged, too large or made to harm: export it again from its source, "
        "or split it. Or somebody kills the processes, as an operator or a guard of the memory "
        "(`journalctl -k`, earlyoom): find out who, then drop the file again.",
    )
