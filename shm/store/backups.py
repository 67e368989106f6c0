"""Check a store and its archive; back it up, restore it and copy it, each compared row by row."""

from __future__ import annotations

import hashlib
import sqlite3
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import BadZipFile

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine, RowMapping

from shm.errors import NothingThere, SchemaOutdated, StoreDamaged, StoreError, UsageError, sentence
from shm.read.sidecar import SIDECAR_SUFFIX
from shm.store import schema
from shm.store.archive import Archive, checksum, sync
from shm.store.blobs import unpack
from shm.store.columns import Document, loads
from shm.store.database import BUSY_SECONDS, Database, make_engine, translated
from shm.store.schema import changed_objects
from shm.store.store import Store
from shm.store.tables import fingerprints, metadata, posteriors, recordings, tests
from shm.store.upkeep import list_removed_names

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


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong: its `kind` to count it by, where it is, what it is, what to do."""

    kind: str
    where: str
    what: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"{self.where}: {self.what} {self.remedy}".rstrip()


@dataclass(frozen=True)
class CheckedStore:
    """Hold the content of every table, and what is wrong with file, references, rows and schema."""

    tables: tuple[TableContent, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def troubles(self) -> tuple[str, ...]:
        """The same as sentences."""
        return tuple(map(str, self.findings))

    @property
    def unfit(self) -> tuple[str, ...]:
        """Troubles for which it cannot be put in another's place; a schema is not copied, and a
        row that cannot be read stops its hanger alone."""
        return tuple(str(each) for each in self.findings if each.kind not in _ALLOWED)


_ALLOWED = ("changed schema", "unreadable row")


_RESTORE = "Restore the store from a backup: `shm db restore FILE --replace`."
_CHANGED = "its schema is not what the migrations make; rows may be read or kept wrongly."
_COPY = "Write `shm db backup FILE` and restore it with `shm db restore FILE --replace`."


@dataclass(frozen=True)
class CheckedArchive:
    """Raw files by their path in the archive: those that are as they were, and those that are not.

    `unreferenced` belong to no recording, as after a crash; they do no harm. `removed` is how many
    were taken out on purpose, as copies of them lie elsewhere.
    """

    whole: int
    missing: tuple[str, ...]
    damaged: tuple[str, ...]
    unreferenced: tuple[str, ...]
    removed: int = 0

    @property
    def troubles(self) -> tuple[str, ...]:
        return file_troubles(self.missing, self.damaged)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """A finding a file."""
        gone = ("missing raw file", "it is not in the archive.", self.missing)
        changed = ("damaged raw file", "it has another SHA-256.", self.damaged)
        return tuple(
            Finding(kind, f"archive/{name}", what, _HEAL)
            for kind, what, names in (gone, changed)
            for name in names
        )


_HEAL = "Drop the same file into the spool again, or bring it back: `shm archive fetch`."


def file_troubles(missing: Iterable[str], damaged: Iterable[str]) -> tuple[str, ...]:
    """A sentence a file."""
    return (
        *(f"{name} is not in the archive" for name in missing),
        *(f"{name} of the archive has another SHA-256" for name in damaged),
    )


def quick_troubles(store: Database) -> tuple[str, ...]:
    """Return what a look at the pages of a SQLite file finds wrong; of a server, nothing."""
    with store.reading() as connection:
        return _faults(connection, "quick_check(5)")


def check_store(store: Database, tell: Tell) -> CheckedStore:
    """Read everything that the store holds; raises StoreError where it cannot be read."""
    with store.reading() as connection:
        try:
            found = [_fault(each) for each in _faults(connection, "integrity_check")]
            found += _broken_references(connection)
            found += [
                Finding("changed schema", name, _CHANGED, _COPY)
                for name in changed_objects(connection)
            ]
            tables = contents(connection, tell, partial(_note_unreadable, found))
            return CheckedStore(tables, tuple(found))
        except (sa.exc.DatabaseError, ValueError) as error:
            if connection.dialect.name != "sqlite":
                raise
            cause = getattr(error, "orig", None) or error
            return CheckedStore((), (_fault(f"the file is damaged: {cause}"),))


def _fault(message: str) -> Finding:
    return Finding("fault of the file", "store", sentence(message), _RESTORE)


def _note_unreadable(found: list[Finding], table: sa.Table, rows: Sequence[RowMapping]) -> None:
    for row in rows:
        columns = [c.name for c in table.c if not _is_readable(c, row[c.name])]
        if columns:
            key = ",".join(str(row[column.name]) for column in table.primary_key)
            what = f"its {' and '.join(columns)} cannot be read."
            found.append(Finding("unreadable row", f"{table.name}/{key}", what, _RESTORE))


def _is_readable(column: sa.Column[Any], value: Any) -> bool:
    try:
        if value is not None and isinstance(column.type, Document):
            loads(value)
        elif value is not None and column in _PACKED:
            unpack(bytes(value))  # each array has a checksum
    except (StoreDamaged, ValueError, OSError, KeyError, EOFError, BadZipFile, zlib.error):
        return False
    return True


_PACKED = {posteriors.c.samples, tests.c.frequency_response, fingerprints.c.shapes}


def check_archive(store: Store, archive: Archive, tell: Tell) -> CheckedArchive:
    """Reads every raw file that the store refers to and compares it with its name, a SHA-256."""
    referenced, removed = archived_names(store), list_removed_names(store, archive)
    names = [name for name in referenced if name not in removed]
    missing, damaged = [], []
    for number, name in enumerate(names, start=1):
        path = archive.folder / name
        if not path.is_file():
            missing.append(name)
        elif checksum(path) != path.name[:64]:
            damaged.append(name)
        tell("archive", number / len(names))
    whole = len(names) - len(missing) - len(damaged)
    return CheckedArchive(
        whole, tuple(missing), tuple(damaged), _unreferenced(archive, referenced), len(removed)
    )


def archived_names(store: Database) -> tuple[str, ...]:
    """Every file of the archive that a recording refers to, sidecars too, each once."""
    rows = store.rows(sa.select(recordings.c.archived_as, recordings.c.sidecar_as))
    return tuple(sorted({name for row in rows for name in row if name is not None}))


def unknown_files(store: Database, archive: Archive) -> tuple[str, ...]:
    """Raw files that no recording refers to, by their path in the archive; no sidecars."""
    found = _unreferenced(archive, archived_names(store))
    return tuple(name for name in found if not name.endswith(SIDECAR_SUFFIX))


def of_no_recording(names: Sequence[str]) -> tuple[str, str]:
    """Return a message on such files, and what to do."""
    return (
        f"{len(names)} of the archive belong to no recording: {names[0]}"
        + (" and others" if names[1:] else ""),
        "They came after the backup that was restored, or while a process ended. Take each in "
        f"again: `shm ingest archive/{names[0]}`.",
    )


def _unreferenced(archive: Archive, names: Collection[str]) -> tuple[str, ...]:
    archived = (path.relative_to(archive.folder).as_posix() for path in archive.folder.glob("??/*"))
    return tuple(sorted(set(archived) - set(names)))


def _faults(connection: Connection, check: str) -> tuple[str, ...]:
    """Return what SQLite finds wrong with its file.

    A PostgreSQL server watches over its own pages.
    """
    if connection.dialect.name != "sqlite":
        return ()
    found = connection.exec_driver_sql(f"PRAGMA {check}").scalars()
    return tuple(f"the file is damaged: {message}" for message in found if message != "ok")


def _broken_references(connection: Connection) -> list[Finding]:
    """Rows that refer to one that is not there; a PostgreSQL server allows none."""
    if connection.dialect.name != "sqlite":
        return []
    gone = "it refers to a row of {} that is not there."
    return [
        Finding("broken reference", f"{row[0]}/{row[1]}", gone.format(row[2]), _RESTORE)
        for row in connection.exec_driver_sql("PRAGMA foreign_key_check")
    ]


_PAGES_AT_ONCE = 1000  # technical: 4 MB, between which the daemon may write


@dataclass(frozen=True)
class Restored:
    """Content of a store after a restore, and the backup of the former content, if any."""

    tables: tuple[TableContent, ...]
    former: Path | None


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
            former = _cleared(target, keep_as, tell, replace)
            return Restored(_copied(source, target, tell, replace=replace), former)


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
    _move_away(target, keep_as)
    return keep_as


def _move_away(path: Path, keep_as: Path) -> None:
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
