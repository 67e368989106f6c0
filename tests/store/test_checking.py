"""`shm db check` names what cannot be read: a document that is none, arrays that were changed."""

from __future__ import annotations

import pytest
import sqlalchemy as sa

from shm.store import Store
from shm.store.backups import check_store, contents
from tests.store.make_released_database import fill


def quiet(_: str, __: float) -> None:
    pass


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ("UPDATE tests SET document = substr(document, 2) WHERE id = 2", "tests/2: its document"),
        ("UPDATE alerts SET document = 'no' WHERE id = 1", "alerts/1: its document"),
        ("UPDATE holds SET document = '' WHERE id = 1", "holds/1: its document"),
        ("UPDATE posteriors SET samples = x'00' WHERE id = 3", "posteriors/3: its samples"),
    ],
)
def test_a_row_that_cannot_be_read_is_named(file_store: Store, change: str, where: str) -> None:
    fill(file_store)
    assert check_store(file_store, quiet).findings == ()
    with file_store.writing() as connection:
        connection.exec_driver_sql(change)
    (finding,) = check_store(file_store, quiet).findings
    assert str(finding).startswith(f"{where} cannot be read. Restore the store from a backup")
    # The rest of the store may still be put in another's place.
    assert check_store(file_store, quiet).unfit == ()


def test_a_bit_of_packed_arrays_is_noticed(file_store: Store) -> None:
    fill(file_store)
    with file_store.writing() as connection:
        blob = bytearray(connection.scalar(sa.text("SELECT samples FROM posteriors WHERE id = 1")))
        blob[len(blob) // 3] ^= 4
        change = sa.text("UPDATE posteriors SET samples = :blob WHERE id = 1")
        connection.execute(change, {"blob": bytes(blob)})
    assert [each.kind for each in check_store(file_store, quiet).findings] == ["unreadable row"]
    with file_store.reading() as connection:
        assert contents(connection, quiet)  # it is copied as it is
