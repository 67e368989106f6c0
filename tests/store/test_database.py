"""Transactions of several processes, and what the database's errors turn into."""

from __future__ import annotations

import shutil
import sqlite3
import threading
from pathlib import Path

import pytest
import sqlalchemy as sa

from shm.errors import StoreBusy, StoreError
from shm.store import Stage, Store, database
from shm.store.recordings import count_stages, list_recordings
from shm.store.watch import list_selected_models
from tests.helpers.no_room import no_room
from tests.helpers.nouns import NOW, a_file
from tests.helpers.quick_stores import AS_SHIPPED


def test_many_writers_never_find_the_store_locked(store: Store) -> None:
    """Read, then write, from four connections at once: a deferred BEGIN fails most of these."""
    failures: list[str] = []

    def write(first: int) -> None:
        try:
            for number in range(first, first + 25):
                store.recordings.receive(a_file(number), NOW)
        except StoreError as error:
            failures.append(str(error))

    threads = [threading.Thread(target=write, args=(100 * i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert count_stages(store)[Stage.RECEIVED] == 100


def test_a_store_held_by_another_process_is_busy_and_says_when_to_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "BUSY_SECONDS", 0.05)
    with Store.create(tmp_path / "shm.db") as store:
        holder = sqlite3.connect(tmp_path / "shm.db", isolation_level=None)
        holder.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreBusy) as caught:
            store.recordings.receive(a_file(1), NOW)
        assert caught.value.retry_after_s == 1.0
        assert list_recordings(store) == ()  # reading goes on meanwhile
        holder.execute("ROLLBACK")
        holder.close()
        store.recordings.receive(a_file(1), NOW)


def test_a_full_disk_is_told_and_waited_for(file_store: Store) -> None:
    with file_store.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA max_page_count = 1")
    with pytest.raises(StoreError, match="disk is full") as caught:
        file_store.recordings.receive(a_file(1, file_name="x" * 10_000_000), NOW)
    assert caught.value.retry_after_s == 60.0
    assert "Free some space" in str(caught.value)


def test_a_store_without_room_is_read_from_a_copy(file_store: Store, tmp_path: Path) -> None:
    """A killed process left its newest rows in the log, and there is no room for an index of it."""
    file_store.recordings.receive(a_file(1), NOW)
    left = tmp_path / "left"
    left.mkdir()
    source = Path(str(file_store.engine.url.database))
    for suffix in ("", "-wal"):
        shutil.copyfile(f"{source}{suffix}", left / f"shm.db{suffix}")
    assert (left / "shm.db-wal").stat().st_size > 0
    with no_room(), pytest.raises(StoreError):
        Store.open(left / "shm.db")
    with no_room():
        store = Store.open(left / "shm.db", or_copy=True)
    with store:
        assert store.copied
        assert [each.file.sha256 for each in list_recordings(store)] == [a_file(1).sha256]
        with store.reading(), store.reading() as second:
            assert second.execute(sa.text("SELECT count(*) FROM recordings")).scalar() == 1
        with pytest.raises(StoreError, match="cannot be written"):
            store.recordings.receive(a_file(2), NOW)


def test_a_store_that_cannot_be_written_says_what_to_do(file_store: Store) -> None:
    with file_store.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA query_only = 1")
    with pytest.raises(StoreError, match="cannot be written"):
        file_store.recordings.receive(a_file(1), NOW)


def test_a_transaction_is_all_or_nothing(store: Store) -> None:
    values = "(1, 'beam1', '2026-05-01')"
    insert = sa.text(f"INSERT INTO selections (hanger, model, selected_at) VALUES {values}")

    def insert_and_fail() -> None:
        with store.writing() as connection:
            connection.execute(insert)
            assert connection.scalar(sa.text("SELECT count(*) FROM selections")) == 1
            raise RuntimeError

    with pytest.raises(RuntimeError):
        insert_and_fail()
    assert list_selected_models(store) == {}


def test_a_reference_to_nothing_is_refused(store: Store) -> None:
    orphan = sa.text(
        "INSERT INTO baselines (hanger, posterior_id, set_at, who, why)"
        " VALUES (3, 99, '2026-05-01', '', '')"
    )
    with (
        pytest.raises(StoreError, match=r"(?i)foreign key") as caught,
        store.writing() as connection,
    ):
        connection.execute(orphan)
    assert caught.value.retry_after_s is None


def test_commits_outlast_a_power_cut(sqlite: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(database._EVENTS, "sqlite", AS_SHIPPED)
    with Store.open(sqlite) as store, store.engine.connect() as connection:
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
        assert connection.exec_driver_sql("PRAGMA synchronous").scalar() == 2


def test_what_was_committed_outlasts_a_crash_of_the_server(server_store: Store) -> None:
    """The tests' own server is told otherwise for speed; the store must not tell a server so."""
    with server_store.reading() as connection:
        asked = sa.text("SELECT source FROM pg_settings WHERE name = 'synchronous_commit'")
        assert connection.scalar(asked) == "configuration file"
