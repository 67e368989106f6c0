"""The journal: what happened to what, when, by whom, why, and with which shm; never changed.

A step of a recording or a test, something noticed on the way and a change that a person made are
entries of one kind: one event is one entry. What a person made has a `who`.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

import shm
from shm.store.columns import row_of, value_in
from shm.store.database import Repository, insert
from shm.store.rows import (
    Decision,
    Entry,
    FormerPosterior,
    FormerTest,
    Outcome,
    Stage,
)
from shm.store.tables import journal, posterior_tests, posteriors, tests

COMMAND_LINE = "command line"
_OPTION = "shm_actor"

ARCHIVED = "archived"
NOTIFIED = "notified"
STEPS = frozenset({*Stage, ARCHIVED, NOTIFIED})
"""Names of all steps that this version writes."""
REFUSED: str = Stage.REFUSED
AGAIN, REMOVED, BACKUP, DIED = "again", "removed", "backup", "worker died"
RENAMED = "renamed"
"""Keeps the former name of a file that came again under another."""

ACTIONS: dict[str, str] = {
    **{str(decision): f"recording {decision}" for decision in Decision},
    **dict.fromkeys([str(Stage.RECEIVED), *map(str, Outcome)], "recording taken in"),
    AGAIN: "recording done again",
    REMOVED: "raw file removed",
}
"""What the audit log calls an entry, where its kind does not say it."""

is_step = journal.c.kind.in_(STEPS) & (
    journal.c.test_id.is_not(None) | journal.c.recording_id.is_not(None)
)
is_event = (
    (journal.c.subject != "")
    & (journal.c.kind != Stage.RECEIVED)
    & (journal.c.recording_id.is_not(None) | journal.c.who.is_(None))
)


@dataclass(frozen=True)
class Actor:
    """Person or program that works with a store, and by which way."""

    name: str
    via: str


def write(
    connection: Connection,
    at: datetime,
    kind: str,
    recording_id: int | None = None,
    test_id: int | None = None,
    subject: str = "",
    detail: str = "",
    who: str | None = None,
) -> None:
    """Write an entry in the transaction that makes it true.

    `who` is given of what people do: whom the change itself names, empty where it names nobody. Who
    is known to work with the store did it, for the one that is named where that is another.
    """
    actor = connection.get_execution_options().get(_OPTION)
    via = None
    if who is not None and actor is not None:
        detail = f"{detail} (for {who})".strip() if who and actor.name not in who else detail
        who, via = actor.name, actor.via
    by = who or None, via, shm.__version__
    entry = Entry(at, kind, recording_id, test_id, subject, detail, *by)
    insert(connection, journal, row_of(entry, journal))


def note(
    connection: Connection, at: datetime, action: str, subject: str, detail: str = "", who: str = ""
) -> None:
    """Write that somebody changed what is no recording; nothing where nobody is known to have."""
    if who or connection.get_execution_options().get(_OPTION) is not None:
        write(connection, at, action, subject=subject, detail=detail, who=who)


def acting_as(engine: Engine, actor: Actor) -> Engine:
    """Return the same connections, on which changes are noted as an actor's."""
    return engine.execution_options(**{_OPTION: actor})


class Journal(Repository):
    """Journal of events; `shm.store.journal` reads it back."""

    def note(self, at: datetime, action: str, subject: str, detail: str = "") -> None:
        """Note what changed outside the store, as a file that was uploaded."""
        with self.writing() as connection:
            note(connection, at, action, subject, detail)


_LINEAGE = ("input_sha256", "settings_sha256", "version")


_WITHOUT_SAMPLES = ("id", "model", "updated_at", "superseded_at")


def find_newest_entry(store: Repository) -> int:
    """Return the number of the last entry, 0 where there is none: it changes with results."""
    return store.scalar(sa.select(sa.func.max(journal.c.id))) or 0


def list_changes(
    store: Repository, limit: int | None = None, before: int | None = None
) -> tuple[Entry, ...]:
    """Return what people changed, the newest first; `before` is the number to go on after."""
    query = sa.select(journal).where(journal.c.who.is_not(None)).order_by(journal.c.id.desc())
    if before is not None:
        query = query.where(journal.c.id < before)
    return tuple(value_in(row, Entry) for row in store.rows(query.limit(limit)))


def change_document(entry: Entry) -> dict[str, Any]:
    """Return a change as the audit log shows it: who did what to what by which way, and why."""
    detail = entry.detail
    if entry.kind in (Stage.RECEIVED, *Outcome):
        detail = str(Outcome.NEW) if entry.kind == Stage.RECEIVED else entry.kind
    of_change: dict[str, Any] = {name: getattr(entry, name) for name in ("id", "at", "who")}
    action = ACTIONS.get(entry.kind, entry.kind)
    of_change |= {"via": entry.via or "", "action": action, "subject": entry.subject}
    return {**of_change, "detail": detail}


def list_events(
    store: Repository,
    kind: str | None = None,
    *,
    recording_id: int | None = None,
    file_name: str | None = None,
) -> tuple[Entry, ...]:
    """Return what was noticed of recordings, the oldest first; `kind` as duplicate or refused.

    Of one recording, or of what came under one name, where that is given.
    """
    query = sa.select(journal).where(is_event).order_by(journal.c.id)
    wanted = {"kind": kind, "recording_id": recording_id, "subject": file_name}
    for name, value in wanted.items():
        if value is not None:
            query = query.where(journal.c[name] == value)
    return tuple(value_in(row, Entry) for row in store.rows(query))


def list_steps(store: Repository, recording_id: int) -> tuple[Entry, ...]:
    """Return the stages that a recording and its tests have reached, in that order."""
    query = sa.select(journal, tests.c.name).outerjoin(tests, tests.c.id == journal.c.test_id)
    query = query.where(is_step, journal.c.recording_id == recording_id)
    rows = store.rows(query.order_by(journal.c.id))
    return tuple(value_in(row, Entry, test=row.name) for row in rows)


def list_former_tests(store: Repository, recording_id: int) -> tuple[FormerTest, ...]:
    """List every identification of a recording's tests with its posteriors, oldest first."""
    selected = (column for column in tests.c if column is not tests.c.frequency_response)
    found = sa.select(*selected).where(tests.c.recording_id == recording_id).order_by(tests.c.id)
    columns = [posteriors.c[name] for name in (*_WITHOUT_SAMPLES, *_LINEAGE)]
    made: sa.Select[Any] = (
        sa.select(posterior_tests.c.test_id, *columns)
        .select_from(posterior_tests.join(posteriors).join(tests))
        .where(tests.c.recording_id == recording_id)
        .order_by(posteriors.c.id)
    )
    with store.reading() as connection:
        rows = connection.execute(found).all()
        by_test: defaultdict[int, list[FormerPosterior]] = defaultdict(list)
        for row in connection.execute(made):
            by_test[row.test_id].append(value_in(row, FormerPosterior))
    return tuple(value_in(row, FormerTest, posteriors=tuple(by_test[row.id])) for row in rows)
