"""Alerts, who has seen them, and their deliveries. An alert and those are one transaction."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere, UsageError
from shm.store.database import Repository, insert
from shm.store.files import NOTIFIED, write_step
from shm.store.list_rows import AlertRow, DeliveryRow, EventKind, HangerEvent
from shm.store.outbox import (
    acknowledgement_of,
    owe_resolution,
    resolution_of,
    resolve,
    stored_alert,
    stored_alerts,
)
from shm.store.rows import (
    Acknowledgement,
    Delivery,
    DeliveryState,
    News,
    StoredAlert,
    counts_by_name,
)
from shm.store.tables import (
    acknowledgements,
    adoptions,
    alerts,
    baselines,
    deliveries,
    resolutions,
    steps,
    tests,
)

_OWED = (
    "id",
    "hook",
    "news",
    "state",
    "attempts",
    "next_attempt_at",
    "last_error",
    "ended_at",
    "message_id",
)
_outbox = stored_alerts.add_columns(
    *(deliveries.c[name].label(f"owed_{name}") for name in _OWED)
).join(deliveries, deliveries.c.alert_id == alerts.c.id)
_is_open = acknowledgements.c.id.is_(None) & resolutions.c.id.is_(None)
"""Of `stored_alerts`, and of whatever joins both tables: what `StoredAlert.is_open` says."""
_closed_at = sa.func.coalesce(acknowledgements.c.at, resolutions.c.at)
_any_waits = sa.select(sa.exists().where(deliveries.c.state == DeliveryState.WAITING))


class Alerts(Repository):
    """Alerts and the outbox."""

    def list_all(
        self,
        hanger: int | None = None,
        baseline_id: int | None = None,
        *,
        standing: bool | None = None,
    ) -> tuple[StoredAlert, ...]:
        """Alerts as they were raised and acknowledged, the oldest first; of a hanger, against a
        baseline where these are named, and only those whose condition stands, or has ended, where
        `standing` tells.
        """
        query = stored_alerts.order_by(alerts.c.id)
        if standing is not None:
            query = query.where(resolutions.c.id.is_(None) == standing)
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        if baseline_id is not None:
            query = query.where(alerts.c.baseline_id == baseline_id)
        with self.reading() as connection:
            return tuple(stored_alert(row) for row in connection.execute(query))

    def list_rows(
        self,
        hanger: int | None = None,
        *,
        is_open: bool | None = None,
        limit: int | None = None,
        before: int | None = None,
    ) -> tuple[AlertRow, ...]:
        """Alerts, the newest first; `before` is the number of the alert to go on after.

        Only those that are open, or that are acknowledged or resolved, where `is_open` tells; the
        latter come in the order in which they were, the latest first.
        """
        query = stored_alerts
        if is_open is False:
            query = query.order_by(_closed_at.desc())
        query = query.order_by(alerts.c.id.desc())
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        if is_open is not None:
            query = query.where(_is_open if is_open else sa.not_(_is_open))
        if before is not None:
            query = query.where(_is_after(before, is_open=is_open))
        return self._alert_rows(query.limit(limit))

    def row(self, alert_id: int) -> AlertRow:
        """One alert; raises NothingThere."""
        found = self._alert_rows(stored_alerts.where(alerts.c.id == alert_id))
        if not found:
            raise NothingThere(f"no alert {alert_id}.", remedy="See `shm alerts`.")
        return found[0]

    def resolve(self, alert_id: int, who: str, why: str, at: datetime) -> StoredAlert:
        """Notes that the condition of an alert ended, and acknowledges it where nobody has.

        Raises NothingThere where there is none of that number, UsageError where it is noted.
        """
        with self.writing() as connection:
            found = _alert(connection, alert_id)
            if not resolve(connection, alert_id, who, why, at):
                raise UsageError(
                    f"alert {alert_id} is resolved already.", remedy="See `shm alerts`."
                )
            if found.acknowledgement is None:
                noted = Acknowledgement(alert_id, who, why, at)
                insert(connection, acknowledgements, vars(noted))
            return _alert(connection, alert_id)

    def acknowledge(self, alert_id: int, who: str, why: str, at: datetime) -> StoredAlert:
        """Notes that somebody has seen an alert to its end; the alert with that note.

        Raises NothingThere where there is none of that number, UsageError where it is noted.
        """
        with self.writing() as connection:
            alert = _alert(connection, alert_id)
            if alert.acknowledgement is not None:
                raise UsageError(
                    f"alert {alert_id} was acknowledged by {alert.acknowledgement.who} on "
                    f"{alert.acknowledgement.at:%Y-%m-%d} already.",
                    remedy="See `shm alerts`.",
                )
            noted = Acknowledgement(alert_id, who, why, at)
            insert(connection, acknowledgements, vars(noted))
        return replace(alert, acknowledgement=noted)

    def counts(self) -> tuple[int, int]:
        """How many alerts are open, and how many were acknowledged."""
        with self.reading() as connection:
            noted = connection.scalar(sa.select(sa.func.count()).select_from(acknowledgements))
        return sum(self.open_counts().values()), int(noted or 0)

    def open_counts(self) -> dict[int, int]:
        """How many alerts of each hanger are open; hangers without any are left out.

        The only place where they are counted: whoever states a number of them asks here.
        """
        query = (
            sa.select(alerts.c.hanger, sa.func.count())
            .select_from(alerts)
            .outerjoin(acknowledgements, acknowledgements.c.alert_id == alerts.c.id)
            .outerjoin(resolutions, resolutions.c.alert_id == alerts.c.id)
        )
        with self.reading() as connection:
            rows = connection.execute(query.where(_is_open).group_by(alerts.c.hanger))
            return {row[0]: int(row[1]) for row in rows}

    def list_hanger_events(
        self, hanger: int, since: datetime | None = None
    ) -> tuple[HangerEvent, ...]:
        """What happened to a hanger beside its tests, by time."""
        with self.reading() as connection:
            found = [
                HangerEvent(row.at, kind, row.who or "", row.why or "", row.id)
                for kind, query in _events(hanger).items()
                for row in connection.execute(query)
            ]
        late = (event for event in found if since is None or event.at >= since)
        return tuple(sorted(late, key=lambda event: event.at))

    def list_deliveries(self, state: DeliveryState | None = None) -> tuple[Delivery, ...]:
        """The outbox: what was told to which hook, or is still owed."""
        query = _outbox.order_by(deliveries.c.id)
        if state is not None:
            query = query.where(deliveries.c.state == state)
        return self._deliveries(query)

    def list_unsent(self) -> tuple[Delivery, ...]:
        """Deliveries whose first attempt has not begun, in the order in which they were owed."""
        waiting = deliveries.c.state == DeliveryState.WAITING
        query = _outbox.where(waiting, deliveries.c.message_id.is_(None))
        return self._deliveries(query.order_by(deliveries.c.id))

    def list_of_messages(self, message_ids: Collection[int]) -> tuple[Delivery, ...]:
        """The deliveries of messages, in their order."""
        query = _outbox.where(deliveries.c.message_id.in_(message_ids))
        return self._deliveries(query.order_by(deliveries.c.id))

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
        counts = [tried == count for count in range(len(waits) - 1)] + [tried >= len(waits) - 1]
        too_far = [of & (at > now + wait) for of, wait in zip(counts, waits, strict=False)]
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
            _alert(connection, alert_id)
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

    def delivery_counts(self) -> dict[str, int]:
        """How many deliveries stand in each state; see `counts_by_name`."""
        query = sa.select(deliveries.c.state, sa.func.count()).group_by(deliveries.c.state)
        with self.reading() as connection:
            return counts_by_name(DeliveryState, connection.execute(query))

    def _end(self, delivery: Delivery, state: DeliveryState, error: str, at: datetime) -> None:
        with self.writing() as connection:
            ended = {"state": state, "last_error": error, "ended_at": at}
            for row in _note(connection, delivery, ended):
                if row.news == News.RAISED:
                    _note_notified(connection, row.id, at)
                    if state is DeliveryState.DELIVERED:
                        owe_resolution(connection, row.alert_id, row.hook, at)

    def _deliveries(self, query: sa.Select[Any]) -> tuple[Delivery, ...]:
        with self.reading() as connection:
            return tuple(_delivery(row) for row in connection.execute(query))

    def _alert_rows(self, query: sa.Select[Any]) -> tuple[AlertRow, ...]:
        with self.reading() as connection:
            rows = connection.execute(query).all()
            owed = _deliveries_of(connection, query)
        return tuple(_row(row, tuple(owed[row.id])) for row in rows)


def _is_after(alert_id: int, *, is_open: bool | None) -> sa.ColumnElement[bool]:
    """Which alerts stand after one in a list of `list_rows`."""
    older = alerts.c.id < alert_id
    if is_open is not False:
        return older
    tables = alerts.outerjoin(acknowledgements, acknowledgements.c.alert_id == alerts.c.id)
    tables = tables.outerjoin(resolutions, resolutions.c.alert_id == alerts.c.id)
    at = sa.select(_closed_at).select_from(tables).where(alerts.c.id == alert_id)
    of_one = at.correlate(None).scalar_subquery()
    return (_closed_at < of_one) | ((_closed_at == of_one) & older)


def _alert(connection: Connection, alert_id: int) -> StoredAlert:
    """The alert of a number; raises NothingThere."""
    row = connection.execute(stored_alerts.where(alerts.c.id == alert_id)).one_or_none()
    if row is None:
        raise NothingThere(f"no alert {alert_id}.", remedy="See `shm alerts`.")
    return stored_alert(row)


def _deliveries_of(
    connection: Connection, chosen: sa.Select[Any]
) -> defaultdict[int, list[DeliveryRow]]:
    """Of the alerts that are chosen, by alert."""
    ids = sa.select(chosen.subquery().c.id)
    query = sa.select(deliveries).where(deliveries.c.alert_id.in_(ids)).order_by(deliveries.c.id)
    found = defaultdict[int, list[DeliveryRow]](list)
    for row in connection.execute(query):
        one = DeliveryRow(
            row.hook, DeliveryState(row.state), row.attempts, row.last_error, News(row.news)
        )
        found[row.alert_id].append(one)
    return found


def _row(row: Row[Any], owed: tuple[DeliveryRow, ...]) -> AlertRow:
    alert = stored_alert(row).alert
    return AlertRow(
        id=row.id,
        hanger=row.hanger,
        raised_at=row.raised_at,
        test=alert.test,
        test_time=row.time,
        kinds=alert.kinds,
        message=alert.message,
        acknowledgement=acknowledgement_of(row),
        deliveries=owed,
        resolution=resolution_of(row),
    )


def _note(connection: Connection, delivery: Delivery, values: dict[str, Any]) -> Sequence[Row[Any]]:
    """Those of the message that were still owed: another process may have had an answer before.

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
        of_alert,
        deliveries.c.state == DeliveryState.WAITING,
        deliveries.c.news == News.RAISED,
    )
    if connection.execute(waiting).first() is not None:
        return
    about = sa.select(tests.c.recording_id, tests.c.id).join(alerts)
    row = connection.execute(about.where(alerts.c.id == siblings.scalar_subquery())).one()
    if _notified_steps(connection, row.id) < _told_alerts(connection, row.id):
        write_step(connection, row.recording_id, NOTIFIED, at, row.id)


def _notified_steps(connection: Connection, test_id: int) -> int:
    of_test = (steps.c.test_id == test_id) & (steps.c.stage == NOTIFIED)
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
    as_named = {"state": DeliveryState(row.owed_state), "news": News(row.owed_news)}
    return Delivery(stored=stored_alert(row), **{**owed, **as_named})


def _events(hanger: int) -> dict[EventKind, sa.Select[Any]]:
    noted = sa.select(acknowledgements).join(alerts).where(alerts.c.hanger == hanger)
    undone = _named(adoptions, "undone_at", "undone_who", "undone_why")
    raised = sa.select(
        alerts.c.id,
        alerts.c.time.label("at"),
        sa.null().label("who"),
        alerts.c.message.label("why"),
    )
    return {
        EventKind.BASELINE: _of(hanger, baselines, _named(baselines, "set_at", "who", "why")),
        EventKind.ADOPTED: _of(hanger, adoptions, _named(adoptions, "adopted_at", "who", "why")),
        EventKind.UNDONE: _of(hanger, adoptions, undone.where(adoptions.c.undone_at.is_not(None))),
        EventKind.ALERT: _of(hanger, alerts, raised),
        EventKind.ACKNOWLEDGED: noted,
    }


def _of(hanger: int, table: sa.Table, query: sa.Select[Any]) -> sa.Select[Any]:
    return query.where(table.c.hanger == hanger).order_by(table.c.id)


def _named(table: sa.Table, at: str, who: str, why: str) -> sa.Select[Any]:
    named = {"at": at, "who": who, "why": why}
    return sa.select(table.c.id, *(table.c[name].label(label) for label, name in named.items()))
