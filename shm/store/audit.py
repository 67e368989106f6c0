"""The audit log: who changed what, when, and by which way; written with the change itself.

What shm does by itself is in `events`, and none of it is noted here.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

from shm.store.database import Repository, insert
from shm.store.people_tables import audit

COMMAND_LINE = "command line"
_OPTION = "shm_actor"


@dataclass(frozen=True)
class Actor:
    """Who works with a store: a user, `token NAME`, a user of the computer; and by which way."""

    name: str
    via: str


@dataclass(frozen=True)
class AuditRow:
    """One change: `who` did `action` on `subject` by `via`; `detail` is the reason or the value."""

    id: int
    at: datetime
    who: str
    via: str
    action: str
    subject: str
    detail: str


class Audit(Repository):
    """The audit log."""

    def note(self, at: datetime, action: str, subject: str, detail: str = "") -> None:
        """Notes what changed outside the store, as a file that was uploaded."""
        with self.writing() as connection:
            note(connection, at, action, subject, detail)

    def list_rows(
        self, limit: int | None = None, before: int | None = None
    ) -> tuple[AuditRow, ...]:
        """Changes, the newest first; `before` is the number of the change to go on after."""
        query = sa.select(*_COLUMNS).order_by(audit.c.id.desc()).limit(limit)
        if before is not None:
            query = query.where(audit.c.id < before)
        with self.reading() as connection:
            return tuple(AuditRow(*row) for row in connection.execute(query))


def note(
    connection: Connection,
    at: datetime,
    action: str,
    subject: str,
    detail: str = "",
    who: str = "",
) -> None:
    """Notes a change in the transaction that makes it. `who` is whom the change itself names:
    noted where nobody is known to work with the store, and with the reason where it is another.
    """
    actor = connection.get_execution_options().get(_OPTION)
    if actor is None and not who:
        return
    name, via = (actor.name, actor.via) if actor else (who, "")
    detail = f"{detail} (for {who})".strip() if who and name not in who else detail
    values: dict[str, Any] = {"at": at, "who": name, "via": via, "action": action}
    insert(connection, audit, {**values, "subject": subject, "detail": detail})


def acting_as(engine: Engine, actor: Actor) -> Engine:
    """The same connections, on which changes are noted as an actor's."""
    return engine.execution_options(**{_OPTION: actor})


_COLUMNS = tuple(audit.c[name] for name in AuditRow.__annotations__)
