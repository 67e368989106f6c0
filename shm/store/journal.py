"""The journal: what happened to what, when, by whom, why, and with which shm; never changed.

A step of a recording or a test, something noticed on the way and a change that a person made are
entries of one kind: one event is one entry. What a person made has a `who`.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.engine import Connection, Engine

import shm
from shm.store.database import Repository, insert
from shm.store.mapping import row_of
from shm.store.rows import Decision, Entry, Outcome, Stage
from shm.store.tables import journal

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
    """Journal of events; `shm.store.queries.history` reads it back."""

    def note(self, at: datetime, action: str, subject: str, detail: str = "") -> None:
        """Note what changed outside the store, as a file that was uploaded."""
        with self.writing() as connection:
            note(connection, at, action, subject, detail)
