"""A row that somebody took out is missed, whichever it is, but for those that leave no trace."""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.store import Store, Workspace
from shm.store.backups import back_up, copy_store, restore
from shm.store.checking import check_store
from shm.store.copying import NUMBERED, noted
from shm.store.database import make_engine
from shm.store.files import write_event
from shm.store.missing import MissingRow, missing_rows
from shm.store.tables import metadata
from shm_cli import working
from shm_cli.main import run
from tests.helpers import quick_update
from tests.helpers.contents import quiet
from tests.helpers.damaging import damage
from tests.helpers.flows import threads
from tests.helpers.histories import EPOCH, a_history
from tests.helpers.postgres import Databases
from tests.store.make_released_database import fill

MAY_GO = (
    "summaries", "watch_states", "stream_windows", "pooled_readings", "stream_events",
    "stream_watch", "stream_watch_days", "stream_progress",
)  # fmt: skip
"""Made again by themselves, or taken out after some time: a row of these is not missed."""

LAST = (
    "acknowledgements", "archive_copies", "audit", "changed_settings", "diagnoses", "events",
    "notes", "sessions", "silences", "tokens", "users",
)  # fmt: skip
"""Of these the last row leaves no gap, and nothing else tells of it: what a person did."""

ON_A_SERVER = ("drifts", "fingerprints", "resolutions", "steps", "watches")
"""Where a skipped number says nothing: what was superseded, steps between others, what came without
the time of its file, as from before schema 0007, and the end of what no hook was told of."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return a_history(tmp_path_factory.mktemp("missing")).folder


@pytest.fixture
def bridge(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """The history, to be changed at will, with the sampler's stand-in."""
    quick_update.stand_in(monkeypatch.setattr)
    monkeypatch.setattr(working, "executor_of", threads)
    return Workspace.open(Path(shutil.copytree(made, tmp_path / "bridge")))


@contextmanager
def unguarded(location: str | Path) -> Iterator[Connection]:
    """A transaction that no foreign key is asked in, undone at its end unless it is committed."""
    engine = make_engine(location, poolclass=sa.NullPool)
    with engine.connect() as connection:
        if engine.dialect.name == "sqlite":
            raw = connection.connection.dbapi_connection
            assert raw is not None
            raw.execute("PRAGMA foreign_keys = OFF")  # type: ignore[attr-defined]
        else:
            connection.exec_driver_sql("SET session_replication_role = replica")
        yield connection
        connection.rollback()


def take_out(location: str | Path, table: str, id_: int) -> None:
    with unguarded(location) as connection:
        key = next(iter(metadata.tables[table].primary_key))
        connection.execute(sa.delete(metadata.tables[table]).where(key == id_))
        connection.commit()


def not_missed(location: str | Path) -> tuple[dict[str, int], dict[str, list[tuple[int, ...]]]]:
    """Takes out each row by itself: how many were tried, and those that were not missed."""
    tried: Counter[str] = Counter()
    unseen: dict[str, list[tuple[int, ...]]] = {}
    with unguarded(location) as connection:
        assert missing_rows(connection) == ()
        for table in metadata.sorted_tables:
            keys = list(table.primary_key)
            for key in connection.execute(sa.select(*keys).order_by(*keys)).all():
                here = (column == value for column, value in zip(keys, key, strict=True))
                with connection.begin_nested() as deleted:
                    connection.execute(sa.delete(table).where(*here))
                    if not missing_rows(connection):
                        unseen.setdefault(table.name, []).append(tuple(key))
                    deleted.rollback()
                tried[table.name] += 1
    return tried, unseen


@pytest.mark.slow
def test_each_row_is_missed_but_for_those_that_leave_no_trace(made: Path) -> None:
    tried, unseen = not_missed(made / "shm.db")
    assert set(tried) == set(metadata.tables)  # each table has a row
    expected = {name: tried[name] for name in MAY_GO} | dict.fromkeys(LAST, 1)
    assert {name: len(keys) for name, keys in unseen.items()} == expected
    assert all(unseen[name] == [(tried[name],)] for name in LAST)


@pytest.mark.slow
def test_on_a_server_a_skipped_number_says_nothing(postgresql: Databases) -> None:
    with postgresql.store() as url:
        with Store.open(url) as store:
            fill(store)
        tried, unseen = not_missed(url)
    assert set(unseen) <= {*MAY_GO, *LAST, *ON_A_SERVER}
    assert {"holds", "alerts", "deliveries", "tests", "recordings", "baselines"} <= set(tried)


def checked(workspace: Workspace) -> tuple[MissingRow, ...]:
    with workspace.store() as store:
        return check_store(store, quiet).missing


@pytest.mark.parametrize(
    ("table", "id_", "said"),
    [
        ("holds", 6, "the hold of recording 11 is missing"),
        ("watches", 9, "what the watch said of test"),
        ("drifts", 9, "a shift of test"),
        ("acknowledgements", 1, "the acknowledgement of alert"),
    ],
)
def test_what_can_be_made_again_is(
    bridge: Workspace, capsys: pytest.CaptureFixture[str], table: str, id_: int, said: str
) -> None:
    """The number that is skipped is all that is left to be said, where it is."""
    take_out(bridge.location, table, id_)
    assert run(["--workspace", str(bridge.folder), "db", "check"]) == 5
    assert said in " ".join(capsys.readouterr().err.split())
    (found,) = (row for row in checked(bridge) if said in row.message)
    words = found.remedy[found.remedy.index("`shm ") + 5 : found.remedy.rindex("`")].split()
    assert run(["--workspace", str(bridge.folder), *words]) == 0
    after = checked(bridge)
    assert not [row for row in after if said in row.message]


def test_a_backup_that_lacks_a_row_restores_and_goes_on_missing_it(
    bridge: Workspace, tmp_path: Path
) -> None:
    take_out(bridge.location, "tokens", 1)
    with bridge.store() as store:
        (told,) = back_up(store, tmp_path / "may.db", quiet).troubles
    assert told.startswith("row 1 of tokens is missing: its number is skipped.")
    restore(bridge.location, tmp_path / "may.db", tmp_path / "kept.db", quiet, replace=True)
    assert [(row.table, row.id) for row in checked(bridge)] == [("tokens", 1)]


def test_gaps_that_a_file_began_with_say_nothing(bridge: Workspace, tmp_path: Path) -> None:
    """As of a copy of a store in PostgreSQL, which skips numbers."""
    take_out(bridge.location, "tokens", 1)
    with unguarded(bridge.location) as connection:
        connection.exec_driver_sql("PRAGMA user_version = 0")
        connection.commit()
    Store.upgrade(bridge.location)
    with bridge.store() as store:
        copy_store(store, tmp_path / "copy.db", quiet)
    with Store.open(tmp_path / "copy.db") as copy, copy.reading() as connection:
        assert missing_rows(connection) == ()
        others = 2 ** len(NUMBERED) - 1 - (1 << NUMBERED.index("tokens"))
        assert noted(connection) == others


def test_what_is_dropped_for_its_damage_is_not_missed(bridge: Workspace) -> None:
    with bridge.store() as store, store.reading() as connection:
        of_drift = sa.text(
            "SELECT t.recording_id FROM tests t JOIN drifts d ON d.test_id = t.id WHERE d.id = 1"
        )
        recording = str(connection.scalar(of_drift))
    damage(bridge, "drifts", "value", 1)
    words = ("ingest", "--again", recording, "--from", "watched")
    assert run(["--workspace", str(bridge.folder), *words]) == 0
    assert checked(bridge) == ()


def test_what_no_backup_has_is_accepted_and_no_more_than_that(
    bridge: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    with sqlite3.connect(bridge.database) as connection:
        connection.execute("DELETE FROM tokens WHERE id = 1")
        connection.execute(
            "DELETE FROM holds WHERE id = (SELECT max(id) FROM holds WHERE decision IS NULL)"
        )
    check = ["--workspace", str(bridge.folder), "db", "check"]
    assert run([*check, "--accept", "taken out by hand"]) == 5
    said = capsys.readouterr()
    assert "Accepted as gone for good:" in said.err
    assert "waits for a decision that nobody can make" in " ".join(said.err.split())
    assert "tokens" not in said.err
    with bridge.store() as store:
        accepted = {
            event.file_name: event.message for event in store.recordings.list_events("accepted")
        }
    assert accepted["tokens/1"].endswith(": taken out by hand")


@pytest.mark.parametrize(
    ("table", "recording", "which"),
    [
        ("events", 12, "kind = 'held'"),
        ("events", 11, "kind = 'again'"),
        ("events", 14, "kind = 'refused'"),
        ("holds", 9, "decision IS NOT NULL"),
        ("steps", 12, "stage = 'held' AND test_id IS NULL"),
    ],
)
def test_what_was_accepted_stays_accepted_as_work_is_done_again(
    bridge: Workspace, table: str, recording: int, which: str
) -> None:
    """It was called by a sentence with counts, which grew when the recording was held again."""
    first = f"SELECT min(id) FROM {table} WHERE recording_id = {recording} AND {which}"
    with unguarded(bridge.location) as connection:
        id_ = connection.scalar(sa.text(first))
    take_out(bridge.location, table, id_)
    with bridge.store() as store:
        assert (
            store.upkeep.accept_missing("Ann", "no backup", store.recordings.get(1).received_at) > 0
        )
    assert checked(bridge) == ()
    assert run(["--workspace", str(bridge.folder), "ingest", "--again", str(recording)]) in (0, 3)
    assert checked(bridge) == ()
    with bridge.store() as store, store.reading() as connection:
        (newest,) = connection.execute(
            sa.text(f"SELECT max(id) FROM {table} WHERE recording_id = {recording}")
        ).one()
    take_out(bridge.location, table, newest)
    assert checked(bridge)  # what is lost after that is missed all the same


def test_what_an_older_version_accepted_stays_accepted(bridge: Workspace) -> None:
    take_out(bridge.location, "events", 2)
    with bridge.store() as store:
        with store.reading() as connection:
            found = missing_rows(connection)
        with store.writing() as connection:
            for row in found:
                name = f"{row.table}/{row.id}" if row.id else row.message
                write_event(connection, EPOCH, "accepted", None, name, "by Ann")
    assert checked(bridge) == ()


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        ("holds", "document", '{"tests": 5}'),
        ("holds", "document", b"\xff"),
        ("posteriors", "document", "[]"),
        ("watches", "test_id", "x"),
        ("watches", "document", '{"shifts": 1}'),
        ("alerts", "document", '{"hooks": 3}'),
    ],
)
def test_a_damaged_row_is_told_and_does_not_end_the_check(
    bridge: Workspace, table: str, column: str, value: str | bytes
) -> None:
    with unguarded(bridge.database) as connection:
        change = f"UPDATE {table} SET {column} = ? WHERE id = 1"
        connection.exec_driver_sql(change, (value,))
        connection.commit()
    with bridge.store() as store:
        checked = check_store(store, quiet)
    assert [row.table for row in checked.damaged] == [table]
