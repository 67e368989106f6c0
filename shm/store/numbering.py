"""Numbers of rows that a table skips, in SQLite.

SQLite numbers a new row after the highest that is there, so a number that is skipped was a row's.
PostgreSQL skips numbers whenever a transaction is undone, and a file that was copied from a server
has its gaps. So each file notes in its header (`PRAGMA user_version`, a bit a table) which tables
were once seen without a gap: from then on a gap is a row that was taken out.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import islice

import sqlalchemy as sa
from sqlalchemy.engine import Connection

NUMBERED = (
    "recordings",
    "holds",
    "tests",
    "posteriors",
    "selections",
    "baselines",
    "drifts",
    "watches",
    "alerts",
    "acknowledgements",
    "deliveries",
    "diagnoses",
    "adoptions",
    "events",
    "steps",
    "archive_copies",
    "tokens",
    "resolutions",
    "silences",
    "users",
    "sessions",
    "audit",
    "changed_settings",
    "notes",
)
"""Tables of which no row is ever taken out, but for damaged ones of `drifts` and `watches` (see
`forget`). The order is that of the bits: new ones come last."""

_MOST_NAMED = 20  # technical: what fits a screen
_ID = sa.column("id", sa.Integer)


def note_numbering(connection: Connection, known: int = 0) -> None:
    """Notes, within the caller's transaction, which tables have no gap, or are `known` to be so."""
    if connection.dialect.name != "sqlite":
        return
    seen = known | noted(connection)
    for bit, table in enumerate(NUMBERED):
        seen |= (not _has_gap(connection, table)) << bit
    _write(connection, seen)


def renote_numbering(connection: Connection, known: int) -> None:
    """The same of a file whose rows were all written anew, with the numbers that they had."""
    if connection.dialect.name == "sqlite":
        _write(connection, 0)
        note_numbering(connection, known)


def noted(connection: Connection) -> int:
    """The bits of the tables in which a gap is a row that was taken out; none on a server."""
    if connection.dialect.name != "sqlite":
        return 0
    return int(connection.exec_driver_sql("PRAGMA user_version").scalar() or 0)


def forget(connection: Connection, table: str) -> None:
    """Rows of a table were taken out for good reason: its gaps say nothing any more."""
    if table in NUMBERED and connection.dialect.name == "sqlite":
        _write(connection, noted(connection) & ~(1 << NUMBERED.index(table)))


def skipped(connection: Connection, accepted: Collection[str]) -> dict[str, tuple[int, ...]]:
    """The numbers that are missing, by table: of each the first ones but those that were
    `accepted`, as in holds/14.
    """
    seen = noted(connection)
    return {
        table: _skipped(connection, table, accepted)
        for bit, table in enumerate(NUMBERED)
        if seen >> bit & 1 and _has_gap(connection, table)
    }


def _write(connection: Connection, seen: int) -> None:
    connection.exec_driver_sql(f"PRAGMA user_version = {seen}")


def _has_gap(connection: Connection, table: str) -> bool:
    query = sa.select(sa.func.count(), sa.func.max(_ID)).select_from(sa.table(table))
    count, highest = connection.execute(query).one()
    return bool(count != (highest or 0))


def _skipped(connection: Connection, table: str, accepted: Collection[str]) -> tuple[int, ...]:
    expected, found = 1, list[int]()
    there = sa.select(_ID).select_from(sa.table(table)).order_by(_ID)
    for id_ in connection.scalars(there):
        gap = (id_ for id_ in range(expected, id_) if f"{table}/{id_}" not in accepted)
        found.extend(islice(gap, _MOST_NAMED))
        expected = id_ + 1
        if len(found) >= _MOST_NAMED:
            break
    return tuple(found[:_MOST_NAMED])
