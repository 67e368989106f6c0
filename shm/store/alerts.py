"""Alerts, what each hook is owed of them, who has seen them, and when no hook is told.

An alert and what hooks are owed of it are one transaction.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
from datetime import datetime, timedelta
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import alert_document
from shm.errors import NothingThere, UsageError
from shm.store.columns import insert_value, value_in
from shm.store.database import Repository, insert
from shm.store.journal import NOTIFIED, note, write
from shm.store.rows import (
    AlertNote,
    Delivery,
    DeliveryState,
    Ending,
    EventKind,
    HangerEvent,
    News,
    Reconciled,
    Silence,
    StoredAlert,
    StoredTest,
    sum_counts,
)
from shm.store.tables import adoptions, alerts, baselines, deliveries, silences, tests
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
        "document": alert_document(alert),
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
    for alert_id, (ending, why) in changes.to_close.items():
        resolve(connection, alert_id, "shm", why, at, ending)
    raised = []
    for alert in changes.to_open:
        test_id = None
        if test is not None:
            of_alert = (tests.c.hanger == alert.hanger) & (tests.c.name == alert.test)
            one = sa.select(tests.c.id).where(of_alert, tests.c.superseded_at.is_(None))
            test_id = connection.scalar(one) or test.id
        raised.append(raise_alert(connection, test_id, baseline_id, alert, hooks, at))
    return tuple(each for each in raised if each is not None)


def resolve(
    connection: Connection,
    alert_id: int,
    who: str,
    why: str,
    at: datetime,
    ending: Ending = Ending.BY_PERSON,
) -> bool:
    """Notes that the condition of an alert ended; False where that is noted already.

    Each hook that was told of the alert is owed that news.
    """
    if not _note_on(connection, alert_id, "ended", who, why, at, kind=ending):
        return False
    notified = sa.select(deliveries.c.hook).where(
        deliveries.c.alert_id == alert_id,
        deliveries.c.news == News.RAISED,
        deliveries.c.state == DeliveryState.DELIVERED,
    )
    for hook in connection.scalars(notified.order_by(deliveries.c.id)).all():
        insert(connection, deliveries, _owed(alert_id, hook, News.RESOLVED, at))
    return True


def acknowledge(connection: Connection, alert_id: int, who: str, why: str, at: datetime) -> bool:
    """Note that somebody has seen an alert; return False where that is noted already."""
    return _note_on(connection, alert_id, "noted", who, why, at)


def _note_on(
    connection: Connection,
    alert_id: int,
    prefix: str,
    who: str,
    why: str,
    at: datetime,
    **more: Ending,
) -> bool:
    values = {"at": at, "who": who, "why": why, **more}
    note = {f"{prefix}_{name}": value for name, value in values.items()}
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
    """An alert with its acknowledgement and resolution, of a row of `stored_alerts`."""
    noted = row.noted_at and AlertNote(row.id, row.noted_who, row.noted_why, row.noted_at)
    ended = row.ended_at and AlertNote(
        row.id, row.ended_who, row.ended_why, row.ended_at, Ending(row.ended_kind)
    )
    return StoredAlert(row.id, row.document, row.raised_at, noted, ended, row.baseline_id)


_OWED = tuple(field.name for field in fields(Delivery) if field.name != "stored")
_outbox = stored_alerts.add_columns(
    *(deliveries.c[name].label(f"owed_{name}") for name in _OWED)
).join(deliveries, deliveries.c.alert_id == alerts.c.id)
_any_waits = sa.select(sa.exists().where(deliveries.c.state == DeliveryState.WAITING))


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
    write(connection, at, NOTIFIED, row.recording_id, row.id)


def _delivery(row: Row[Any]) -> Delivery:
    owed = {name: getattr(row, f"owed_{name}") for name in _OWED}
    return Delivery(stored=stored_alert(row), **owed)


class Alerts(Repository):
    """Alerts and the outbox: messages owed to hooks."""

    def list_all(
        self, hanger: int | None = None, *, standing: bool | None = None
    ) -> tuple[StoredAlert, ...]:
        """List alerts, the oldest first; of one hanger where named.

        Only those whose condition stands, or has ended, where `standing` tells.
        """
        query = stored_alerts.order_by(alerts.c.id)
        if standing is not None:
            query = query.where(alerts.c.ended_at.is_(None) == standing)
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        return tuple(stored_alert(row) for row in self.rows(query))

    def get(self, alert_id: int) -> StoredAlert:
        """Return one alert; raise NothingThere."""
        with self.reading() as connection:
            return alert_in(connection, alert_id)

    def resolve(self, alert_id: int, who: str, why: str, at: datetime) -> StoredAlert:
        """Notes that the condition of an alert ended, and acknowledges it where nobody has.

        Raises NothingThere where there is none of that number, UsageError where it is noted.
        """
        with self.writing() as connection:
            found = alert_in(connection, alert_id)
            if not resolve(connection, alert_id, who, why, at):
                raise UsageError(
                    f"alert {alert_id} is resolved already.", remedy="See `shm alerts`."
                )
            acknowledge(connection, alert_id, who, why, at)
            note(connection, at, "alert resolved", _describe(found), why, who)
            return alert_in(connection, alert_id)

    def settle(self, changes: Reconciled, hooks: Sequence[str], at: datetime) -> None:
        """Close and open alerts that no test's watch raises."""
        if not changes.to_open and not changes.to_close:
            return
        with self.writing() as connection:
            settle(connection, changes, hooks, at)

    def acknowledge(self, alert_id: int, who: str, why: str, at: datetime) -> StoredAlert:
        """Notes that somebody has seen an alert to its end; the alert with that note.

        Raises NothingThere where there is none of that number, UsageError where it is noted.
        """
        with self.writing() as connection:
            alert = alert_in(connection, alert_id)
            if alert.acknowledgement is not None:
                raise UsageError(
                    f"alert {alert_id} was acknowledged by {alert.acknowledgement.who} on "
                    f"{alert.acknowledgement.at:%Y-%m-%d} already.",
                    remedy="See `shm alerts`.",
                )
            acknowledge(connection, alert_id, who, why, at)
            note(connection, at, "alert acknowledged", _describe(alert), why, who)
        return replace(alert, acknowledgement=AlertNote(alert_id, who, why, at))

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
    ) -> tuple[Delivery, ...]:
        """List the first delivery of each message whose time has come, the longest due first.

        Also those that would wait longer than `waits` says for so many attempts, its last for more:
        the clock was ahead when they were put off.
        """
        with self.reading() as connection:
            if not connection.scalar(_any_waits):  # as a rule, and what follows takes six times it
                return ()
        at, tried = deliveries.c.next_attempt_at, deliveries.c.attempts
        is_counted = [tried == count for count in range(len(waits) - 1)] + [tried >= len(waits) - 1]
        too_far = [of & (at > now + wait) for of, wait in zip(is_counted, waits, strict=False)]
        is_first = deliveries.c.message_id == deliveries.c.id
        waits_now = (deliveries.c.state == DeliveryState.WAITING) & sa.or_(at <= now, *too_far)
        query = _outbox.where(is_first, waits_now, deliveries.c.id.not_in(excluding))
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
        message_ids = sa.select(deliveries.c.message_id).where(
            deliveries.c.alert_id == alert_id, given_up
        )
        with self.writing() as connection:
            alert_in(connection, alert_id)
            of_alert = sa.select(deliveries.c.id).where(deliveries.c.alert_id == alert_id, given_up)
            ids = connection.scalars(of_alert).all()
            if not ids:
                raise UsageError(
                    f"alert {alert_id} was given up by no hook.", remedy="See `shm alerts`."
                )
            messages = [each for each in connection.scalars(message_ids) if each is not None]
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


def _describe(stored: StoredAlert) -> str:
    return f"alert {stored.id}, hanger {stored.alert.hanger}"


class Silences(Repository):
    """Silences, made and ended by people."""

    def make(
        self,
        hanger: int | None,
        period: tuple[datetime, datetime],
        who: str,
        why: str,
        at: datetime,
        *,
        is_maintenance: bool = False,
    ) -> Silence:
        """Holds messages on a hanger, or on all where None, back over a `period` from and until.

        Raises UsageError where the period has no length or is over.
        """
        starts_at, ends_at = period
        if ends_at <= max(starts_at, at):
            raise UsageError(
                "a silence must end after it begins, and in the future.",
                remedy="Give a later --until.",
            )
        made = Silence(0, hanger, starts_at, ends_at, is_maintenance, who, why, at)
        with self.writing() as connection:
            made = insert_value(connection, silences, made)
            period_text = f"{starts_at:%Y-%m-%d %H:%M} to {ends_at:%Y-%m-%d %H:%M} UTC"
            subject = f"{_silence_named(made)}, {period_text}"
            note(connection, at, f"{kind_of(made)} made", subject, why, who)
            return made

    def end(self, silence_id: int, who: str, at: datetime) -> Silence:
        """Ends a silence before its time; raises NothingThere, or UsageError where it is over."""
        with self.writing() as connection:
            query = sa.select(silences).where(silences.c.id == silence_id)
            row = connection.execute(query).one_or_none()
            if row is None:
                raise NothingThere(f"no silence {silence_id}.", remedy="See `shm alerts silences`.")
            found = value_in(row, Silence)
            if found.until <= at or found.ended_at is not None:
                raise UsageError(
                    f"silence {silence_id} is over.", remedy="See `shm alerts silences`."
                )
            ended = {"ended_at": at, "ended_who": who}
            one = sa.update(silences).where(silences.c.id == silence_id)
            connection.execute(one.values(**ended))
            note(connection, at, f"{kind_of(found)} ended", _silence_named(found), who=who)
            return replace(found, ended_at=at, ended_who=who)

    def list_all(self) -> tuple[Silence, ...]:
        """All that were ever made, the oldest first."""
        query = sa.select(silences).order_by(silences.c.id)
        return tuple(value_in(row, Silence) for row in self.rows(query))


def silenced_until(silences: tuple[Silence, ...], hanger: int, at: datetime) -> datetime | None:
    """Return when hooks are told of a hanger again, silences one after the other.

    None where they are.
    """
    until = at
    while ends := [each.until for each in silences if each.covers(hanger, until)]:
        until = max(ends)
    return None if until == at else until


def describe_silence(silence: Silence) -> str:
    """A silence or a maintenance window in words: what it keeps from whom, until when, and why."""
    of = hangers_of(silence.hanger)
    effect = f"hooks receive nothing about {of}"
    if silence.is_maintenance:
        effect = f"tests of {of} are not compared with the baseline, and hooks receive nothing,"
    return (
        f"{kind_of(silence)} {silence.id}: {effect} until {silence.until:%Y-%m-%d %H:%M} UTC "
        f"({silence.who}: {silence.why})"
    )


def kind_of(silence: Silence) -> str:
    """Return the name of its kind."""
    return "maintenance window" if silence.is_maintenance else "silence"


def hangers_of(hanger: int | None) -> str:
    """Whom a silence is about."""
    return "all hangers" if hanger is None else f"hanger {hanger}"


def _silence_named(silence: Silence) -> str:
    return f"{kind_of(silence)} {silence.id}, {hangers_of(silence.hanger)}"


_is_open = alerts.c.noted_at.is_(None) & alerts.c.ended_at.is_(None)
_closed_at = sa.func.coalesce(alerts.c.noted_at, alerts.c.ended_at)


def list_alert_page(
    store: Repository,
    hanger: int | None = None,
    *,
    is_open: bool | None = None,
    limit: int | None = None,
    before: int | None = None,
) -> tuple[StoredAlert, ...]:
    """List alerts, the newest first; `before` is the number of the alert to go on after.

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
    return tuple(stored_alert(row) for row in store.rows(query.limit(limit)))


def count_raised(store: Repository) -> int:
    """Count all alerts that were ever raised."""
    return int(store.scalar(sa.select(sa.func.count(alerts.c.id))))


def count_alerts(store: Repository) -> tuple[int, int]:
    """Count the open and the acknowledged alerts."""
    noted = store.scalar(sa.select(sa.func.count(alerts.c.noted_at)))
    return sum(count_open_alerts(store).values()), int(noted or 0)


def count_open_alerts(store: Repository) -> dict[int, int]:
    """Count the open alerts of each hanger; hangers without any are left out.

    The only place where they are counted: whoever states a number of them asks here.
    """
    query = sa.select(alerts.c.hanger, sa.func.count())
    rows = store.rows(query.where(_is_open).group_by(alerts.c.hanger))
    return {row[0]: int(row[1]) for row in rows}


def list_hanger_events(
    store: Repository, hanger: int, since: datetime | None = None
) -> tuple[HangerEvent, ...]:
    """List the events of a hanger other than its tests, by time."""
    with store.reading() as connection:
        found = [
            HangerEvent(row.at, kind, row.who or "", row.why or "", row.id)
            for kind, query in _events(hanger).items()
            for row in connection.execute(query)
        ]
    late = (event for event in found if since is None or event.at >= since)
    return tuple(sorted(late, key=lambda event: event.at))


def count_deliveries(store: Repository) -> dict[str, int]:
    """Count the deliveries in each state; see `sum_counts`."""
    query = sa.select(sa.type_coerce(deliveries.c.state, sa.Text), sa.func.count()).group_by(
        deliveries.c.state
    )
    return sum_counts(DeliveryState, store.rows(query))


def _events(hanger: int) -> dict[EventKind, sa.Select[Any]]:
    noted = _labelled(alerts, "noted_at", "noted_who", "noted_why")
    undone = _labelled(adoptions, "undone_at", "undone_who", "undone_why")
    raised = sa.select(
        alerts.c.id,
        alerts.c.time.label("at"),
        sa.null().label("who"),
        alerts.c.message.label("why"),
    )
    return {
        EventKind.BASELINE: _of(hanger, baselines, _labelled(baselines, "set_at", "who", "why")),
        EventKind.ADOPTED: _of(hanger, adoptions, _labelled(adoptions, "adopted_at", "who", "why")),
        EventKind.UNDONE: _of(hanger, adoptions, undone.where(adoptions.c.undone_at.is_not(None))),
        EventKind.ALERT: _of(hanger, alerts, raised),
        EventKind.ACKNOWLEDGED: _of(hanger, alerts, noted.where(alerts.c.noted_at.is_not(None))),
    }


def _is_after(alert_id: int, *, is_open: bool | None) -> sa.ColumnElement[bool]:
    """Select the alerts after one in a list of `list_alert_page`."""
    older = alerts.c.id < alert_id
    if is_open is not False:
        return older
    one = alerts.alias()
    closed_at = sa.func.coalesce(one.c.noted_at, one.c.ended_at)
    of_one = sa.select(closed_at).where(one.c.id == alert_id).scalar_subquery()
    return (_closed_at < of_one) | ((_closed_at == of_one) & older)


def _labelled(table: sa.Table, at: str, who: str, why: str) -> sa.Select[Any]:
    named = {"at": at, "who": who, "why": why}
    return sa.select(table.c.id, *(table.c[name].label(label) for label, name in named.items()))


def _of(hanger: int, table: sa.Table, query: sa.Select[Any]) -> sa.Select[Any]:
    return query.where(table.c.hanger == hanger).order_by(table.c.id)
