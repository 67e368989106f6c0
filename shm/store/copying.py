"""Copies a store's rows into another, of either kind, and proves that both then hold the same.

Numbers of rows that a table skips, in SQLite.

SQLite numbers a new row after the highest that is there, so a number that is skipped was a row's.
PostgreSQL skips numbers whenever a transaction is undone, and a file that was copied from a server
has its gaps. So each file notes in its header (`PRAGMA user_version`, a bit a table) which tables
were once seen without a gap: from then on a gap is a row that was taken out.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import islice

import sqlalchemy as sa
from sqlalchemy.engine import Connection, RowMapping

from shm.errors import StoreError
from shm.store.checksums import digest_of, plain_table
from shm.store.columns import Document
from shm.store.tables import metadata

NUMBERED = (
    "recordings", "holds", "tests", "posteriors", "selections", "baselines", "drifts", "watches",
    "alerts", "acknowledgements", "deliveries", "diagnoses", "adoptions", "events", "steps",
    "archive_copies", "tokens", "resolutions", "silences", "users", "sessions", "audit",
    "changed_settings", "notes",
)  # fmt: skip
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
    _write_number(connection, seen)


def renote_numbering(connection: Connection, known: int) -> None:
    """The same of a file whose rows were all written anew, with the numbers that they had."""
    if connection.dialect.name == "sqlite":
        _write_number(connection, 0)
        note_numbering(connection, known)


def noted(connection: Connection) -> int:
    """The bits of the tables in which a gap is a row that was taken out; none on a server."""
    if connection.dialect.name != "sqlite":
        return 0
    return int(connection.exec_driver_sql("PRAGMA user_version").scalar() or 0)


def forget(connection: Connection, table: str) -> None:
    """Rows of a table were taken out for good reason: its gaps say nothing any more."""
    if table in NUMBERED and connection.dialect.name == "sqlite":
        _write_number(connection, noted(connection) & ~(1 << NUMBERED.index(table)))


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


def _write_number(connection: Connection, seen: int) -> None:
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


Tell = Callable[[str, float], None]
"""Is told what is being done and which fraction of all is done."""

Rows = Sequence[RowMapping]
Look = Callable[[sa.Table, Rows], None]
"""Is shown rows of a table, their values as the database's driver gives them."""

_ROWS_AT_ONCE = 50  # a row may hold a frequency response of some 100 kB


@dataclass(frozen=True)
class TableContent:
    """What a table holds: rows, and a checksum that does not depend on their order."""

    table: str
    rows: int
    checksum: str


def row_counts(connection: Connection) -> dict[str, int]:
    """How many rows each table holds, the tables that others refer to first."""
    counted = {}
    for table in metadata.sorted_tables:
        count = connection.scalar(sa.select(sa.func.count()).select_from(table))
        counted[table.name] = int(count or 0)
    return counted


def contents(
    connection: Connection, tell: Tell, look: Look = lambda _table, _rows: None
) -> tuple[TableContent, ...]:
    """Reads every row of every table, as the database holds it, and shows each to `look`."""
    progress = _Progress(tell, "reading rows", sum(row_counts(connection).values()))
    return tuple(
        _read(connection, table, progress, partial(look, table), plain_table(table.name))
        for table in metadata.sorted_tables
    )


def copy_rows(source: Connection, target: Connection, tell: Tell) -> tuple[TableContent, ...]:
    """Writes all rows of one store of the present schema into another, which holds none.

    `target` is in a transaction, to be undone where this raises: StoreError where the rows read
    back are not those that were written.
    """
    progress = _Progress(tell, "copying rows", 2 * sum(row_counts(source).values()))
    written = tuple(
        _read(source, table, progress, partial(_write, target, table))
        for table in metadata.sorted_tables
    )
    arrived = tuple(_read(target, table, progress) for table in metadata.sorted_tables)
    differing = [here.table for here, there in zip(written, arrived, strict=True) if here != there]
    if differing:
        raise StoreError(
            f"the copy differs from the store in {', '.join(differing)}; nothing was changed.",
            remedy="Run `shm db check` on both.",
        )
    _number_on(target)
    renote_numbering(target, noted(source))
    return arrived


def delete_rows(connection: Connection) -> None:
    """Empties every table."""
    for table in reversed(metadata.sorted_tables):
        connection.execute(sa.delete(table))


def _read(
    connection: Connection,
    table: sa.Table,
    progress: _Progress,
    use: Callable[[Rows], None] | None = None,
    columns: sa.TableClause | None = None,
) -> TableContent:
    rows, total = 0, 0
    query = sa.select(_plain(table) if columns is None else columns).order_by(
        *(sa.column(c.name) for c in table.primary_key)
    )
    query = query.execution_options(yield_per=_ROWS_AT_ONCE)
    for some in connection.execute(query).mappings().partitions():
        rows += len(some)
        total = (total + sum(int.from_bytes(digest_of(row), "big") for row in some)) % 2**256
        if use is not None:
            use(some)
        progress.advance(len(some))
    return TableContent(table.name, rows, f"{total:064x}")


def _write(connection: Connection, table: sa.Table, rows: Rows) -> None:
    connection.execute(sa.insert(_plain(table)), [dict(row) for row in rows])


@cache
def _plain(table: sa.Table) -> sa.TableClause:
    """The table with its documents as the text they are kept as, to the letter."""
    return sa.table(
        table.name,
        *(
            sa.column(c.name, sa.Text() if isinstance(c.type, Document) else c.type)
            for c in table.columns
        ),
    )


def _number_on(connection: Connection) -> None:
    """Rows to come are numbered after those that were copied; SQLite does so by itself."""
    if connection.dialect.name != "postgresql":
        return
    for table in metadata.sorted_tables:
        column = table.autoincrement_column
        if column is not None:
            sequence = sa.func.pg_get_serial_sequence(table.name, column.name)
            following = sa.select(sa.func.coalesce(sa.func.max(column), 0) + 1).scalar_subquery()
            connection.execute(sa.select(sa.func.setval(sequence, following, False)))


class _Progress:
    """Counts rows over all tables."""

    def __init__(self, tell: Tell, label: str, total: int):
        self._tell, self._label, self._total, self._done = tell, label, max(total, 1), 0

    def advance(self, rows: int) -> None:
        self._done += rows
        self._tell(self._label, self._done / self._total)
