"""The checksum of each row: set before a transaction commits, compared whenever a row is read.

Whatever writes a row leaves its `checksum` empty (new rows have none, an update empties it), and
the transaction fills in those that are empty before it commits: no verb of the store can forget.
A frequency response, which is as large as all else together a hundredfold, is under a checksum of
its own, and that one under the row's: a test is compared without reading what is not asked for.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache, lru_cache
from typing import Any, TypeVar

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row, RowMapping

from shm.errors import DamagedRow
from shm.store.tables import APART, metadata

log = logging.getLogger(__name__)

_ROWS_AT_ONCE = 50  # a row may hold some 100 kB
_DAMAGE = "shm_damage"
_SQLITE_TIME = "%Y-%m-%d %H:%M:%S.%f"
_T = TypeVar("_T")
Values = RowMapping | dict[str, Any]
"""A row by the names of its columns."""


def seal(connection: Connection) -> None:
    """Gives every row that has none its checksum, within the caller's transaction.

    A row that was damaged before it was updated gets one that is not its own: it stays damaged.
    """
    damage = connection.info.pop(_DAMAGE, set())
    for name in connection.scalars(_unsealed()).all():
        table, are_more = metadata.tables[name], True
        while are_more:
            rows = connection.execute(_empty(name)).mappings().all()
            sums = [_sums(table, row) for row in rows]
            for row, found in zip(rows, sums, strict=True):
                found["sum"] ^= (name, key_of(table, row)) in damage
            if sums:
                connection.execute(_setting(name), sums)
            are_more = len(rows) == _ROWS_AT_ONCE


@cache
def _empty(name: str) -> sa.Select[Any]:
    """Some of the rows of a table that have no checksum yet."""
    plain = plain_table(name)
    return sa.select(plain).where(plain.c.checksum.is_(None)).limit(_ROWS_AT_ONCE)


def look_before_update(connection: Connection, statement: Any, *_: Any) -> None:
    """Notes which rows are damaged before an update changes them (an event of the engine)."""
    table = statement.table if isinstance(statement, sa.Update) else None
    if not isinstance(table, sa.Table) or metadata.tables.get(table.name) is not table:
        return  # migrations name their own tables
    changed = sa.select(*_own(table))
    if statement.whereclause is not None:
        changed = changed.where(statement.whereclause)
    for row in connection.execute(changed):
        if not whole(table, row):
            key = tuple(row._mapping[column] for column in table.primary_key)
            connection.info.setdefault(_DAMAGE, set()).add((table.name, key))


def forget_damage(connection: Connection) -> None:
    """What a transaction that was undone had noted."""
    connection.info.pop(_DAMAGE, None)


def healed(connection: Connection, table: sa.Table, id_: int) -> None:
    """All contents of a damaged row were written anew in this transaction: it is whole again."""
    connection.info.get(_DAMAGE, set()).discard((table.name, (id_,)))


def key_of(table: sa.Table, row: Values) -> tuple[Any, ...]:
    """The primary key of a row."""
    return tuple(row[column.name] for column in table.primary_key)


def checksum_of(table: sa.Table, row: Values) -> int:
    """Of a row's values as the database holds them, the same in SQLite and in PostgreSQL.

    64 bits of a SHA-256: what a disk changes by chance passes once in 2^64 times.
    """
    contents = [_canonical(row[name]) for name in _summed(table)]
    return _number(hashlib.sha256(b"".join(map(_counted, contents))))


@cache
def _summed(table: sa.Table) -> tuple[str, ...]:
    apart = ("checksum", APART.get(table.name))
    return tuple(column.name for column in table.columns if column.name not in apart)


def content_checksum(content: bytes | None) -> int | None:
    """Of what is kept apart; None where there is nothing."""
    return None if content is None else _number(hashlib.sha256(content))


def digest_of(row: Values) -> bytes:
    """SHA-256 of all values of a row, its checksum too."""
    digest = hashlib.sha256()
    for value in row.values():
        digest.update(_counted(_canonical(value)))
    return digest.digest()


def whole(table: sa.Table, row: Row[Any]) -> bool:
    """Whether a row with all its columns, but for what is kept apart, is as it was written.

    True within the transaction that writes it, which has not given it its checksum yet.
    """
    values = row._mapping
    stored = values[table.c.checksum]
    return stored is None or stored == checksum_of(table, {c.name: values[c] for c in _own(table)})


@contextmanager
def decoding(table: sa.Table, row: Any, hanger: int | None = None) -> Iterator[None]:
    """Compares a row with its checksum; what cannot be made of its contents is a DamagedRow too.

    This is the one place where it is found out that a row is damaged, but for `shm db check`.
    """
    id_ = row._mapping[next(iter(table.primary_key))]
    if table.c.checksum in row._mapping and not whole(table, row):
        raise damaged(table, id_, hanger)
    try:
        yield
    except DamagedRow:
        raise
    except Exception as error:
        raise damaged(table, id_, hanger) from error


def damaged(table: sa.Table, id_: object, hanger: int | None = None) -> DamagedRow:
    """The error of one damaged row, with what heals it."""
    if table.name == "diagnoses" and hanger is None:  # its number is what is damaged
        return DamagedRow(table.name, id_, hanger, RESTORE)
    remedy = HEALING.get(table.name, RESTORE).format(table=table.name, id=id_, hanger=hanger)
    return DamagedRow(table.name, id_, hanger, remedy)


RESTORE = "Restore the store from a backup: `shm db restore FILE --replace`."
_AGAIN = "Make it again from the archive: `shm ingest --again {table}/{id}`."
_WATCH_AGAIN = "Make it again: `shm ingest --again {table}/{id} --from watched`."
HEALING: Mapping[str, str] = {
    "posteriors": _AGAIN,
    "tests": _AGAIN,
    "watches": _WATCH_AGAIN,
    "drifts": _WATCH_AGAIN,
    "diagnoses": "Make it again: `shm gap diagnose --hanger {hanger}`.",
    "summaries": "Nothing is lost: `shm db upgrade` makes it again.",
    "watch_states": "Nothing is lost: the next test makes it again.",
    "stream_watch": "Nothing is lost: the next readings make it again.",
    "stream_watch_days": "Nothing is lost: the next days make it again.",
}
"""What to do about a damaged row, by table; of all others a backup is the only source.

The row itself is named, as `Recordings.find` finds its recording; what it says may be wrong."""


def loads(text: Any) -> Any:
    """A document of the store back from its text; None where there is none."""
    return None if text is None else json.loads(text)


@cache
def plain_table(name: str) -> sa.TableClause:
    """A table whose columns have no types: values come as the database's driver gives them."""
    columns = metadata.tables[name].columns
    return sa.table(name, *(sa.column(column.name) for column in columns))


@cache
def _unsealed() -> sa.CompoundSelect[Any]:
    """The names of tables with rows that have no checksum; an index of these makes it quick."""
    return sa.union_all(
        *(
            sa.select(sa.literal_column(f"'{table.name}'")).where(
                sa.exists().where(table.c.checksum.is_(None))
            )
            for table in metadata.sorted_tables
        )
    )


@cache
def _setting(name: str) -> sa.Update:
    plain, keys = plain_table(name), metadata.tables[name].primary_key
    found = sa.update(plain).where(
        *(plain.c[key.name] == sa.bindparam(f"key_{key.name}") for key in keys)
    )
    apart: dict[str, Any] = (
        {f"{APART[name]}_checksum": sa.bindparam("apart")} if name in APART else {}
    )
    return found.values(checksum=sa.bindparam("sum"), **apart)


def _sums(table: sa.Table, row: Values) -> dict[str, Any]:
    keys = {f"key_{key.name}": row[key.name] for key in table.primary_key}
    if table.name not in APART:
        return {**keys, "sum": checksum_of(table, row)}
    apart = content_checksum(row[APART[table.name]])
    named = {**row, f"{APART[table.name]}_checksum": apart}
    return {**keys, "sum": checksum_of(table, named), "apart": apart}


@cache
def _own(table: sa.Table) -> tuple[sa.Column[Any], ...]:
    apart = APART.get(table.name)
    return tuple(column for column in table.columns if column.name != apart)


def _counted(content: bytes) -> bytes:
    return b"%d %b" % (len(content), content)


def _canonical(value: Any) -> bytes:
    """A value in the one form in which both kinds of database, typed or not, agree."""
    if type(value) is str:  # most are, and a page compares thousands
        return b"s" + value.encode("utf-8", "surrogateescape")
    if value is None or value != value:  # NaN is kept as nothing
        return b"0"
    if isinstance(value, bytes | memoryview):
        return b"b" + bytes(value)
    if isinstance(value, datetime):  # as SQLite keeps it, which has no type for times
        naive = value.astimezone(UTC).replace(tzinfo=None) if value.tzinfo else value
        return b"s" + f"{naive.year:04}{naive.strftime(_SQLITE_TIME)[-22:]}".encode()
    if isinstance(value, float):
        return b"f" + repr(value + 0.0).encode()  # SQLite has no negative zero
    if isinstance(value, int):
        return b"i%d" % value
    return b"s" + str(value).encode("utf-8", "surrogateescape")


def _number(digest: Any) -> int:
    return int.from_bytes(digest.digest()[:8], "big", signed=True)


def readable(rows: Iterable[Row[Any]], make: Callable[[Row[Any]], _T]) -> list[_T]:
    """What can be made of rows; the damaged ones are noted and left out."""
    made = []
    for row in rows:
        try:
            made.append(make(row))
        except DamagedRow as error:
            note_damage(error)
    return made


def note_damage(error: DamagedRow) -> None:
    """Logs a damaged row, once: it is met again at each look."""
    _log_once(str(error))


@lru_cache(1000)
def _log_once(message: str) -> None:
    log.error("%s", message)


def of_readable(
    ask: Callable[[Collection[int]], Mapping[int, _T]], damaged: dict[int, DamagedRow]
) -> Mapping[int, _T]:
    """What `ask` says of all hangers but those with a damaged row, which are put into `damaged`."""
    while True:
        try:
            return ask(damaged)
        except DamagedRow as error:
            if error.hanger is None or error.hanger in damaged:
                raise
            note_damage(error)
            damaged[error.hanger] = error
