"""Permanent sensors: what windows said, what they pool to, events, how far the work is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields
from datetime import datetime, timedelta
from typing import Any, TypeVar

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.documents import compact
from shm.store.database import Repository, insert
from shm.store.mapping import row_of
from shm.store.outbox import settle
from shm.store.rows import Reconciled, StoredAlert
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
    PooledReading,
    StreamEvent,
    Window,
    WindowReading,
    period_start,
)

HOURS_KEPT = timedelta(days=800)
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
        kept: bytes | None = None,
        changes: Reconciled = _NO_CHANGE,
        hooks: Sequence[str] = (),
        at: datetime | None = None,
    ) -> tuple[StoredAlert, ...]:
        """Store a reading of an hour or a day, in the place of the one of then before.

        `kept` is what the watch of the hanger goes on from, `changes` are alerts that it opens and
        closes; those that are new are owed to `hooks` from `at` on (the reading's end where nothing
        is said), and returned.
        """
        end = reading.start + PERIODS[reading.period]
        row = {name: getattr(reading, name) for name in ("stream", "hanger", "period", "start")}
        row["document"] = _document(reading)
        with self.writing() as connection:
            _replace(connection, pooled_readings, row, "stream", "period", "start")
            if kept is not None:
                state = {"hanger": reading.hanger, "reading_time": end, "content": kept}
                _replace(connection, stream_watch, state, "hanger")
                _keep_day(connection, state)
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
        """Takes out windows and events of before so many days, and hours of before `HOURS_KEPT`.

        Readings of a day stay for good.
        """
        of_hours = pooled_readings.c.period != "day"
        oldest = now - timedelta(days=window_days)
        with self.writing() as connection:
            for chosen in (
                sa.delete(stream_windows).where(stream_windows.c.start < oldest),
                sa.delete(stream_events).where(stream_events.c.end < now - HOURS_KEPT),
                sa.delete(pooled_readings).where(
                    of_hours, pooled_readings.c.start < now - HOURS_KEPT
                ),
            ):
                connection.execute(chosen)


def _document(reading: WindowReading | PooledReading) -> str:
    """A reading without what is not known or as usual: modes have many such."""
    document = asdict(reading)
    document["modes"] = [_told(mode, Mode) for mode in document["modes"]]
    return compact(document)


def _told(values: dict[str, Any], kind: type[Mode | ShapePoint]) -> dict[str, Any]:
    usual = {field.name: field.default for field in fields(kind)}
    document = {name: value for name, value in values.items() if not _is_usual(value, usual[name])}
    if "shape" in document:
        document["shape"] = [_told(point, ShapePoint) for point in document["shape"]]
    return document


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
    own, time = table.c.hanger == state["hanger"], state["reading_time"]
    query = sa.select(table.c.reading_time).where(own).order_by(table.c.reading_time.desc())
    known = connection.scalars(query).all()
    if known and time < known[0] + PERIODS["day"]:
        return
    connection.execute(sa.insert(table).values(state))
    for old in known[_DAYS_BACK - 1 :]:
        connection.execute(sa.delete(table).where(own, table.c.reading_time == old))


def _advance(connection: Connection, stream: str, until: datetime) -> None:
    """A window that is done anew takes nothing back."""
    known = sa.select(stream_progress.c.done_until).where(stream_progress.c.stream == stream)
    before = connection.scalar(known)
    if before is None or before < until:
        row = {"stream": stream, "done_until": until}
        _replace(connection, stream_progress, row, "stream")
