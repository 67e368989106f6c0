"""Silences and maintenance windows: who wants which hooks' messages held back, when and why."""

from __future__ import annotations

from dataclasses import fields
from datetime import datetime

import sqlalchemy as sa
from sqlalchemy.engine import Row

from shm.errors import NothingThere, UsageError
from shm.store.audit import note
from shm.store.database import Repository, insert
from shm.store.rows import Silence
from shm.store.tables import silences

_COLUMNS = tuple(silences.c[field.name] for field in fields(Silence))


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
        values = {name: value for name, value in vars(made).items() if name != "id"}
        with self.writing() as connection:
            number = insert(connection, silences, {**values, "ended_who": None})
            found = self._one(number, made)
            told = f"{starts_at:%Y-%m-%d %H:%M} to {ends_at:%Y-%m-%d %H:%M} UTC"
            note(connection, at, f"{kind_of(found)} made", f"{_named(found)}, {told}", why, who)
            return found

    def end(self, silence_id: int, who: str, at: datetime) -> Silence:
        """Ends a silence before its time; raises NothingThere, or UsageError where it is over."""
        with self.writing() as connection:
            query = sa.select(*_COLUMNS).where(silences.c.id == silence_id)
            row = connection.execute(query).one_or_none()
            if row is None:
                raise NothingThere(f"no silence {silence_id}.", remedy="See `shm alerts silences`.")
            found = _silence(row)
            if found.until <= at or found.ended_at is not None:
                raise UsageError(
                    f"silence {silence_id} is over.", remedy="See `shm alerts silences`."
                )
            ended = {"ended_at": at, "ended_who": who}
            one = sa.update(silences).where(silences.c.id == silence_id)
            connection.execute(one.values(**ended))
            note(connection, at, f"{kind_of(found)} ended", _named(found), who=who)
            return self._one(silence_id, found, at, who)

    def list_all(self) -> tuple[Silence, ...]:
        """All that were ever made, the oldest first."""
        with self.reading() as connection:
            rows = connection.execute(sa.select(*_COLUMNS).order_by(silences.c.id))
            return tuple(_silence(row) for row in rows)

    def list_current(self, at: datetime) -> tuple[Silence, ...]:
        """Those in force at a time or yet to come."""
        return tuple(each for each in self.list_all() if not each.is_over(at))

    def list_in_force(self, at: datetime) -> tuple[Silence, ...]:
        """Those in force at a time."""
        return tuple(each for each in self.list_current(at) if each.starts_at <= at)

    @staticmethod
    def _one(
        id_: int, made: Silence, ended_at: datetime | None = None, ended_who: str = ""
    ) -> Silence:
        values = {**vars(made), "id": id_, "ended_at": ended_at, "ended_who": ended_who}
        return Silence(**values)


def silenced_until(silences: tuple[Silence, ...], hanger: int, at: datetime) -> datetime | None:
    """When hooks are told of a hanger again, silences one after the other; None where they are."""
    until = at
    while ends := [each.until for each in silences if each.covers(hanger, until)]:
        until = max(ends)
    return None if until == at else until


def said_of(silence: Silence) -> str:
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
    """What it is called."""
    return "maintenance window" if silence.is_maintenance else "silence"


def hangers_of(hanger: int | None) -> str:
    """Whom a silence is about."""
    return "all hangers" if hanger is None else f"hanger {hanger}"


def _named(silence: Silence) -> str:
    return f"{kind_of(silence)} {silence.id}, {hangers_of(silence.hanger)}"


def _silence(row: Row[tuple[object, ...]]) -> Silence:
    values = dict(row._mapping)
    return Silence(**{**values, "ended_who": values["ended_who"] or ""})
