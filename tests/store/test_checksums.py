"""Any value of any row that is not as it was written is found, in a file and on a server."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import pytest
import sqlalchemy as sa

from shm.errors import DamagedRow
from shm.store import Store
from shm.store.checking import check_store
from shm.store.checksums import plain_table
from shm.store.tables import metadata, tokens
from shm.store.upkeep import damaged_among
from tests.helpers.contents import quiet
from tests.helpers.damaging import change, flipped
from tests.helpers.nouns import NOW
from tests.store.make_released_database import fill


def test_a_change_of_any_value_of_any_row_is_found(filled: Store) -> None:
    tried = 0
    for table in metadata.sorted_tables:
        plain = plain_table(table.name)
        for column in table.columns:
            if column.primary_key or column.foreign_keys or column.unique:
                continue
            there = sa.select(plain).where(plain.c[column.name].is_not(None)).limit(1)
            with filled.engine.begin() as connection:
                row = connection.execute(there).mappings().first()
                if row is None:
                    continue
                keys = (plain.c[key.name] == row[key.name] for key in table.primary_key)
                altered = sa.update(plain).where(*keys)
                connection.execute(altered.values({column.name: _other(row[column.name])}))
                after = connection.execute(
                    sa.select(plain).where(
                        *(plain.c[k.name] == row[k.name] for k in table.primary_key)
                    )
                ).mappings()
                assert list(damaged_among(table, after.all())), f"{table.name}.{column.name}"
                connection.rollback()
                tried += 1
    assert tried > 100
    assert check_store(filled, quiet).troubles == ()


def _other(value: Any) -> Any:
    if isinstance(value, datetime):
        return value + timedelta(microseconds=1)
    if isinstance(value, bool):
        return not value
    return flipped(value)


def test_a_row_that_something_else_wrote_is_named(filled: Store) -> None:
    values = {"name": "forged", "token_sha256": "0" * 64, "scopes": "write", "created_at": NOW}
    with filled.engine.begin() as connection:
        connection.execute(sa.insert(tokens).values(values))
    (found,) = check_store(filled, quiet).damaged
    assert (found.table, found.hanger) == ("tokens", None)


def test_a_damaged_response_does_not_hide_its_test(filled: Store) -> None:
    first = filled.tests.list_all(3)[0]
    assert filled.tests.frequency_response(first) is not None
    with filled.engine.begin() as connection:
        here = sa.update(plain_table("tests")).where(sa.column("id") == first.id)
        connection.execute(here.values(frequency_response=b"rotten"))
    assert filled.tests.get(first.id).test == first.test
    with pytest.raises(DamagedRow, match=r"row 1 of tests of hanger 3 is damaged.*--again"):
        filled.tests.frequency_response(first)


def test_a_changed_digit_is_refused_where_it_is_read(filled: Store) -> None:
    change(_location(filled), "tests", "document", 1, lambda text: text.replace("5.8", "5.9"))
    with pytest.raises(DamagedRow) as caught:
        filled.tests.get(1)
    assert (caught.value.table, caught.value.id, caught.value.hanger) == ("tests", 1, 3)
    assert filled.tests.get(2).test.id == "t2"


def _location(store: Store) -> Any:
    url = store.engine.url
    return (
        url.render_as_string(hide_password=False) if "postgres" in url.drivername else url.database
    )


def test_a_time_that_is_none_holds_up_no_other_row(file_store: Store) -> None:
    fill(file_store)
    change(_location(file_store), "recordings", "received_at", 2, lambda _: "no time")
    assert [each.id for each in file_store.recordings.list_all()] == [1, 3, 4, 5, 6]
    (found,) = check_store(file_store, quiet).damaged
    assert (found.table, found.id) == ("recordings", 2)
