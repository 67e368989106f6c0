"""Verbs on drifts, alerts and the outbox. An alert and its deliveries are one transaction."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import fields
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import alert_document
from shm.store.blobs import alert_from_document
from shm.store.database import Database, insert
from shm.store.results import all_at, move
from shm.store.rows import Baseline, Delivery, DeliveryState, Stage, StoredAlert, StoredTest
from shm.store.tables import alerts, deliveries, drifts, tests
from shm.values import Alert, Drift

_DRIFT_COLUMNS = tuple(field.name for field in fields(Drift) if field.name != "test")
_outbox = sa.select(deliveries, alerts.c.document).join(alerts)


class Watching(Database):
    """The part of the store that keeps drifts and owes alerts to hooks."""

    def watched(
        self,
        test: StoredTest,
        baseline: Baseline,
        shifts: Sequence[Drift],
        alert: Alert | None,
        hooks: Sequence[str],
        at: datetime,
    ) -> StoredAlert | None:
        """Keeps what the watch made of a test; the alert where it is a new one, else None.

        An alert whose key was raised before is the same standing condition and is not raised again.
        """
        with self.writing() as connection:
            if not all_at(connection, [test], Stage.UPDATED):
                return None
            for drift in shifts:
                insert(connection, drifts, _drift_values(drift, test, baseline))
            move(connection, [test], Stage.WATCHED)
            if alert is None or _is_raised(connection, alert):
                return None
            return _raise(connection, test, baseline, alert, hooks, at)

    def drifts(self, hanger: int | None = None, test: str | None = None) -> tuple[Drift, ...]:
        """Shifts from the baseline, by time; of one hanger or test where named."""
        query = sa.select(drifts, tests.c.name.label("test")).join(tests)
        if hanger is not None:
            query = query.where(drifts.c.hanger == hanger)
        if test is not None:
            query = query.where(tests.c.name == test)
        with self.reading() as connection:
            rows = connection.execute(query.order_by(drifts.c.time, drifts.c.id)).all()
        return tuple(Drift(test=r.test, **{n: getattr(r, n) for n in _DRIFT_COLUMNS}) for r in rows)

    def alerts(self, hanger: int | None = None) -> tuple[StoredAlert, ...]:
        """All alerts, or those of one hanger, as they were raised."""
        query = sa.select(alerts).order_by(alerts.c.id)
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(StoredAlert(r.id, alert_from_document(r.document), r.raised_at) for r in rows)

    def deliveries(self, state: DeliveryState | None = None) -> tuple[Delivery, ...]:
        """The outbox: what was told to which hook, or is still owed."""
        query = _outbox.order_by(deliveries.c.id)
        if state is not None:
            query = query.where(deliveries.c.state == state)
        return self._deliveries(query)

    def due_deliveries(
        self, now: datetime, limit: int, excluding: Collection[int] = ()
    ) -> tuple[Delivery, ...]:
        """Deliveries whose time has come, the longest due first."""
        due = (deliveries.c.state == DeliveryState.WAITING) & (deliveries.c.next_attempt_at <= now)
        query = _outbox.where(due, deliveries.c.id.not_in(excluding))
        return self._deliveries(query.order_by(deliveries.c.next_attempt_at).limit(limit))

    def delivered(self, delivery: Delivery, at: datetime) -> None:
        """Marks a delivery as done."""
        self._end(delivery, DeliveryState.DELIVERED, "", at)

    def delivery_failed(
        self, delivery: Delivery, error: str, at: datetime, next_attempt_at: datetime | None
    ) -> None:
        """Puts a delivery off, or gives it up where `next_attempt_at` is None."""
        if next_attempt_at is None:
            self._end(delivery, DeliveryState.GIVEN_UP, error, at)
        else:
            self._note(delivery, {"last_error": error, "next_attempt_at": next_attempt_at})

    def _end(self, delivery: Delivery, state: DeliveryState, error: str, at: datetime) -> None:
        self._note(delivery, {"state": state, "last_error": error, "ended_at": at})

    def _note(self, delivery: Delivery, values: dict[str, Any]) -> None:
        with self.writing() as connection:
            connection.execute(
                sa.update(deliveries)
                .where(deliveries.c.id == delivery.id)
                .values(attempts=deliveries.c.attempts + 1, **values)
            )

    def _deliveries(self, query: sa.Select[Any]) -> tuple[Delivery, ...]:
        with self.reading() as connection:
            return tuple(_delivery(row) for row in connection.execute(query))


def _is_raised(connection: Connection, alert: Alert) -> bool:
    query = sa.select(alerts.c.id).where(alerts.c.key == alert.key)
    return connection.execute(query).first() is not None


def _raise(
    connection: Connection,
    test: StoredTest,
    baseline: Baseline,
    alert: Alert,
    hooks: Sequence[str],
    at: datetime,
) -> StoredAlert:
    values = {
        **{name: getattr(alert, name) for name in ("key", "hanger", "time", "message")},
        "test_id": test.id,
        "baseline_id": baseline.id,
        "raised_at": at,
        "document": alert_document(alert),
    }
    alert_id = insert(connection, alerts, values)
    for hook in hooks:
        insert(connection, deliveries, _owed(alert_id, hook, at))
    return StoredAlert(alert_id, alert, at)


def _owed(alert_id: int, hook: str, at: datetime) -> dict[str, Any]:
    return {
        "alert_id": alert_id,
        "hook": hook,
        "state": DeliveryState.WAITING,
        "attempts": 0,
        "next_attempt_at": at,
        "last_error": "",
    }


def _drift_values(drift: Drift, test: StoredTest, baseline: Baseline) -> dict[str, Any]:
    values = {name: getattr(drift, name) for name in _DRIFT_COLUMNS}
    return {**values, "test_id": test.id, "baseline_id": baseline.id}


def _delivery(row: Row[Any]) -> Delivery:
    return Delivery(
        id=row.id,
        alert=alert_from_document(row.document),
        hook=row.hook,
        state=DeliveryState(row.state),
        attempts=row.attempts,
        next_attempt_at=row.next_attempt_at,
        last_error=row.last_error,
        ended_at=row.ended_at,
    )
