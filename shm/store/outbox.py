"""Alerts as rows, and the outbox: what each hook is owed of them, told, put off or given up."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from datetime import datetime, timedelta
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import alert_document
from shm.errors import NothingThere, UsageError
from shm.store.database import Repository, insert
from shm.store.journal import NOTIFIED, write
from shm.store.rows import (
    Acknowledgement,
    Delivery,
    DeliveryState,
    News,
    Reconciled,
    Resolution,
    StoredAlert,
    StoredTest,
)
from shm.store.tables import alerts, deliveries, journal, tests
from shm.values import Alert

stored_alerts = sa.select(alerts)


def raise_alert(
    connection: Connection,
    test_id: int | None,
    baseline_id: int | None,
    alert: Alert,
    hooks: Sequence[str],
    at: datetime,
) -> StoredAlert | None:
    """Keeps an alert and what is owed to each hook; None where one of its key was raised before."""
    known = sa.select(alerts.c.id).where(alerts.c.key == alert.key)
    if connection.execute(known).first() is not None:
        return None
    values = {
        **{name: getattr(alert, name) for name in ("key", "hanger", "time", "message")},
        "test_id": test_id,
        "baseline_id": baseline_id,
        "raised_at": at,
        # Names its hooks, so that a delivery that is gone is missed.
        "document": {**alert_document(alert), "hooks": list(hooks)},
    }
    alert_id = insert(connection, alerts, values)
    for hook in hooks:
        insert(connection, deliveries, _owed(alert_id, hook, News.RAISED, at))
    return StoredAlert(alert_id, alert, at, baseline_id=baseline_id)


def settle(
    connection: Connection,
    changes: Reconciled,
    hooks: Sequence[str],
    at: datetime,
    test: StoredTest | None = None,
    baseline_id: int | None = None,
) -> tuple[StoredAlert, ...]:
    """Close and open alerts; return those that are new.

    With a `test` they are against a baseline, and each belongs to the test that it names.
    """
    for alert_id, why in changes.to_close.items():
        resolve(connection, alert_id, "shm", why, at)
    raised = []
    for alert in changes.to_open:
        test_id = None if test is None else _named(connection, alert, test)
        raised.append(raise_alert(connection, test_id, baseline_id, alert, hooks, at))
    return tuple(each for each in raised if each is not None)


def _named(connection: Connection, alert: Alert, test: StoredTest) -> int:
    """Return the number of the test that an alert names, of `test` where there is no such."""
    own = (tests.c.hanger == alert.hanger) & (tests.c.name == alert.test)
    found = connection.scalar(sa.select(tests.c.id).where(own, tests.c.superseded_at.is_(None)))
    return test.id if found is None else int(found)


def resolve(connection: Connection, alert_id: int, who: str, why: str, at: datetime) -> bool:
    """Notes that the condition of an alert ended; False where that is noted already.

    Each hook that was told of the alert is owed that news.
    """
    if not _note_on(connection, alert_id, "ended", who, why, at):
        return False
    told = sa.select(deliveries.c.hook).where(
        deliveries.c.alert_id == alert_id,
        deliveries.c.news == News.RAISED,
        deliveries.c.state == DeliveryState.DELIVERED,
    )
    for hook in connection.scalars(told.order_by(deliveries.c.id)).all():
        insert(connection, deliveries, _owed(alert_id, hook, News.RESOLVED, at))
    return True


def acknowledge(connection: Connection, alert_id: int, who: str, why: str, at: datetime) -> bool:
    """Note that somebody has seen an alert; return False where that is noted already."""
    return _note_on(connection, alert_id, "noted", who, why, at)


def _note_on(
    connection: Connection, alert_id: int, prefix: str, who: str, why: str, at: datetime
) -> bool:
    note = {f"{prefix}_at": at, f"{prefix}_who": who, f"{prefix}_why": why}
    return bool(connection.execute(_ONCE[prefix], {"alert": alert_id, **note}).rowcount)


_ONCE = {
    prefix: sa.update(alerts).where(
        alerts.c.id == sa.bindparam("alert"), alerts.c[f"{prefix}_at"].is_(None)
    )
    for prefix in ("noted", "ended")
}


def owe_resolution(connection: Connection, alert_id: int, hook: str, at: datetime) -> None:
    """A hook that was told of an alert after its condition ended is owed that news too."""
    ended = sa.select(alerts.c.id).where(alerts.c.id == alert_id, alerts.c.ended_at.is_not(None))
    owed = sa.select(deliveries.c.id).where(
        deliveries.c.alert_id == alert_id,
        deliveries.c.hook == hook,
        deliveries.c.news == News.RESOLVED,
    )
    if connection.execute(ended).first() and connection.execute(owed).first() is None:
        insert(connection, deliveries, _owed(alert_id, hook, News.RESOLVED, at))


def _owed(alert_id: int, hook: str, news: News, at: datetime) -> dict[str, Any]:
    return {
        "alert_id": alert_id,
        "hook": hook,
        "news": news,
        "state": DeliveryState.WAITING,
        "attempts": 0,
        "next_attempt_at": at,
        "last_error": "",
    }


def stored_alert(row: Row[Any]) -> StoredAlert:
    """An alert and its acknowledgement, of a row of `stored_alerts`."""
    return StoredAlert(
        row.id,
        row.document,
        row.raised_at,
        acknowledgement_of(row),
        resolution_of(row),
        row.baseline_id,
    )


def acknowledgement_of(row: Row[Any]) -> Acknowledgement | None:
    """Return the acknowledgement in a row of `stored_alerts`; None while it is open."""
    if row.noted_at is None:
        return None
    return Acknowledgement(row.id, row.noted_who, row.noted_why, row.noted_at)


def resolution_of(row: Row[Any]) -> Resolution | None:
    """Return the resolution in a row of `stored_alerts`; None while its condition holds."""
    if row.ended_at is None:
        return None
    return Resolution(row.id, row.ended_who, row.ended_why, row.ended_at)


_OWED = tuple(field.name for field in fields(Delivery) if field.name != "stored")
_outbox = stored_alerts.add_columns(
    *(deliveries.c[name].label(f"owed_{name}") for name in _OWED)
).join(deliveries, deliveries.c.alert_id == alerts.c.id)
_any_waits = sa.select(sa.exists().where(deliveries.c.state == DeliveryState.WAITING))


class Deliveries(Repository):
    """Messages owed to hooks; a part of the repository of alerts."""

    def list_deliveries(
        self,
        state: DeliveryState | None = None,
        *,
        unsent: bool = False,
        messages: Collection[int] | None = None,
        alert_ids: Collection[int] | None = None,
    ) -> tuple[Delivery, ...]:
        """Return what was told to which hook, or is still owed, in the order in which it was owed.

        Of one state; those `unsent`, whose first attempt has not begun; of messages or alerts.
        """
        query = _outbox.order_by(deliveries.c.id)
        if state is not None:
            query = query.where(deliveries.c.state == state)
        if unsent:
            query = query.where(deliveries.c.message_id.is_(None))
        if messages is not None:
            query = query.where(deliveries.c.message_id.in_(messages))
        if alert_ids is not None:
            query = query.where(deliveries.c.alert_id.in_(alert_ids))
        return self._deliveries(query)

    def begin_messages(
        self, messages: Sequence[Sequence[int]], not_needed: Mapping[int, str], at: datetime
    ) -> None:
        """Makes messages of deliveries for good, and ends those that nobody needs, with the reason.

        From here on a message keeps its deliveries and its number, whatever is killed when.
        """
        if not messages and not not_needed:
            return
        unsent = (deliveries.c.state == DeliveryState.WAITING) & deliveries.c.message_id.is_(None)
        with self.writing() as connection:
            for ids in messages:
                begun = sa.update(deliveries).where(deliveries.c.id.in_(ids), unsent)
                connection.execute(begun.values(message_id=min(ids), next_attempt_at=at))
            for id_, why in not_needed.items():
                ended = {"state": DeliveryState.NOT_NEEDED, "last_error": why, "ended_at": at}
                one = sa.update(deliveries).where(deliveries.c.id == id_, unsent)
                if connection.execute(one.values(**ended)).rowcount:
                    _note_notified(connection, id_, at)

    def list_due_deliveries(
        self,
        now: datetime,
        limit: int,
        excluding: Collection[int] = (),
        waits: Sequence[timedelta] = (),
        *,
        begun: bool = False,
    ) -> tuple[Delivery, ...]:
        """Deliveries whose time has come, the longest due first; of each message the first alone.

        With `begun` only of messages: others, which may wait for months, must not fill the limit.

        Also those that would wait longer than `waits` says for so many attempts, its last for more:
        the clock was ahead when they were put off.
        """
        with self.reading() as connection:
            if not connection.scalar(_any_waits):  # as a rule, and what follows takes six times it
                return ()
        at, tried = deliveries.c.next_attempt_at, deliveries.c.attempts
        is_counted = [tried == count for count in range(len(waits) - 1)] + [tried >= len(waits) - 1]
        too_far = [of & (at > now + wait) for of, wait in zip(is_counted, waits, strict=False)]
        own = sa.func.coalesce(deliveries.c.message_id, deliveries.c.id) == deliveries.c.id
        due = (deliveries.c.state == DeliveryState.WAITING) & own & sa.or_(at <= now, *too_far)
        if begun:
            due &= deliveries.c.message_id.is_not(None)
        query = _outbox.where(due, deliveries.c.id.not_in(excluding))
        return self._deliveries(query.order_by(deliveries.c.next_attempt_at).limit(limit))

    def save_delivery(self, delivery: Delivery, at: datetime) -> None:
        """Marks a delivery, with its whole message, as done; what has ended stays as it is."""
        self._end(delivery, DeliveryState.DELIVERED, "", at)

    def save_failure(
        self, delivery: Delivery, error: str, at: datetime, next_attempt_at: datetime | None
    ) -> None:
        """Puts a delivery off, with its message, or gives it up where `next_attempt_at` is None."""
        if next_attempt_at is None:
            self._end(delivery, DeliveryState.GIVEN_UP, error, at)
        else:
            with self.writing() as connection:
                waits = {"last_error": error, "next_attempt_at": next_attempt_at}
                _note(connection, delivery, waits)

    def resend(self, alert_id: int, at: datetime) -> tuple[Delivery, ...]:
        """Owes an alert anew to the hooks that it was given up by, with the whole message that it
        went as; the deliveries of the alert that wait again.

        Raises NothingThere where there is none of that number, UsageError where none was given up.
        """
        given_up = deliveries.c.state == DeliveryState.GIVEN_UP
        own = sa.select(deliveries.c.message_id).where(deliveries.c.alert_id == alert_id, given_up)
        with self.writing() as connection:
            alert_in(connection, alert_id)
            of_alert = sa.select(deliveries.c.id).where(deliveries.c.alert_id == alert_id, given_up)
            ids = connection.scalars(of_alert).all()
            if not ids:
                raise UsageError(
                    f"alert {alert_id} was given up by no hook.", remedy="See `shm alerts`."
                )
            messages = [each for each in connection.scalars(own) if each is not None]
            again = given_up & (deliveries.c.message_id.in_(messages) | deliveries.c.id.in_(ids))
            waits = {
                "state": DeliveryState.WAITING,
                "attempts": 0,
                "next_attempt_at": at,
                "ended_at": None,
            }
            connection.execute(sa.update(deliveries).where(again).values(**waits))
        return self._deliveries(_outbox.where(deliveries.c.id.in_(ids)).order_by(deliveries.c.id))

    def _end(self, delivery: Delivery, state: DeliveryState, error: str, at: datetime) -> None:
        with self.writing() as connection:
            ended = {"state": state, "last_error": error, "ended_at": at}
            for row in _note(connection, delivery, ended):
                if row.news == News.RAISED:
                    _note_notified(connection, row.id, at)
                    if state is DeliveryState.DELIVERED:
                        owe_resolution(connection, row.alert_id, row.hook, at)

    def _deliveries(self, query: sa.Select[Any]) -> tuple[Delivery, ...]:
        return tuple(_delivery(row) for row in self.rows(query))


def alert_in(connection: Connection, alert_id: int) -> StoredAlert:
    """The alert of a number; raises NothingThere."""
    row = connection.execute(stored_alerts.where(alerts.c.id == alert_id)).one_or_none()
    if row is None:
        raise NothingThere(f"no alert {alert_id}.", remedy="See `shm alerts`.")
    return stored_alert(row)


def _note(connection: Connection, delivery: Delivery, values: dict[str, Any]) -> Sequence[Row[Any]]:
    """Update the deliveries of a message that are still owed; return these.

    What is tried is a message, if only of one alert.
    """
    first = deliveries.c.id if delivery.message_id is None else deliveries.c.message_id
    owed = (first == (delivery.message_id or delivery.id)) & (
        deliveries.c.state == DeliveryState.WAITING
    )
    columns = (deliveries.c[name] for name in ("id", "alert_id", "hook", "news"))
    rows = connection.execute(sa.select(*columns).where(owed).order_by(deliveries.c.id)).all()
    changed = sa.update(deliveries).where(owed)
    message_id = sa.func.coalesce(deliveries.c.message_id, deliveries.c.id)
    tried = {"attempts": deliveries.c.attempts + 1, "message_id": message_id}
    connection.execute(changed.values(**tried, **values))
    return rows


def _note_notified(connection: Connection, delivery_id: int, at: datetime) -> None:
    """The test of an alert has come to its end once no hook is owed it any more."""
    siblings = sa.select(deliveries.c.alert_id).where(deliveries.c.id == delivery_id)
    of_alert = deliveries.c.alert_id == siblings.scalar_subquery()
    waiting = sa.select(deliveries.c.id).where(
        of_alert, deliveries.c.state == DeliveryState.WAITING, deliveries.c.news == News.RAISED
    )
    if connection.execute(waiting).first() is not None:
        return
    about = sa.select(tests.c.recording_id, tests.c.id).join(alerts)
    row = connection.execute(about.where(alerts.c.id == siblings.scalar_subquery())).one_or_none()
    if row is None:  # raised by readings of a stream
        return
    if _notified_steps(connection, row.id) < _told_alerts(connection, row.id):
        write(connection, at, NOTIFIED, row.recording_id, row.id)


def _notified_steps(connection: Connection, test_id: int) -> int:
    of_test = (journal.c.test_id == test_id) & (journal.c.kind == NOTIFIED)
    return int(connection.scalar(sa.select(sa.func.count()).where(of_test)) or 0)


def _told_alerts(connection: Connection, test_id: int) -> int:
    """Alerts of a test that no hook is owed any more: one that is sent again was told before."""
    raised = (deliveries.c.alert_id == alerts.c.id) & (deliveries.c.news == News.RAISED)
    waiting = raised & (deliveries.c.state == DeliveryState.WAITING)
    told = sa.exists().where(raised) & ~sa.exists().where(waiting)
    query = sa.select(sa.func.count()).select_from(alerts)
    return int(connection.scalar(query.where(alerts.c.test_id == test_id, told)) or 0)


def _delivery(row: Row[Any]) -> Delivery:
    owed = {name: getattr(row, f"owed_{name}") for name in _OWED}
    return Delivery(stored=stored_alert(row), **owed)
