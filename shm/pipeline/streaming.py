"""Streams of permanent sensors brought forward: windows, readings, what the watch says of them.

Ten minutes are read as soon as they have come, each stream in order and apart from the others; an
hour, six hours and a day are pooled once their windows are done. Where windows came late, theirs
are pooled anew, and the watch goes back to before them. What computes runs on the executor. A
window and how far its stream has come are one transaction, and so are a reading, the watch's state
after it and its alert: this may be killed at any instant and simply goes on.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from shm.errors import BadInput, ShmError, StoreError
from shm.pipeline import Clock, utc_now
from shm.pipeline.reconcile import Condition, is_reported, reconcile
from shm.pipeline.stream_days import RestOfDays, baseline_of, hand_on_day
from shm.pipeline.stream_health import (
    evaluate_silent_streams,
    lateness_limit,
    list_unread,
    note_blindness,
)
from shm.store import Reconciled, Store, Workspace
from shm.store.archive import do_nothing
from shm.store.ring import ring_of
from shm.store.streams import (
    find_first_unpooled,
    find_first_window,
    find_pooled_range,
    find_progress,
    list_latest_with_modes,
    list_pooled,
    list_stream_events,
    list_windows,
    load_stream_watch,
)
from shm.values import Mode, Plane
from shm.values.stream import (
    PERIOD,
    PERIODS,
    Period,
    Stream,
    StreamEvent,
    Window,
    WindowReading,
    period_start,
)
from shm.watch.sensors.stream_watch import gone_back

if TYPE_CHECKING:
    from shm.pipeline.stream_steps import Pooled, WindowFound

WINDOW = PERIOD  # what is sealed as one is read as one
"""Long enough that a mode at 5 Hz of 0.1 % damping is known to 2e-4 (S. K. Au, 2014)."""
_RETAINED_BEFORE_ALERT = timedelta(hours=24)
"""Of raw samples, for good: what changed within a day is told within a day."""
_AGAIN = timedelta(minutes=1)  # judgement: a machine without memory or disk is given a minute
_WHOLE = 0.98  # judgement: of ten minutes; a chunk that lacks seconds is not waited for
_PATIENCE = timedelta(minutes=20)  # judgement: a logger that sends each quarter of an hour
_CHECK_EVERY = timedelta(minutes=10)  # technical: silences are told by the day
_LOOKED_BACK = timedelta(days=10)
"""Judgement: for what was noticed as a change began; what is told later is a slow one."""

_OVER = "the sensors do not show it any more"
_EVER = datetime.min.replace(tzinfo=UTC)

log = logging.getLogger(__name__)


Work = Generator[Callable[[], Any], Any, None]
"""Work on a stream: yields what is to be computed elsewhere, is sent the result and stores it."""


@dataclass
class _Course:
    """Hold how far a stream has come by the store; read again after whatever went wrong.

    Ten minutes from `waiting` on are to be read, those before `done` came late; `pooled` is up to
    when each period is pooled, `changed` the first late window since. The watch has gone over
    hours before `settled` already.
    """

    done: datetime | None
    waiting: set[datetime]
    changed: datetime | None
    pooled: dict[Period, datetime] = field(default_factory=dict)
    settled: datetime = _EVER


class Streaming:
    """All streams of a workspace; `lanes` is how many steps may be under way at once.

    Use it while holding the workspace's lock.
    """

    def __init__(
        self,
        workspace: Workspace,
        store: Store,
        executor: Executor,
        *,
        clock: Clock = utc_now,
        lanes: int = 1,
        wake: Callable[[], object] = do_nothing,
    ):
        self.store, self.executor, self.clock = store, executor, clock
        self.lanes, self.wake = lanes, wake
        self._running: dict[str, tuple[Work, Future[Any]]] = {}
        self._courses: dict[str, _Course] = {}
        self._not_before: dict[str, datetime] = {}
        self._news: SimpleQueue[tuple[str, datetime]] = SimpleQueue()
        self._first, self._look_at, self._rest = 0, _EVER, RestOfDays(clock)
        self.use(workspace)

    def use(self, workspace: Workspace) -> None:
        """Goes on with another description of the bridge."""
        self.workspace = workspace
        self.ring = ring_of(workspace, self.clock, self.store.streams.save_event)

    def note_sealed(self, sealed: Sequence[tuple[str, datetime]]) -> None:
        """There are new samples of these streams and ten minutes; from any thread."""
        for each in sealed:
            self._news.put(each)
        self.wake()

    def close(self) -> None:
        """Abandons what is under way: the store still says that it waits."""
        for _, future in self._running.values():
            future.cancel()

    @property
    def under_way(self) -> tuple[Future[Any], ...]:
        """Return what is being computed now."""
        return tuple(future for _, future in self._running.values())

    def advance(self, *, hurry: bool = False) -> bool:
        """Keeps what is finished, begins what has come; whether anything is under way. With `hurry`
        no rest of a day is waited for. Raises StoreError where the store cannot be used now."""
        self._rest.hurry = hurry
        for name, (work, future) in list(self._running.items()):
            if future.done():
                del self._running[name]
                self._finish(name, work, future)
        streams = self.workspace.bridge.streams
        named = {stream.name: stream for stream in streams}
        while not self._news.empty():
            name, start = self._news.get()
            if name in named:
                self._course_of(named[name]).waiting.add(start)
        # Each turn begins with another, or the first would keep all lanes while they catch up.
        for stream in (*streams[self._first :], *streams[: self._first]):
            if len(self._running) >= self.lanes:
                break
            is_due = self.clock() >= self._not_before.get(stream.name, _EVER)
            if stream.name in self._running or not is_due:
                continue
            try:
                self._begin(stream)
            except (ShmError, BrokenExecutor):
                self._courses.pop(stream.name, None)  # what was to be read is looked for again
                raise
            except Exception:  # what one stream holds must not stop the others
                log.exception("stream %s cannot begin its next step", stream.name)
                self._retry_later(stream.name)
        self._first = (self._first + 1) % max(1, len(streams))
        if (now := self.clock()) >= self._look_at:
            self._look_at = now + _CHECK_EVERY
            evaluate_silent_streams(self.workspace, self.store, now)
        return bool(self._running)

    def _begin(self, stream: Stream) -> None:
        """Begin the next step of a stream, if there is one: pools come before further windows."""
        work = self._next_work(stream)
        if work is not None:
            future = self.executor.submit(next(work))
            self._running[stream.name] = work, future
            future.add_done_callback(lambda _: self.wake())

    def _next_work(self, stream: Stream) -> Work | None:
        course = self._course_of(stream)
        if course.done is not None:
            if (
                course.changed is not None
                and min(course.waiting, default=course.done) >= course.done
            ):
                self._go_back(stream, course, course.changed)
                course.changed = None
            for period in PERIODS:
                start = self._next_pool(stream, course, period, course.done)
                if start is not None:
                    return self._pool(stream, period, start)
        start = self._next_window(stream.name, course)
        return None if start is None else self._read(stream, start)

    def _course_of(self, stream: Stream) -> _Course:
        """Return how far a stream has come, what came since, and what came late."""
        name, store, now = stream.name, self.store, self.clock()
        if name in self._courses:
            return self._courses[name]
        changed = find_first_unpooled(store, name, lateness_limit(self.workspace, now))
        unread = set(list_unread(self.workspace, self.ring, store, name, now))
        course = _Course(find_progress(store, name), unread, changed)
        hours, watched = find_pooled_range(store, name, "hour"), self._watched_until(stream)
        if hours is not None and watched is not None and watched <= hours[1]:
            course.pooled["hour"] = watched
            course.settled = hours[1] + PERIODS["hour"]
        self._courses[name] = course
        return course

    def _go_back(self, stream: Stream, course: _Course, changed: datetime) -> None:
        """Pool again from the earliest window on that came late.

        The watch goes on from how it was before them; further back than its states are kept, they
        are pooled and not watched.
        """
        starts = {each: period_start(changed, length) for each, length in PERIODS.items()}
        newest = load_stream_watch(self.store, stream.hanger)
        before = load_stream_watch(self.store, stream.hanger, starts["hour"])
        if newest and before and starts["hour"] < newest.reading_time:
            with suppress(BadInput):  # states of before an upgrade cannot be read
                content = gone_back(before.content, newest.content)
                self.store.streams.go_back(stream.hanger, before.reading_time, content)
                starts["hour"] = before.reading_time
                course.settled = max(newest.reading_time, course.settled)
        for period, start in starts.items():
            course.pooled[period] = min(course.pooled.get(period, start), start)

    def _watched_until(self, stream: Stream) -> datetime | None:
        watch = load_stream_watch(self.store, stream.hanger)
        return None if watch is None else watch.reading_time

    # ------------------------------------------------------------ windows

    def _next_window(self, name: str, course: _Course) -> datetime | None:
        """Return the next ten minutes that are whole, or not waited for any more; late ones last.

        Those that were read before, of which there is more now, are late ones, too.
        """
        new = sorted(each for each in course.waiting if each >= (course.done or _EVER))
        is_ready = len(new) > 1 or bool(new and self._is_whole(name, new[0]))
        start = new[0] if is_ready else min(course.waiting.difference(new), default=None)
        course.waiting.discard(start or _EVER)
        return start

    def _is_whole(self, name: str, start: datetime) -> bool:
        if self.clock() >= start + WINDOW + _PATIENCE:
            return True
        received = self.ring.received(name, start).get(start)
        return received is not None and received.received_s >= _WHOLE * WINDOW.total_seconds()

    def _read(self, stream: Stream, start: datetime) -> Work:
        from shm.pipeline.steps import identify_options
        from shm.pipeline.stream_steps import read_stream_window

        hanger = self.workspace.bridge.tested(stream.hanger)
        options = identify_options(self.workspace.settings, self.workspace.bridge)
        known = list_latest_with_modes(self.store, stream.name)
        step = partial(
            read_stream_window,
            self.ring.read(stream.name, start, start + WINDOW),
            stream,
            last_modes(known),
            hanger,
            options,
            any(each.how == "tracked" for each in known),
        )
        try:
            found: WindowFound = yield step
            for event in found.events:
                self.store.streams.save_event(event)
            self._save(found.reading)
            if found.lacks_modes or not found.reading.modes:
                note_blindness(self.store, stream, start)
        except Exception as error:
            if _is_passing(error):
                raise
            _log_failure(stream, error)
            # In the window's own row: what one window holds must not stop its stream.
            seconds, nan = WINDOW.total_seconds(), float("nan")
            window = Window(stream.name, stream.hanger, start, seconds, "unusable", nan)
            self._save(WindowReading(window, (), "none", f"it could not be read: {error}"))

    def _save(self, reading: WindowReading) -> None:
        start, course = reading.window.start, self._courses[reading.window.stream]
        self.store.streams.save_window(reading)
        done = course.done or _EVER
        self._rest.note(reading.window.stream, start, done)
        if start < done:
            course.changed = min(start, course.changed or start)
        course.done = max(done, start + WINDOW)

    def _windows(
        self, stream: Stream, start: datetime, length: timedelta
    ) -> tuple[WindowReading, ...]:
        found = list_windows(self.store, stream.hanger, start, start + length)
        return tuple(each for each in found if each.window.stream == stream.name)

    # ------------------------------------------------------------ pools

    def _next_pool(
        self, stream: Stream, course: _Course, period: Period, done: datetime
    ) -> datetime | None:
        """Return the next period that is over and has windows; those without are passed over."""
        length = PERIODS[period]
        start = course.pooled.get(period) or self._pooled_until(stream, period, length)
        if start is None:
            return None
        while start + length <= done:
            if period == "day" and self._rest.is_awaited(self.store, stream.name, start):
                return None
            if self._is_due(stream, period, start):
                break
            start += length
        course.pooled[period] = start
        return start if start + length <= done else None

    def _is_due(self, stream: Stream, period: Period, start: datetime) -> bool:
        """Return True if it has windows and is not pooled, or is an hour yet to be watched."""
        end = start + PERIODS[period]
        known = list_pooled(self.store, stream.hanger, period, start, end)
        if any(each.stream == stream.name for each in known):
            watched = self._watched_until(stream)
            if period != "hour" or watched is None or start < watched:
                return False
        return bool(self._windows(stream, start, PERIODS[period]))

    def _pooled_until(self, stream: Stream, period: Period, length: timedelta) -> datetime | None:
        """Return the end of the last reading of a period; else the first window's period."""
        pooled = find_pooled_range(self.store, stream.name, period)
        if pooled is not None:
            return pooled[1] + length
        first = find_first_window(self.store, stream.name)
        return None if first is None else period_start(first, length)

    def _pool(self, stream: Stream, period: Period, start: datetime) -> Work:
        from shm.pipeline.stream_steps import pool_stream

        store, length = self.store, PERIODS[period]
        watch = load_stream_watch(store, stream.hanger)
        recent: tuple[StreamEvent, ...] = ()
        if period == "hour":
            recent = list_stream_events(store, stream.name, start - _LOOKED_BACK)
        step = partial(
            pool_stream,
            self._windows(stream, start, length),
            period,
            start,
            self.workspace.bridge.tested(stream.hanger),
            baseline_of(store, stream),
            None if watch is None else watch.content,
            self.workspace.settings.false_call_years,
            recent,
            is_watched=period == "hour" and (watch is None or start >= watch.reading_time),
        )
        try:
            found: Pooled = yield step
            self._store_pooled(stream, start + length, found)
        except Exception as error:
            if _is_passing(error):
                raise
            _log_failure(stream, error)
        self._courses[stream.name].pooled[period] = start + length

    def _store_pooled(self, stream: Stream, end: datetime, found: Pooled) -> None:
        for event in found.events:
            self.store.streams.save_event(event)
        if found.reading is None:
            return
        if found.test is not None:
            hand_on_day(self.workspace, self.store, found.test, self.clock())
        if found.alert is not None:
            why = f"alert {found.alert.key}"
            self.ring.keep(stream.name, end - _RETAINED_BEFORE_ALERT, end, why)
        hooks = [hook.name for hook in self.workspace.bridge.hooks]
        is_again = end <= self._courses[stream.name].settled
        changes = self._reconciled(stream.hanger, found, is_again=is_again)
        state = found.state or None
        for raised in self.store.streams.save_pooled(
            found.reading, state, changes, hooks, self.clock()
        ):
            log.warning("alert %s: %s", raised.alert.key, raised.alert.message)

    def _reconciled(self, hanger: int, found: Pooled, *, is_again: bool) -> Reconciled:
        """Return which alerts an hour opens and closes; where hours are gone over again, none that
        they have raised before others of them came late."""
        if found.alert is None and not found.ended:
            return Reconciled()
        alerts = self.store.alerts.list_all(hanger)
        is_open = [each for each in alerts if each.resolution is None]
        over = [each.alert for each in is_open if each.alert.key in found.ended]
        conditions = [Condition(each, "over", _OVER) for each in over]
        past = [each.alert for each in alerts if is_again and each.baseline_id is None]
        if found.alert and not is_reported(found.alert, past):
            conditions.append(Condition(found.alert, "holds"))
        return reconcile(is_open, conditions)

    # ------------------------------------------------------------ finish

    def _finish(self, name: str, work: Work, future: Future[Any]) -> None:
        """Send work its result, or the error that its computation ended with.

        Raises StoreError where the store cannot be used now: the store still says that it waits.
        """
        try:
            with suppress(StopIteration):
                if (error := future.exception()) is None:
                    work.send(future.result())
                else:
                    work.throw(error)
        except StoreError:
            self._courses.pop(name, None)
            raise
        except Exception as error:  # noqa: BLE001 - it must stop neither stream nor files
            self._retry_later(name)
            log.warning("stream %s is tried again in a minute: %s", name, error)

    def _retry_later(self, name: str) -> None:
        """Leave a stream alone for a minute, then look for its unread windows again."""
        self._not_before[name] = self.clock() + _AGAIN
        self._courses.pop(name, None)


def _is_passing(error: Exception) -> bool:
    """Return True if the same step may do later what it could not do now."""
    of_machine = isinstance(error, BrokenExecutor | MemoryError | StoreError)
    return of_machine or bool(getattr(error, "retry_after_s", None))


def _log_failure(stream: Stream, error: Exception) -> None:
    unexpected = None if isinstance(error, ShmError) else error
    log.error("stream %s: a step failed: %s", stream.name, error, exc_info=unexpected)


def last_modes(readings: Sequence[WindowReading]) -> tuple[Mode, ...]:
    """Return the modes of windows, the last first, each as it was seen last.

    A mode that one window hides is looked for again in the next.
    """
    found: dict[tuple[Plane, int], Mode] = {}
    for reading in readings:
        for mode in reading.modes:
            found.setdefault((mode.plane, mode.order), mode)
    return tuple(sorted(found.values(), key=lambda mode: mode.frequency_hz))
