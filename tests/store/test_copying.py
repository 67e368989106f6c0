"""Copies of a store, and the check of one: both hold the same afterwards, or nothing changed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import sqlalchemy as sa
from sqlalchemy.engine import RowMapping

from shm.errors import StoreError, UsageError
from shm.store import Store, backups
from shm.store.backups import check_store, copy_store
from shm.store.posteriors import list_history
from shm.store.recordings import list_recordings
from shm.store.tables import posteriors
from tests.helpers.contents import held, quiet
from tests.helpers.nouns import NOW, a_file
from tests.store.make_released_database import fill


def test_a_copy_holds_the_same_in_either_kind_and_is_numbered_on(
    filled: Store, empty: str | Path
) -> None:
    copied = copy_store(filled, empty, quiet)
    assert copied == held(filled)
    assert sum(each.rows for each in copied) > 20
    with Store.open(empty) as copy:
        assert held(copy) == copied
        assert np.array_equal(latest_tension_n(copy), latest_tension_n(filled))
        newest = list_recordings(copy)[-1].id
        assert copy.recordings.receive(a_file(9), NOW).recording.id == newest + 1


def latest_tension_n(store: Store) -> np.ndarray:
    return list_history(store, 3)[-1][1].tension_n


def test_a_copy_goes_only_into_an_empty_store(file_store: Store, empty: str | Path) -> None:
    fill(file_store)
    with Store.create(empty) as other:
        other.recordings.receive(a_file(7), NOW)
        before = held(other)
        with pytest.raises(UsageError, match="rows already"):
            copy_store(file_store, empty, quiet)
        assert held(other) == before


def test_a_copy_that_differs_is_undone(
    file_store: Store, empty: str | Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(file_store)
    Store.create(empty).close()
    written = backups._write

    def altered(connection: sa.Connection, table: sa.Table, rows: Sequence[RowMapping]) -> None:
        written(connection, table, rows)
        if table is posteriors:
            connection.execute(sa.update(posteriors).values(log_evidence=0.5))

    monkeypatch.setattr(backups, "_write", altered)
    with pytest.raises(StoreError, match="differs from the store in posteriors;"):
        copy_store(file_store, empty, quiet)
    with Store.open(empty) as copy:
        assert sum(each.rows for each in held(copy)) == 0


def test_a_page_that_was_overwritten_is_found(file_store: Store, sqlite: Path) -> None:
    fill(file_store)
    file_store.close()
    with sqlite.open("r+b") as file:
        file.seek(8 * 4096)
        file.write(b"\xff" * 4096)
    with Store.open(sqlite) as store:
        try:
            troubles = check_store(store, quiet).troubles
        except StoreError as error:
            troubles = (str(error),)
    assert any("damaged" in trouble for trouble in troubles)
