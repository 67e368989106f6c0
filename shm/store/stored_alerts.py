"""Alerts and who has seen them. An alert and what hooks are owed of it are one transaction.

Silences and maintenance windows: who wants which hooks' messages held back, when and why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import sqlalchemy as sa

from shm.errors import NothingThere, UsageError
from shm.store.database import Repository
from shm.store.journal import note
from shm.store.mapping import insert_value, value_in
from shm.store.outbox import (
    Deliveries,
    acknowledge,
    alert_in,
    resolve,
    settle,
    stored_alert,
    stored_alerts,
)
from shm.store.rows import Acknowledgement, Reconciled, Silence, StoredAlert
from shm.store.tables import alerts, silences


class Alerts(Deliveries):
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
            query = query.where(alerts.c.ended_at.is_(None) == standing)
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        if baseline_id is not None:
            query = query.where(alerts.c.baseline_id == baseline_id)
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
            note(connection, at, "alert resolved", _said_of(found), why, who)
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
            note(connection, at, "alert acknowledged", _said_of(alert), why, who)
        return replace(alert, acknowledgement=Acknowledgement(alert_id, who, why, at))


def _said_of(stored: StoredAlert) -> str:
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
    kept = f"hooks are told nothing of {of}"
    if silence.is_maintenance:
        kept = f"tests of {of} are compared with nothing, and hooks told nothing of it,"
    return (
        f"{kind_of(silence)} {silence.id}: {kept} until {silence.until:%Y-%m-%d %H:%M} UTC "
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
