"""Backups and restores: a store then holds what the backup held, or is untouched."""

from __future__ import annotations

import shutil
import sqlite3
import threading
from pathlib import Path

import pytest

from shm.errors import NothingThere, SchemaOutdated, StoreError, UsageError
from shm.store import Store, backups
from shm.store.backups import back_up, check_store, restore
from shm.store.recordings import count_stages
from tests.helpers.contents import held, quiet
from tests.helpers.nouns import NOW, a_file
from tests.helpers.slow import few_of
from tests.store.make_released_database import fill

RELEASED = sorted(Path(__file__).parent.glob("data/schema_*.db"))


def test_a_backup_is_one_file_that_restores_into_either_kind(
    filled: Store, empty: str | Path, tmp_path: Path
) -> None:
    file = tmp_path / "backups" / "may.db"
    checked = back_up(filled, file, quiet)
    assert (written := checked.tables) == held(filled)
    assert checked.troubles == ()
    assert [path.name for path in file.parent.iterdir()] == ["may.db"]
    restored = restore(empty, file, tmp_path / "kept.db", quiet)
    assert (restored.tables, restored.former) == (written, None)


def test_a_backup_is_consistent_while_others_write(
    file_store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backups, "_PAGES_AT_ONCE", 1)
    fill(file_store)
    before = count_stages(file_store)
    numbers = iter(range(100, 200))
    told: list[float] = []

    def write_meanwhile(label: str, fraction: float) -> None:
        if label == "copying pages":
            told.append(fraction)
        if len(told) < 40:
            writer = threading.Thread(
                target=file_store.recordings.receive, args=(a_file(next(numbers)), NOW)
            )
            writer.start()
            writer.join()

    back_up(file_store, tmp_path / "backup.db", write_meanwhile)
    assert told == sorted(told)  # it did not begin anew
    with Store.open(tmp_path / "backup.db") as backup:
        assert count_stages(backup) == before
        assert check_store(backup, quiet).troubles == ()


def test_a_backup_overwrites_no_file(filled: Store, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(UsageError, match="there already"):
        back_up(filled, tmp_path / "notes.txt", quiet)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_restore_overwrites_nothing_unless_told_and_then_keeps_the_old(
    filled: Store, location: str | Path, tmp_path: Path
) -> None:
    file, kept = tmp_path / "backup.db", tmp_path / "kept.db"
    back_up(filled, file, quiet)
    first = held(filled)
    filled.recordings.receive(a_file(8), NOW)
    second = held(filled)
    with pytest.raises(UsageError, match="--replace"):
        restore(location, file, kept, quiet)
    assert held(filled) == second
    restored = restore(location, file, kept, quiet, replace=True)
    assert (restored.tables, restored.former) == (first, kept)
    assert held(filled) == first  # an open store sees it too
    with Store.open(kept) as old:
        assert held(old) == second


@pytest.mark.parametrize("released", few_of(RELEASED, 3), ids=lambda path: path.stem)
def test_a_backup_of_an_older_schema_restores(server: str, released: Path, tmp_path: Path) -> None:
    content = released.read_bytes()
    restore(server, released, tmp_path / "kept.db", quiet)
    assert released.read_bytes() == content
    with Store.open(server) as store:
        assert [test.test.id for test in store.tests.list_all(3)][:2] == ["t1", "t2"]


def test_a_damaged_store_is_moved_aside_by_a_restore_that_may_replace(
    file_store: Store, sqlite: Path, tmp_path: Path
) -> None:
    fill(file_store)
    file, kept = tmp_path / "backup.db", tmp_path / "kept.db"
    back_up(file_store, file, quiet)
    expected = held(file_store)
    file_store.close()
    for leftover in tmp_path.glob("shm.db*"):
        leftover.unlink()
    sqlite.write_bytes(b"rubbish, and enough of it to be taken for a database" * 100)
    with pytest.raises(StoreError, match="not a database"):
        restore(sqlite, file, kept, quiet)
    restored = restore(sqlite, file, kept, quiet, replace=True)
    assert (restored.tables, restored.former) == (expected, kept)
    assert kept.read_bytes().startswith(b"rubbish")


def test_what_is_no_backup_is_not_restored(file_store: Store, sqlite: Path, tmp_path: Path) -> None:
    fill(file_store)
    before, kept = held(file_store), tmp_path / "kept.db"
    with pytest.raises(NothingThere):
        restore(sqlite, tmp_path / "none.db", kept, quiet, replace=True)
    other = tmp_path / "other.db"
    connection = sqlite3.connect(other)
    connection.execute("CREATE TABLE birds (name TEXT)")
    connection.close()
    with pytest.raises(SchemaOutdated, match="holds no store"):
        restore(sqlite, other, kept, quiet, replace=True)
    other.write_bytes(b"no database at all, though as long as one" * 100)
    with pytest.raises(StoreError, match="not a database"):
        restore(sqlite, other, kept, quiet, replace=True)
    assert held(file_store) == before
    assert not kept.exists()


def test_a_damaged_backup_is_not_restored(file_store: Store, sqlite: Path, tmp_path: Path) -> None:
    fill(file_store)
    before, file = held(file_store), tmp_path / "backup.db"
    back_up(file_store, file, quiet)
    orphaned = shutil.copyfile(file, tmp_path / "orphaned.db")
    connection = sqlite3.connect(orphaned)
    with connection:
        connection.execute("DELETE FROM posteriors WHERE id = 1")
    connection.close()
    with pytest.raises(StoreError, match="refers to a row of posteriors that is not there"):
        restore(sqlite, orphaned, tmp_path / "kept.db", quiet, replace=True)
    assert held(file_store) == before
