"""Damaged rows: which they are, and how they are made whole again.

What can be computed anew is written over the damaged row, whose number others refer to; what the
next test makes anyway is thrown away.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.documents import value_of
from shm.errors import DamagedRow
from shm.store.blobs import change_in, posterior_from, test_from_document, unpack
from shm.store.checksums import (
    Values,
    checksum_of,
    content_checksum,
    damaged,
    healed,
    key_of,
    loads,
    plain_table,
)
from shm.store.columns import Document
from shm.store.copying import Rows, forget
from shm.store.tables import APART
from shm.values import Alert


def damaged_among(table: sa.Table, rows: Rows) -> Iterator[DamagedRow]:
    """Those of some rows, read without types, that are damaged."""
    for row in rows:
        if not (_as_written(table, row) and _can_be_decoded(table, row)):
            key = key_of(table, row)
            yield damaged(table, key[0] if len(key) == 1 else key, _hanger(row))


def _as_written(table: sa.Table, row: Values) -> bool:
    """A row without a checksum was written by something else than shm, or lost it."""
    apart = APART.get(table.name)
    if apart and content_checksum(row[apart]) != row[f"{apart}_checksum"]:
        return False
    return bool(row["checksum"] == checksum_of(table, row))


def _can_be_decoded(table: sa.Table, row: Values) -> bool:
    """Whether its documents and arrays can be read: of a row that was damaged before there were
    checksums that is all that can be told."""
    try:
        for column in table.columns:
            if isinstance(column.type, Document):
                loads(row[column.name])
        if table.name in _DECODERS:
            _DECODERS[table.name](row)
    except Exception:  # noqa: BLE001 - damaged bytes fail in any way
        return False
    return True


def _decode_test(row: Values) -> None:
    test_from_document(loads(row["document"]), row["hanger"])
    if row["frequency_response"] is not None:
        unpack(row["frequency_response"])


# What is made of the contents of a row. What the watch keeps is its own affair, and may be thrown
# away at will; diagnoses of former versions are of other forms.
_DECODERS: Mapping[str, Callable[[Values], object]] = {
    "tests": _decode_test,
    "posteriors": lambda row: posterior_from(loads(row["document"]), row["samples"]),
    "watches": lambda row: change_in(row["document"]),
    "alerts": lambda row: value_of(Alert, loads(row["document"])),
}


def _hanger(row: Values) -> int | None:
    hanger = row.get("hanger")
    return hanger if isinstance(hanger, int) else None


def damaged_rows(connection: Connection, table: sa.Table, ids: Iterable[int]) -> list[DamagedRow]:
    """Those of the rows with these numbers that are damaged."""
    plain, key = plain_table(table.name), next(iter(table.primary_key)).name
    found: list[DamagedRow] = []
    for id_ in ids:
        rows = connection.execute(sa.select(plain).where(plain.c[key] == id_)).mappings().all()
        found.extend(damaged_among(table, rows))
    return found


def damaged_ids(connection: Connection, table: sa.Table, ids: Iterable[int]) -> list[int]:
    """The numbers of those that are damaged."""
    return [id_ for id_ in ids if damaged_rows(connection, table, [id_])]


def drop_rows(connection: Connection, table: sa.Table, chosen: sa.Select[Any]) -> int:
    """Throws away the damaged ones of the rows whose numbers are `chosen`; how many they are."""
    key = next(iter(table.primary_key))
    ids = damaged_ids(connection, table, connection.scalars(chosen).all())
    if ids:
        connection.execute(sa.delete(table).where(key.in_(ids)))
        forget(connection, table.name)
    return len(ids)


def overwrite(connection: Connection, table: sa.Table, id_: int, values: Mapping[str, Any]) -> None:
    """Writes what was made anew over a damaged row, which is whole from then on."""
    connection.execute(sa.update(table).where(table.c.id == id_).values(**values))
    healed(connection, table, id_)
