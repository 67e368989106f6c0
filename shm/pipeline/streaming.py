"""Streams of permanent sensors brought forward: windows, readings, what the watch says of them.

Ten minutes are read as soon as they have come, each stream in order and apart from the others; an
hour, six hours and a day are pooled once their windows are done. Where windows came late, theirs
are pooled anew, and the watch goes back to before them. What computes runs on the executor. A
window and how far its stream has come are one transaction, and so are a reading, the watch's state
after it and its alert: this may be killed at any instant and simply goes on.
"""

from __future__ import annotations

import bisect
import logging
from collections import defaultdict, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from shm.errors import BadInput, ShmError, StoreError
from shm.pipeline import Clock, utc_now
from shm.pipeline.reconcile import Condition, is_same_event, reconcile
from shm.pipeline.stream_days import RestOfDays, baseline_of, hand_on_day
from shm.pipeline.stream_health import (
    compare_thermometers,
    evaluate_silent_streams,
    lateness_limit,
    list_unread,
    note_blindness,
)
from shm.store import Reconciled, Store, Workspace
from shm.store.archive import do_nothing
from shm.store.queries.streams import (
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
from shm.store.ring import ring_of
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
from shm.watch.stream_watch import gone_back

if TYPE_CHECKING:
    from shm.pipeline.stream_steps import Pooled, WindowFound

WINDOW = PERIOD  # what is sealed as one is read as one
"""Long enough that a mode at 5 Hz of 0.1 % damping is known to 2e-4 (S. K. Au, 2014)."""
_KEPT_BEFORE_ALERT = timedelta(hours=24)
"""Of raw samples, for good: what changed within a day is told within a day."""
_AGAIN = timedelta(minutes=1)  # judgement: a machine without memory or disk is given a minute
_OFFSETS = 144  # windows of a day, with which a sensor's offset is compared
_WHOLE = 0.98  # judgement: of ten minutes; a chunk that lacks seconds is not waited for
_PATIENCE = timedelta(minutes=20)  # judgement: a logger that sends each quarter of an hour
_HEED = timedelta(minutes=10)  # technical: silences are told by the day
_LOOKED_BACK = timedelta(days=10)
"""Judgement: for what was noticed as a change began; what is told later is a slow one."""

_OVER = "the sensors do not show it any more"
_EVER = datetime.min.replace(tzinfo=UTC)

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Running:
    future: Future[Any]
    keep: Callable[[Any], object]
    fail: Callable[[BaseException], object]


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
        self._running: dict[str, _Running] = {}
        self._done: dict[str, datetime] = {}
        self._pooled: dict[tuple[str, Period], datetime] = {}
        self._changed: dict[str, datetime] = {}
        self._settled: dict[str, datetime] = {}
        self._not_before: dict[str, datetime] = {}
        self._offsets: defaultdict[str, deque[Mapping[str, float]]] = defaultdict(
            lambda: deque(maxlen=_OFFSETS)
        )
        self._known: set[str] = set()
        self._sealed: defaultdict[str, list[datetime]] = defaultdict(list)
        self._late: defaultdict[str, list[datetime]] = defaultdict(list)
        self._news: SimpleQueue[tuple[str, datetime]] = SimpleQueue()
        self._first, self._heed_at, self._rest = 0, _EVER, RestOfDays(clock)
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
        for running in self._running.values():
            running.future.cancel()

    @property
    def under_way(self) -> tuple[Future[Any], ...]:
        """Return what is being computed now."""
        return tuple(running.future for running in self._running.values())

    def advance(self, *, hurry: bool = False) -> bool:
        """Keeps what is finished, begins what has come; whether anything is under way. With `hurry`
        no rest of a day is waited for. Raises StoreError where the store cannot be used now."""
        self._rest.hurry = hurry
        for name, running in list(self._running.items()):
            if running.future.done():
                self._finish(name, running)
                del self._running[name]
        while not self._news.empty():
            self._note(*self._news.get())
        streams = self.workspace.bridge.streams
        # Each turn begins with another, or the first would keep all lanes while they catch up.
        for stream in (*streams[self._first :], *streams[: self._first]):
            if len(self._running) >= self.lanes:
                break
            if stream.name in self._running or not self._may_begin(stream.name):
                continue
            try:
                self._begin(stream)
            except (ShmError, BrokenExecutor):
                raise
            except Exception:  # what one stream holds must not stop the others
                log.exception("stream %s cannot begin its next step", stream.name)
                self._retry_later(stream.name)
        self._first = (self._first + 1) % max(1, len(streams))
        if (now := self.clock()) >= self._heed_at:
            self._heed_at = now + _HEED
            evaluate_silent_streams(self.workspace, self.store, now)
            compare_thermometers(self.workspace, self.store, now)
        return bool(self._running)

    def _note(self, name: str, start: datetime) -> None:
        """Of ten minutes that were read before, there is more now: they are read anew."""
        done = self._done.get(name)
        waiting = self._late if done is not None and start < done else self._sealed
        if start not in waiting[name]:
            bisect.insort(waiting[name], start)

    def _may_begin(self, name: str) -> bool:
        return self.clock() >= self._not_before.get(name, _EVER)

    # ------------------------------------------------------------ begin

    def _begin(self, stream: Stream) -> None:
        """The next step of a stream, if there is one: pools come before further windows."""
        if stream.name not in self._known:
            self._recall(stream)
        if stream.name in self._changed and not self._late[stream.name]:
            self._go_back(stream, self._changed.pop(stream.name))
        done = self._done.get(stream.name)
        if done is not None:
            for period, length in PERIODS.items():
                start = self._next_pool(stream, period, length, done)
                if start is not None:
                    self._begin_pool(stream, period, start)
                    return
        start = self._next_window(stream.name)
        if start is not None:
            self._begin_window(stream, start)

    def _recall(self, stream: Stream) -> None:
        """Return how far the stream had come, what was sealed since, and what came late."""
        name = stream.name
        self._known.add(name)
        done = find_progress(self.store, name)
        since = lateness_limit(self.workspace, self.clock())
        changed = find_first_unpooled(self.store, name, since)
        if changed is not None:
            self._changed[name] = changed
        hours = find_pooled_range(self.store, name, "hour")
        watched = self._watched_until(stream)
        if hours is not None and watched is not None and watched <= hours[1]:
            self._pooled[name, "hour"] = watched
            self._settled[name] = hours[1] + PERIODS["hour"]
        if done is not None:
            self._done[name] = done
        for start in list_unread(self.workspace, self.ring, self.store, name, self.clock()):
            self._note(name, start)

    def _go_back(self, stream: Stream, changed: datetime) -> None:
        """Pool again from the earliest window on that came late.

        The watch goes on from how it was before them; further back than its states are kept, they
        are pooled and not watched.
        """
        name, streams = stream.name, self.store.streams
        starts = {each: period_start(changed, length) for each, length in PERIODS.items()}
        newest = load_stream_watch(self.store, stream.hanger)
        before = load_stream_watch(self.store, stream.hanger, starts["hour"])
        if newest and before and starts["hour"] < newest.reading_time:
            with suppress(BadInput):  # states of before an upgrade cannot be read
                content = gone_back(before.content, newest.content)
                streams.go_back(stream.hanger, before.reading_time, content)
                starts["hour"] = before.reading_time
                self._settled[name] = max(
                    newest.reading_time, self._settled.get(name, newest.reading_time)
                )
        for period, start in starts.items():
            former = self._pooled.get((name, period), start)
            self._pooled[name, period] = min(former, start)

    def _watched_until(self, stream: Stream) -> datetime | None:
        watch = load_stream_watch(self.store, stream.hanger)
        return None if watch is None else watch.reading_time

    def _next_window(self, name: str) -> datetime | None:
        """The next ten minutes that are whole, or not waited for any more; late ones last."""
        sealed, late = self._sealed[name], self._late[name]
        if sealed and (len(sealed) > 1 or self._is_whole(name, sealed[0])):
            return sealed.pop(0)
        return late.pop(0) if late else None

    def _is_whole(self, name: str, start: datetime) -> bool:
        if self.clock() >= start + WINDOW + _PATIENCE:
            return True
        received = self.ring.received(name, start).get(start)
        return received is not None and received.received_s >= _WHOLE * WINDOW.total_seconds()

    def _begin_window(self, stream: Stream, start: datetime) -> None:
        from shm.pipeline.steps import identify_options
        from shm.pipeline.stream_steps import read_stream_window

        hanger = self.workspace.bridge.tested(stream.hanger)
        options = identify_options(self.workspace.settings, self.workspace.bridge)
        known = list_latest_with_modes(self.store, stream.name)
        self._submit(
            stream.name,
            partial(
                read_stream_window,
                self.ring.read(stream.name, start, start + WINDOW),
                stream,
                last_modes(known),
                hanger,
                options,
                tuple(self._offsets[stream.name]),
                any(each.how == "tracked" for each in known),
            ),
            partial(self._keep_window, stream),
            partial(self._give_up_window, stream, start),
        )

    def _next_pool(
        self, stream: Stream, period: Period, length: timedelta, done: datetime
    ) -> datetime | None:
        """The next period that is over and has windows; those without are passed over."""
        key = stream.name, period
        start = self._pooled.get(key) or self._pooled_until(stream, period, length)
        while start is not None and start + length <= done:
            if period == "day" and self._rest.is_awaited(self.store, stream.name, start):
                return None
            if self._is_due(stream, period, start):
                break
            start += length
        if start is not None:
            self._pooled[key] = start
        return start if start is not None and start + length <= done else None

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
        """The end of the last reading of a period; the first window's period where none is."""
        pooled = find_pooled_range(self.store, stream.name, period)
        if pooled is not None:
            return pooled[1] + length
        first = find_first_window(self.store, stream.name)
        return None if first is None else period_start(first, length)

    def _windows(
        self, stream: Stream, start: datetime, length: timedelta
    ) -> tuple[WindowReading, ...]:
        found = list_windows(self.store, stream.hanger, start, start + length)
        return tuple(each for each in found if each.window.stream == stream.name)

    def _begin_pool(self, stream: Stream, period: Period, start: datetime) -> None:
        from shm.pipeline.stream_steps import pool_stream

        hanger = self.workspace.bridge.tested(stream.hanger)
        watch = load_stream_watch(self.store, stream.hanger)
        self._submit(
            stream.name,
            partial(
                pool_stream,
                self._windows(stream, start, PERIODS[period]),
                period,
                start,
                hanger,
                baseline_of(self.store, stream),
                None if watch is None else watch.content,
                self.workspace.settings.false_call_years,
                self._recent_events(stream, start) if period == "hour" else (),
                is_watched=period == "hour" and (watch is None or start >= watch.reading_time),
            ),
            partial(self._keep_pooled, stream, period, start),
            partial(self._give_up_pool, stream, period, start),
        )

    def _recent_events(self, stream: Stream, start: datetime) -> tuple[StreamEvent, ...]:
        return list_stream_events(self.store, stream.name, start - _LOOKED_BACK)

    def _submit(
        self,
        name: str,
        step: Callable[[], Any],
        keep: Callable[[Any], object],
        fail: Callable[[BaseException], object],
    ) -> None:
        future = self.executor.submit(step)
        self._running[name] = _Running(future, keep, fail)
        future.add_done_callback(lambda _: self.wake())

    # ------------------------------------------------------------ finish

    def _finish(self, name: str, running: _Running) -> None:
        """Store the result of a step that has ended, or handle the error that it ended with.

        Raises StoreError where the store cannot be used now: the result is stored at a later turn.
        """
        error = running.future.exception()
        try:
            if error is None:
                running.keep(running.future.result())
                return
        except StoreError:
            raise
        except Exception as fault:  # noqa: BLE001 - it must stop neither stream nor files
            error = fault
        if isinstance(error, BrokenExecutor | MemoryError) or getattr(error, "retry_after_s", None):
            self._retry_later(name)
            log.warning("stream %s is tried again in a minute: %s", name, error)
        else:
            unexpected = None if isinstance(error, ShmError) else error
            log.error("stream %s: a step failed: %s", name, error, exc_info=unexpected)
            running.fail(error)

    def _retry_later(self, name: str) -> None:
        """Leave a stream alone for a minute, then look for its unread windows again."""
        self._not_before[name] = self.clock() + _AGAIN
        self._known.discard(name)

    def _keep_window(self, stream: Stream, found: WindowFound) -> None:
        for event in found.events:
            self.store.streams.save_event(event)
        self._offsets[stream.name].append(found.offsets)
        self._save(found.reading)
        if found.lacks_modes or not found.reading.modes:
            note_blindness(self.store, stream, found.reading.window.start)

    def _save(self, reading: WindowReading) -> None:
        window = reading.window
        self.store.streams.save_window(reading)
        name, done = window.stream, self._done.get(window.stream, _EVER)
        self._rest.note(name, window.start, done)
        if window.start < done:
            self._changed[name] = min(window.start, self._changed.get(name, window.start))
        self._done[name] = max(done, window.start + WINDOW)

    def _give_up_window(self, stream: Stream, start: datetime, error: BaseException) -> None:
        """Said in the window's own row: what one window holds must not stop its stream."""
        seconds = WINDOW.total_seconds()
        window = Window(stream.name, stream.hanger, start, seconds, "unusable", float("nan"))
        why = f"it could not be read: {error}"
        self._save(WindowReading(window, (), "none", why))

    def _keep_pooled(self, stream: Stream, period: Period, start: datetime, found: Pooled) -> None:
        self._pooled[stream.name, period] = end = start + PERIODS[period]
        settled = self._settled.get(stream.name, _EVER)
        for event in found.events:
            self.store.streams.save_event(event)
        if found.reading is None:
            return
        if found.test is not None:
            hand_on_day(self.workspace, self.store, found.test, self.clock())
        if found.alert is not None:
            why = f"alert {found.alert.key}"
            self.ring.keep(stream.name, end - _KEPT_BEFORE_ALERT, end, why)
        hooks = [hook.name for hook in self.workspace.bridge.hooks]
        changes = self._reconciled(stream.hanger, found, is_again=end <= settled)
        kept = found.kept or None
        for raised in self.store.streams.save_pooled(
            found.reading, kept, changes, hooks, self.clock()
        ):
            log.warning("alert %s: %s", raised.alert.key, raised.alert.message)

    def _reconciled(self, hanger: int, found: Pooled, *, is_again: bool) -> Reconciled:
        """Return which alerts an hour opens and closes; where hours are gone over again, none that
        they have raised before others of them came late."""
        if found.alert is None and not found.ended:
            return Reconciled()
        alerts = self.store.alerts.list_all(hanger)
        is_open = [each for each in alerts if each.resolution is None]
        known = [each for each in alerts if each.baseline_id is None] if is_again else []
        over = [each.alert for each in is_open if each.alert.key in found.ended]
        conditions = [Condition(each, "over", _OVER) for each in over]
        conditions += [Condition(found.alert, "holds")] if found.alert else []
        changes = reconcile(is_open, conditions)
        if found.alert and any(
            set(found.alert.kinds) <= set(each.alert.kinds)
            and is_same_event(each.alert, found.alert)
            for each in known
        ):
            changes = replace(changes, to_open=())
        return changes

    def _give_up_pool(
        self, stream: Stream, period: Period, start: datetime, error: BaseException
    ) -> None:
        self._pooled[stream.name, period] = start + PERIODS[period]


def last_modes(readings: Sequence[WindowReading]) -> tuple[Mode, ...]:
    """Return the modes of windows, the last first, each as it was seen last.

    A mode that one window hides is looked for again in the next.
    """
    found: dict[tuple[Plane, int], Mode] = {}
    for reading in readings:
        for mode in reading.modes:
            found.setdefault((mode.plane, mode.order), mode)
    return tuple(sorted(found.values(), key=lambda mode: mode.frequency_hz))
