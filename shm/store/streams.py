"""Windows, pooled readings and events of permanent sensors."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields
from datetime import datetime, timedelta
from typing import Any, TypeVar

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.documents import compact
from shm.store.alerts import settle
from shm.store.columns import row_of, value_from, value_in
from shm.store.database import Repository, insert
from shm.store.rows import Reconciled, StoredAlert, StreamWatchCheckpoint
from shm.store.tables import (
    pooled_readings,
    stream_events,
    stream_progress,
    stream_watch,
    stream_watch_days,
    stream_windows,
)
from shm.values import ShapePoint
from shm.values.modes import Mode
from shm.values.stream import (
    PERIODS,
    Period,
    PooledReading,
    StreamEvent,
    Window,
    WindowReading,
    period_start,
)

HOURLY_RETENTION = timedelta(days=800)
"""Readings of an hour and of six: two summers and two winters, and a month to look at them."""

_DAYS_BACK = 10
"""States of the watch, a day apart: twice the default of `late_hours`. Judgement."""
_NO_CHANGE = Reconciled()
_T = TypeVar("_T", WindowReading, PooledReading)


class Streams(Repository):
    """Windows, pooled readings and events of permanent sensors."""

    def save_window(self, reading: WindowReading) -> None:
        """Keeps what a window said, in the place of what it said before, and that it is done.

        What was pooled without it goes: until it is pooled anew, that it lacks tells so.
        """
        window = reading.window
        row = {"stream": window.stream, "hanger": window.hanger, "start": window.start}
        row |= {"has_modes": bool(reading.modes), "document": _document(reading)}
        with self.writing() as connection:
            _replace(connection, stream_windows, row, "stream", "start")
            connection.execute(sa.delete(pooled_readings).where(_pooled_with(window)))
            _advance(connection, window.stream, window.start + timedelta(seconds=window.duration_s))

    def save_pooled(
        self,
        reading: PooledReading,
        state: bytes | None = None,
        changes: Reconciled = _NO_CHANGE,
        hooks: Sequence[str] = (),
        at: datetime | None = None,
    ) -> tuple[StoredAlert, ...]:
        """Store a reading of an hour or a day, in the place of the one of then before.

        `state` is what the watch of the hanger goes on from, `changes` are alerts that it opens and
        closes; those that are new are owed to `hooks` from `at` on (the reading's end where nothing
        is said), and returned.
        """
        end = reading.start + PERIODS[reading.period]
        row = {name: getattr(reading, name) for name in ("stream", "hanger", "period", "start")}
        row["document"] = _document(reading)
        with self.writing() as connection:
            _replace(connection, pooled_readings, row, "stream", "period", "start")
            if state is not None:
                entry = {"hanger": reading.hanger, "reading_time": end, "content": state}
                _replace(connection, stream_watch, entry, "hanger")
                _keep_day(connection, entry)
            return settle(connection, changes, hooks, at or end)

    def go_back(self, hanger: int, to: datetime, content: bytes) -> None:
        """The watch of a hanger goes on from a state of before."""
        days = stream_watch_days
        state = {"hanger": hanger, "reading_time": to, "content": content}
        later = (days.c.hanger == hanger, days.c.reading_time > to)
        with self.writing() as connection:
            _replace(connection, stream_watch, state, "hanger")
            connection.execute(sa.delete(days).where(*later))

    def save_event(self, event: StreamEvent) -> None:
        """Notes something once; what was noted already is not noted again."""
        row = row_of(event, stream_events)
        same = (stream_events.c[name] == value for name, value in row.items())
        with self.writing() as connection:
            if connection.execute(sa.select(stream_events.c.id).where(*same)).first() is None:
                insert(connection, stream_events, row)

    def sweep(self, now: datetime, window_days: float) -> None:
        """Remove windows and events before so many days, and hours before `HOURLY_RETENTION`.

        Readings of a day stay for good.
        """
        of_hours = pooled_readings.c.period != "day"
        oldest = now - timedelta(days=window_days)
        with self.writing() as connection:
            for chosen in (
                sa.delete(stream_windows).where(stream_windows.c.start < oldest),
                sa.delete(stream_events).where(stream_events.c.end < now - HOURLY_RETENTION),
                sa.delete(pooled_readings).where(
                    of_hours, pooled_readings.c.start < now - HOURLY_RETENTION
                ),
            ):
                connection.execute(chosen)


def _document(reading: WindowReading | PooledReading) -> str:
    """A reading without what is not known or as usual: modes have many such."""
    document = _plain(reading)
    if isinstance(reading, WindowReading):
        document["window"] = _plain(reading.window)
    document["modes"] = [_brief(mode) for mode in reading.modes]
    return compact(document)


def _plain(value: WindowReading | PooledReading | Window) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _brief(value: Mode | ShapePoint) -> dict[str, Any]:
    stated = ((name, getattr(value, name), usual) for name, usual in _USUAL[type(value)].items())
    document = {name: each for name, each, usual in stated if not _is_usual(each, usual)}
    if "shape" in document:
        document["shape"] = [_brief(point) for point in document["shape"]]
    return document


_USUAL = {
    kind: {field.name: field.default for field in fields(kind)} for kind in (Mode, ShapePoint)
}


def _is_usual(value: Any, usual: Any) -> bool:
    return bool(value == usual or (value != value and usual != usual))


def _replace(connection: Connection, table: sa.Table, row: dict[str, Any], *keys: str) -> None:
    former = (table.c[key] == row[key] for key in keys)
    connection.execute(sa.delete(table).where(*former))
    connection.execute(sa.insert(table).values(row))


def _pooled_with(window: Window) -> sa.ColumnElement[bool]:
    """The readings that a window is, or would be, pooled to."""
    table = pooled_readings
    any_of = (
        (table.c.period == period) & (table.c.start == period_start(window.start, length))
        for period, length in PERIODS.items()
    )
    return (table.c.stream == window.stream) & sa.or_(*any_of)


def _keep_day(connection: Connection, state: dict[str, Any]) -> None:
    """A state of the watch as one to go back to, where the last such is a day old."""
    table = stream_watch_days
    of_hanger, time = table.c.hanger == state["hanger"], state["reading_time"]
    query = sa.select(table.c.reading_time).where(of_hanger).order_by(table.c.reading_time.desc())
    known = connection.scalars(query).all()
    if known and time < known[0] + PERIODS["day"]:
        return
    connection.execute(sa.insert(table).values(state))
    for old in known[_DAYS_BACK - 1 :]:
        connection.execute(sa.delete(table).where(of_hanger, table.c.reading_time == old))


def _advance(connection: Connection, stream: str, until: datetime) -> None:
    """A window that is done anew takes nothing back."""
    known = sa.select(stream_progress.c.done_until).where(stream_progress.c.stream == stream)
    before = connection.scalar(known)
    if before is None or before < until:
        row = {"stream": stream, "done_until": until}
        _replace(connection, stream_progress, row, "stream")


_LATEST = 36
"""Windows of a train-free night: a mode that traffic hides for some hours is not forgotten."""


def list_windows(
    store: Repository, hanger: int, since: datetime, until: datetime
) -> tuple[WindowReading, ...]:
    """List the windows of a hanger that began from `since` on and before `until`, by time."""
    table = stream_windows
    within = (table.c.hanger == hanger, table.c.start >= since, table.c.start < until)
    query = sa.select(table).where(*within).order_by(table.c.start, table.c.id)
    return _values(store, query, WindowReading)


def list_spectra(
    store: Repository, stream: str, since: datetime, until: datetime, most: int
) -> tuple[tuple[datetime, Sequence[int]], ...]:
    """List starts and spectra in dB of windows of a stream: at most so many, evenly chosen."""
    table = stream_windows
    within = (table.c.stream == stream, table.c.start >= since, table.c.start < until)
    with store.reading() as connection:
        ids = connection.scalars(sa.select(table.c.id).where(*within).order_by(table.c.start))
        chosen = ids.all()
        some = table.c.id.in_(chosen[:: max(1, -(-len(chosen) // most))])
        rows = connection.execute(sa.select(table).where(some).order_by(table.c.start)).all()
    spectra = ((row.start, json.loads(row.document)["spectrum_db"]) for row in rows)
    return tuple(each for each in spectra if each[1])


def find_last_window(store: Repository, stream: str) -> WindowReading | None:
    """Return the latest window of a stream; None without one."""
    table = stream_windows
    query = sa.select(table).where(table.c.stream == stream).order_by(table.c.start.desc())
    return next(iter(_values(store, query.limit(1), WindowReading)), None)


def list_latest_with_modes(store: Repository, stream: str) -> tuple[WindowReading, ...]:
    """Return the latest windows of a stream that have modes, the last first."""
    table = stream_windows
    query = sa.select(table).where(table.c.stream == stream, table.c.has_modes)
    latest = query.order_by(table.c.start.desc()).limit(_LATEST)
    return _values(store, latest, WindowReading)


def find_first_window(store: Repository, stream: str) -> datetime | None:
    """Return when the first window of a stream began; None without one."""
    query = sa.select(sa.func.min(stream_windows.c.start)).where(stream_windows.c.stream == stream)
    found: datetime | None = store.scalar(query)
    return found


def list_window_starts(store: Repository, stream: str, since: datetime) -> frozenset[datetime]:
    """Return the starts of the windows of a stream that are done, from a time on."""
    table = stream_windows
    query = sa.select(table.c.start).where(table.c.stream == stream, table.c.start >= since)
    return frozenset(store.scalars(query))


def find_first_unpooled(store: Repository, stream: str, since: datetime) -> datetime | None:
    """Return the first window with modes whose hour, six hours or day is not pooled.

    From `since` on, and only where a later period is.
    """
    table, windows = pooled_readings, stream_windows
    of_windows = sa.select(windows.c.start).where(
        windows.c.stream == stream, windows.c.has_modes, windows.c.start >= since
    )
    starts: dict[str, set[datetime]] = {period: set() for period in PERIODS}
    with store.reading() as connection:
        for row in connection.execute(
            sa.select(table.c.period, table.c.start).where(
                table.c.stream == stream, table.c.start >= since - PERIODS["day"]
            )
        ):
            starts[row.period].add(row.start)
        found = connection.scalars(of_windows.order_by(windows.c.start)).all()
    start: datetime
    for start in found:
        for period, length in PERIODS.items():
            begin = period_start(start, length)
            if begin not in starts[period] and begin < max(starts[period], default=begin):
                return start
    return None


def find_pooled_range(
    store: Repository, stream: str, period: Period | None = None
) -> tuple[datetime, datetime] | None:
    """Return when the first and the latest reading of a period, or of any, began."""
    start = pooled_readings.c.start
    query = sa.select(sa.func.min(start), sa.func.max(start))
    query = query.where(pooled_readings.c.stream == stream)
    if period is not None:
        query = query.where(pooled_readings.c.period == period)
    first, last = store.first(query)
    return None if first is None else (first, last)


def list_pooled(
    store: Repository, hanger: int, period: Period, since: datetime, until: datetime
) -> tuple[PooledReading, ...]:
    """List the readings of a hanger that began from `since` on and before `until`, by time."""
    table = pooled_readings
    within = (table.c.start >= since, table.c.start < until)
    query = sa.select(table).where(table.c.hanger == hanger, table.c.period == period, *within)
    return _values(store, query.order_by(table.c.start, table.c.id), PooledReading)


def list_hours_near(
    store: Repository, stream: str, times: Sequence[datetime], within: timedelta
) -> tuple[PooledReading, ...]:
    """List the readings of an hour of a stream that began near any of these times, by time."""
    table = pooled_readings
    near = (table.c.start.between(at - within, at + within) for at in times)
    of_hours = (table.c.stream == stream) & (table.c.period == "hour")
    query = sa.select(table).where(of_hours, sa.or_(sa.false(), *near))
    return _values(store, query.order_by(table.c.start), PooledReading)


def load_stream_watch(
    store: Repository, hanger: int, until: datetime | None = None
) -> StreamWatchCheckpoint | None:
    """Return what the watch of a hanger's sensors goes on from; with `until` as it was at the
    last kept time up to then."""
    table = stream_watch if until is None else stream_watch_days
    query = sa.select(table.c.reading_time, table.c.content).where(table.c.hanger == hanger)
    if until is not None:
        query = query.where(table.c.reading_time <= until)
    row = store.first(query.order_by(table.c.reading_time.desc()).limit(1))
    return None if row is None else StreamWatchCheckpoint(*row)


def list_stream_events(
    store: Repository, stream: str | None, since: datetime
) -> tuple[StreamEvent, ...]:
    """List events from a time on, of one stream where named, by time."""
    query = sa.select(stream_events).where(stream_events.c.end >= since)
    if stream is not None:
        query = query.where(stream_events.c.stream == stream)
    rows = store.rows(query.order_by(stream_events.c.start, stream_events.c.id))
    return tuple(value_in(row, StreamEvent) for row in rows)


def find_progress(store: Repository, stream: str) -> datetime | None:
    """Return up to when the windows of a stream are done; None where none is."""
    progress = stream_progress
    found: datetime | None = store.scalar(
        sa.select(progress.c.done_until).where(progress.c.stream == stream)
    )
    return found


def _values(store: Repository, query: sa.Select[Any], kind: type[_T]) -> tuple[_T, ...]:
    return tuple(value_from(kind, row.document) for row in store.rows(query))
