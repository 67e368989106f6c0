"""Copies a store's rows into another, of either kind, and proves that both then hold the same."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import sqlalchemy as sa
from sqlalchemy.engine import Connection, RowMapping

from shm.errors import StoreError
from shm.store.columns import Document
from shm.store.tables import metadata

Tell = Callable[[str, float], None]
"""Is told what is being done and which fraction of all is done."""

_ROWS_AT_ONCE = 50  # a row may hold a frequency response of some 100 kB


@dataclass(frozen=True)
class TableContent:
    """Content of a table: number of rows, and a checksum that does not depend on their order."""

    table: str
    rows: int
    checksum: str


def row_counts(connection: Connection) -> dict[str, int]:
    """Count the rows of each table, the tables that others refer to first."""
    counted = {}
    for table in metadata.sorted_tables:
        count = connection.scalar(sa.select(sa.func.count()).select_from(table))
        counted[table.name] = int(count or 0)
    return counted


def contents(
    connection: Connection,
    tell: Tell,
    use: Callable[[sa.Table, Sequence[RowMapping]], object] = lambda *_: None,
) -> tuple[TableContent, ...]:
    """Read every row of every table and `use` some at a time; raise ValueError where one cannot be
    decoded."""
    progress = _Progress(tell, "reading rows", sum(row_counts(connection).values()))
    return tuple(
        _read(connection, table, progress, partial(use, table)) for table in metadata.sorted_tables
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
    return arrived


def delete_rows(connection: Connection) -> None:
    """Empties every table."""
    for table in reversed(metadata.sorted_tables):
        connection.execute(sa.delete(table))


def _read(
    connection: Connection,
    table: sa.Table,
    progress: _Progress,
    use: Callable[[Sequence[RowMapping]], object] = lambda _: None,
) -> TableContent:
    rows, total = 0, 0
    query = sa.select(_plain(table)).order_by(*(sa.column(c.name) for c in table.primary_key))
    query = query.execution_options(yield_per=_ROWS_AT_ONCE)
    for some in connection.execute(query).mappings().partitions():
        rows += len(some)
        total = (total + sum(map(_digest, some))) % 2**256
        use(some)
        progress.advance(len(some))
    return TableContent(table.name, rows, f"{total:064x}")


def _write(connection: Connection, table: sa.Table, rows: Sequence[RowMapping]) -> None:
    connection.execute(sa.insert(_plain(table)), [dict(row) for row in rows])


def _digest(row: RowMapping) -> int:
    """Return a SHA-256 of a row's values, the same in SQLite and in PostgreSQL."""
    text = "\n".join(f"{name}={_plain_value(value)!r}" for name, value in row.items())
    return int.from_bytes(hashlib.sha256(text.encode()).digest(), "big")


def _plain_value(value: object) -> object:
    if isinstance(value, memoryview):
        return bytes(value)
    if isinstance(value, float):
        return value + 0.0  # SQLite has no negative zero
    return value


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
