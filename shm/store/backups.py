"""Backups of a store, and the way back; copies of a store into an empty one.

A backup is one SQLite file, whichever kind the store is of, so that it opens everywhere.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from shm.errors import NothingThere, SchemaOutdated, StoreDamaged, StoreError, UsageError, sentence
from shm.store import schema
from shm.store.archive import sync
from shm.store.checking import CheckedStore, check_store
from shm.store.copying import TableContent, Tell, copy_rows, delete_rows, row_counts
from shm.store.database import BUSY_SECONDS, Database, make_engine, translated

_PAGES_AT_ONCE = 1000  # technical: 4 MB, between which the daemon may write


@dataclass(frozen=True)
class Restored:
    """Content of a store after a restore, and the backup of the former content, if any."""

    tables: tuple[TableContent, ...]
    kept: Path | None


def back_up(store: Database, file: Path, tell: Tell) -> CheckedStore:
    """Writes what the store holds at one instant into a new file; others go on meanwhile.

    The file appears whole or not at all, and what is damaged in the store is damaged in it too: all
    else is worth keeping. Raises UsageError where it is there already.
    """
    if file.exists():
        raise UsageError(f"{file} is there already.", remedy="Give the backup another name.")
    file.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=file.parent, prefix=".backup-") as folder:
        temporary = Path(folder) / "shm.db"
        if store.engine.dialect.name == "sqlite":
            _snapshot(Path(str(store.engine.url.database)), temporary, tell)
        else:
            _copied(store.engine, temporary, tell)
        checked = _checked(temporary, tell)
        _into_place(temporary, file)
    return checked


def copy_store(store: Database, target: str | Path, tell: Tell) -> tuple[TableContent, ...]:
    """Copies a store into another, of either kind, which is made where there is none.

    Raises StoreError where that one holds anything; then, as at any error, it stays as it was.
    """
    return _copied(store.engine, target, tell)


def restore(
    target: str | Path, file: Path, keep_as: Path, tell: Tell, *, replace: bool = False
) -> Restored:
    """Puts what a backup holds into a store; with `replace` also into one that holds something.

    What that one held is first backed up as `keep_as`; a file that cannot be read as a store is
    moved there. Raises NothingThere, UsageError or StoreError; the store then stays as it was.
    """
    if not file.is_file():
        raise NothingThere(f"there is no backup {file}.", remedy="Check its path.")
    with TemporaryDirectory(dir=keep_as.parent, prefix=".restore-") as folder:
        backup = Path(folder) / "shm.db"
        _snapshot(file, backup, tell)
        with _opened(backup) as source:
            _made_present(source, file)
            _must_be_whole(source, file, tell)
            kept = _cleared(target, keep_as, tell, replace)
            return Restored(_copied(source, target, tell, replace=replace), kept)


def _copied(
    source: Engine, target: str | Path, tell: Tell, *, replace: bool = False
) -> tuple[TableContent, ...]:
    with _opened(target) as engine:
        schema.upgrade(engine)
        with Database(source).reading() as reading, Database(engine).writing() as writing:
            if replace:
                delete_rows(writing)
            held = sum(row_counts(writing).values())
            if held:
                raise _holds(Database(engine).location, held)
            return copy_rows(reading, writing, tell)


def _cleared(target: str | Path, keep_as: Path, tell: Tell, replace: bool) -> Path | None:
    """Sees that nothing is lost: where the store's contents are kept, None where it is empty."""
    if "://" not in str(target) and not Path(target).exists():
        return None
    try:
        with _opened(target) as engine:
            schema.upgrade(engine)
            with Database(engine).reading() as connection:
                held = sum(row_counts(connection).values())
                changed = bool(schema.changed_objects(connection))
            if not (held or changed):
                return None
            if not replace:
                raise _holds(Database(engine).location, held)
            if not (changed and isinstance(target, Path)):
                back_up(Database(engine), keep_as, tell)
                return keep_as
    except StoreError as error:
        mendable = error.retry_after_s is not None and not isinstance(error, StoreDamaged)
        if mendable or not replace or not isinstance(target, Path):
            raise
    _move_aside(target, keep_as)
    return keep_as


def _move_aside(path: Path, keep_as: Path) -> None:
    """A file that is no store any more, with what SQLite keeps beside it."""
    for ending in ("-wal", "-shm", ""):
        part = path.with_name(path.name + ending)
        if part.exists():
            part.rename(keep_as.with_name(keep_as.name + ending))


def _holds(location: str, rows: int) -> UsageError:
    return UsageError(
        f"the store {location} holds {rows} rows already; nothing was changed.",
        remedy="Take an empty one; `shm db restore --replace` keeps the old one beside.",
    )


def _made_present(engine: Engine, file: Path) -> None:
    """Brings the backup of an older schema to the present one."""
    if schema.version(engine) is None:
        raise SchemaOutdated(f"{file} holds no store.", remedy="Give a file of `shm db backup`.")
    schema.upgrade(engine)


def _must_be_whole(engine: Engine, file: Path, tell: Tell) -> None:
    troubles = check_store(Database(engine), tell).unfit
    if troubles:
        raise StoreError(
            f"the backup {file} is damaged: {' '.join(map(sentence, troubles))}",
            remedy="Take an older one.",
        )


def _checked(path: Path, tell: Tell) -> CheckedStore:
    with _opened(path) as engine:
        return check_store(Database(engine), tell)


@contextmanager
def _opened(location: str | Path) -> Iterator[Engine]:
    engine = make_engine(location, poolclass=sa.NullPool)
    try:
        yield engine
    finally:
        engine.dispose()


def _snapshot(source: Path, target: Path, tell: Tell) -> None:
    """Copies a SQLite database as it is at one instant, while others write to it."""
    with (
        translated(str(source), sqlite3.Error),
        closing(sqlite3.connect(source, timeout=BUSY_SECONDS)) as reading,
        closing(sqlite3.connect(target)) as writing,
    ):
        # An open view of the source: without it each write of another process starts it all anew.
        reading.execute("BEGIN")
        reading.execute("SELECT count(*) FROM sqlite_master").fetchall()
        reading.backup(
            writing,
            pages=_PAGES_AT_ONCE,
            progress=lambda _, left, total: tell("copying pages", 1.0 - left / max(total, 1)),
        )


def _into_place(temporary: Path, file: Path) -> None:
    with closing(sqlite3.connect(temporary)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")  # one file, readable from anywhere
    sync(temporary)
    temporary.rename(file)
    sync(file.parent)
