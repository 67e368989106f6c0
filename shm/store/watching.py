"""Verbs on drifts, alerts and the outbox. An alert and its deliveries are one transaction."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import fields
from datetime import datetime, timedelta
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import DamagedRow
from shm.store.blobs import alert_from_document, watch_document, watch_from
from shm.store.checksums import decoding, loads, note_damage, whole
from shm.store.database import Database, insert
from shm.store.files import in_force
from shm.store.outbox import raise_alert
from shm.store.results import all_at, move
from shm.store.rows import (
    Acknowledgement,
    Baseline,
    Delivery,
    DeliveryState,
    KeptWatch,
    Stage,
    StoredAlert,
    StoredTest,
    StoredWatch,
)
from shm.store.stepping import NOTIFIED, write_step
from shm.store.tables import (
    acknowledgements,
    alerts,
    deliveries,
    drifts,
    tests,
    watch_states,
    watches,
)
from shm.values import Alert, Drift, WatchedTest

_DRIFT_COLUMNS = tuple(field.name for field in fields(Drift) if field.name != "test")
stored_alerts = sa.select(
    alerts,
    tests.c.name.label("test"),
    *(acknowledgements.c[name].label(f"ack_{name}") for name in ("who", "why", "at")),
).select_from(alerts.outerjoin(acknowledgements).outerjoin(tests, tests.c.id == alerts.c.test_id))

_OWED = ("id", "hook", "state", "attempts", "next_attempt_at", "last_error", "ended_at")
_outbox = stored_alerts.add_columns(
    *(deliveries.c[name].label(f"owed_{name}") for name in _OWED)
).join(deliveries, deliveries.c.alert_id == alerts.c.id)


class Watching(Database):
    """The part of the store that keeps drifts and owes alerts to hooks."""

    def watched(
        self,
        test: StoredTest,
        baseline: Baseline,
        found: WatchedTest,
        alert: Alert | None,
        hooks: Sequence[str],
        at: datetime,
        state: KeptWatch | None = None,
    ) -> StoredAlert | None:
        """Keeps what the watch made of a test; the alert where it is a new one, else None.

        An alert whose key was raised before is the same standing condition and is not raised again.
        `state` is what the watch goes on from at the next test.
        """
        with self.writing() as connection:
            if not all_at(connection, [test], Stage.UPDATED):
                return None
            for drift in found.drifts:
                insert(connection, drifts, _drift_values(drift, test, baseline))
            raised = None
            if alert is not None:
                raised = raise_alert(connection, test.id, baseline.id, alert, hooks, at)
            values = _watch_values(found, test, baseline, raised)
            insert(connection, watches, values)
            if state is not None:
                _keep_state(connection, baseline, state)
            move(connection, [test], Stage.WATCHED, at)
            return raised

    def kept_watch(self, baseline: Baseline) -> KeptWatch | None:
        """What the watch goes on from at the next test that is compared with a baseline."""
        query = sa.select(watch_states).where(watch_states.c.baseline_id == baseline.id)
        with self.reading() as connection:
            row = connection.execute(query).one_or_none()
        if row is None or not whole(watch_states, row):
            return None  # it may be thrown away at will
        return KeptWatch(row.key, row.last_test_time, row.content)

    def forget_watch(self, baseline: Baseline) -> None:
        """Drops what the watch would go on from: it then begins anew at the next test."""
        with self.writing() as connection:
            _drop_state(connection, baseline)

    def drifts(self, hanger: int | None = None, test: str | None = None) -> tuple[Drift, ...]:
        """Shifts from the baseline, by time; of one hanger or test where named."""
        query = sa.select(drifts, tests.c.name.label("test")).join(tests).where(in_force(drifts))
        if hanger is not None:
            query = query.where(drifts.c.hanger == hanger)
        if test is not None:
            query = query.where(tests.c.name == test)
        with self.reading() as connection:
            rows = connection.execute(query.order_by(drifts.c.time, drifts.c.id)).all()
        return tuple(_drift(row) for row in rows)

    def watches(
        self, hanger: int | None = None, baseline_id: int | None = None
    ) -> tuple[StoredWatch, ...]:
        """What the watch said after each test, by time; of one hanger or baseline where named."""
        query = sa.select(watches.c.id).where(in_force(watches))
        if hanger is not None:
            query = query.where(watches.c.hanger == hanger)
        if baseline_id is not None:
            query = query.where(watches.c.baseline_id == baseline_id)
        return self.watches_of(query)

    def watches_of(self, chosen: sa.Select[Any] | Sequence[int]) -> tuple[StoredWatch, ...]:
        """Watches that are `chosen` by their numbers, with their shifts, by time."""
        name = tests.c.name.label("test")
        query: sa.Select[Any] = sa.select(watches, name).select_from(watches).join(tests)
        query = query.where(watches.c.id.in_(chosen))
        same_test = watches.c.test_id == drifts.c.test_id
        together = same_test & (watches.c.baseline_id == drifts.c.baseline_id)
        of_shift = (drifts.c[name] for name in _DRIFT_COLUMNS)
        shifts: sa.Select[Any] = (
            sa.select(drifts.c.test_id, drifts.c.baseline_id, name, *of_shift)
            .select_from(drifts.join(tests).join(watches, together))
            .where(watches.c.id.in_(chosen), in_force(drifts))
            .order_by(drifts.c.id)
        )
        with self.reading() as connection:
            rows = connection.execute(query.order_by(watches.c.time, watches.c.id)).all()
            found: defaultdict[tuple[int, int], list[Drift]] = defaultdict(list)
            for row in connection.execute(shifts):
                test_id, baseline_id, test, *values = row
                named = dict(zip(_DRIFT_COLUMNS, values, strict=True))
                found[test_id, baseline_id].append(Drift(test=test, **named))
        return tuple(_stored_watch(row, found[row.test_id, row.baseline_id]) for row in rows)

    def alerts(self, hanger: int | None = None) -> tuple[StoredAlert, ...]:
        """All alerts, or those of one hanger, as they were raised and acknowledged."""
        query = stored_alerts.order_by(alerts.c.id)
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        with self.reading() as connection:
            return tuple(stored_alert(row) for row in connection.execute(query))

    def deliveries(self, state: DeliveryState | None = None) -> tuple[Delivery, ...]:
        """The outbox: what was told to which hook, or is still owed."""
        query = _outbox.order_by(deliveries.c.id)
        if state is not None:
            query = query.where(deliveries.c.state == state)
        return self._deliveries(query)

    def due_deliveries(
        self,
        now: datetime,
        limit: int,
        excluding: Collection[int] = (),
        waits: Sequence[timedelta] = (),
    ) -> tuple[Delivery, ...]:
        """Deliveries whose time has come, the longest due first.

        Also those that would wait longer than `waits` says for so many attempts, its last for more:
        the clock was ahead when they were put off.
        """
        at, tried = deliveries.c.next_attempt_at, deliveries.c.attempts
        counts = [tried == count for count in range(len(waits) - 1)] + [tried >= len(waits) - 1]
        too_far = [of & (at > now + wait) for of, wait in zip(counts, waits, strict=False)]
        due = (deliveries.c.state == DeliveryState.WAITING) & sa.or_(at <= now, *too_far)
        query = _outbox.where(due, deliveries.c.id.not_in(excluding))
        return self._deliveries(query.order_by(deliveries.c.next_attempt_at).limit(limit))

    def delivered(self, delivery: Delivery, at: datetime) -> None:
        """Marks a delivery as done; one that has come to its end stays as it is."""
        self._end(delivery, DeliveryState.DELIVERED, "", at)

    def delivery_failed(
        self, delivery: Delivery, error: str, at: datetime, next_attempt_at: datetime | None
    ) -> None:
        """Puts a delivery off, or gives it up where `next_attempt_at` is None."""
        if next_attempt_at is None:
            self._end(delivery, DeliveryState.GIVEN_UP, error, at)
        else:
            with self.writing() as connection:
                waits = {"last_error": error, "next_attempt_at": next_attempt_at}
                _note(connection, delivery, waits)

    def _end(self, delivery: Delivery, state: DeliveryState, error: str, at: datetime) -> None:
        with self.writing() as connection:
            ended = {"state": state, "last_error": error, "ended_at": at}
            if _note(connection, delivery, ended):
                _note_notified(connection, delivery, at)

    def _deliveries(self, query: sa.Select[Any]) -> tuple[Delivery, ...]:
        with self.reading() as connection:
            return tuple(_delivery(row) for row in connection.execute(query))


def _keep_state(connection: Connection, baseline: Baseline, state: KeptWatch) -> None:
    _drop_state(connection, baseline)
    row = {**vars(state), "hanger": baseline.hanger, "baseline_id": baseline.id}
    insert(connection, watch_states, row)


def _drop_state(connection: Connection, baseline: Baseline) -> None:
    former = watch_states.c.baseline_id == baseline.id
    connection.execute(sa.delete(watch_states).where(former))


def _note(connection: Connection, delivery: Delivery, values: dict[str, Any]) -> bool:
    """Whether it was still owed: another process may have had an answer of the hook before."""
    owed = (deliveries.c.id == delivery.id) & (deliveries.c.state == DeliveryState.WAITING)
    changed = sa.update(deliveries).where(owed)
    noted = connection.execute(changed.values(attempts=deliveries.c.attempts + 1, **values))
    return noted.rowcount == 1


def _note_notified(connection: Connection, delivery: Delivery, at: datetime) -> None:
    """The test of an alert has come to its end once no hook is owed it any more."""
    siblings = sa.select(deliveries.c.alert_id).where(deliveries.c.id == delivery.id)
    of_alert = deliveries.c.alert_id == siblings.scalar_subquery()
    waiting = sa.select(deliveries.c.id).where(
        of_alert, deliveries.c.state == DeliveryState.WAITING
    )
    if connection.execute(waiting).first() is None:
        about = sa.select(tests.c.recording_id, tests.c.id).join(alerts)
        row = connection.execute(about.where(alerts.c.id == siblings.scalar_subquery())).one()
        write_step(connection, row.recording_id, NOTIFIED, at, row.id)


def _drift_values(drift: Drift, test: StoredTest, baseline: Baseline) -> dict[str, Any]:
    values = {name: getattr(drift, name) for name in _DRIFT_COLUMNS}
    return {**values, "test_id": test.id, "baseline_id": baseline.id}


def _drift(row: Row[Any]) -> Drift:
    return Drift(test=row.test, **{name: getattr(row, name) for name in _DRIFT_COLUMNS})


def _watch_values(
    found: WatchedTest, test: StoredTest, baseline: Baseline, raised: StoredAlert | None
) -> dict[str, Any]:
    # Names its shifts and its alert, so that one that is gone is missed.
    told = {
        "shifts": [drift.quantity for drift in found.drifts],
        "alert": None if raised is None else raised.id,
    }
    return {
        "test_id": test.id,
        "baseline_id": baseline.id,
        "hanger": test.hanger,
        "time": found.time,
        "document": {**watch_document(found), **told},
        "called": found.change.called,
    }


def _stored_watch(row: Row[Any], shifts: Sequence[Drift]) -> StoredWatch:
    with decoding(watches, row, row.hanger):
        found = watch_from(loads(row.document), row.test, row.time, shifts)
        return StoredWatch(row.id, row.hanger, row.baseline_id, found)


def stored_alert(row: Row[Any]) -> StoredAlert:
    """An alert and its acknowledgement, of a row of `stored_alerts`."""
    return StoredAlert(row.id, _alert(row), row.raised_at, acknowledgement_of(row))


def _alert(row: Row[Any]) -> Alert:
    """An alert that was raised is told even where its document is damaged: as much as is left."""
    try:
        with decoding(alerts, row, row.hanger):
            return alert_from_document(loads(row.document))
    except DamagedRow as error:
        note_damage(error)
        message = f"{row.message} (Details are lost: {error.message})"
        return Alert(row.key, row.hanger, row.test or "", row.time, message, ())


def acknowledgement_of(row: Row[Any]) -> Acknowledgement | None:
    """Who took note of an alert, of a row of `stored_alerts`; None while it is open."""
    if row.ack_at is None:
        return None
    return Acknowledgement(row.id, row.ack_who, row.ack_why, row.ack_at)


def _delivery(row: Row[Any]) -> Delivery:
    owed = {name: getattr(row, f"owed_{name}") for name in _OWED}
    return Delivery(alert=_alert(row), **{**owed, "state": DeliveryState(row.owed_state)})
