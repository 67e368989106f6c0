"""Check a store and its archive."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any
from zipfile import BadZipFile

import sqlalchemy as sa
from sqlalchemy.engine import Connection, RowMapping

from shm.errors import StoreDamaged, sentence
from shm.read.sidecar import SIDECAR_SUFFIX
from shm.store.archive import Archive, checksum
from shm.store.blobs import unpack
from shm.store.columns import Document, loads
from shm.store.copying import TableContent, Tell, contents
from shm.store.database import Database
from shm.store.queries.upkeep import list_removed_names
from shm.store.schema import changed_objects
from shm.store.store import Store
from shm.store.tables import fingerprints, posteriors, recordings, tests


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
    """Hold the content of every table, and the faults of file, references and schema."""

    tables: tuple[TableContent, ...]
    faults: tuple[str, ...] = ()
    """What SQLite finds wrong with its file."""
    references: tuple[tuple[str, str], ...] = ()
    """Rows that refer to a row that is not there, each with the table of that one."""
    changed: tuple[str, ...] = ()
    """Tables and indexes that are not as the migrations make them."""
    unreadable: tuple[tuple[str, str], ...] = ()
    """Rows of which a document or packed arrays cannot be read, each with the columns."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """A finding for each fault, broken reference and changed part of the schema."""
        gone = "it refers to a row of {} that is not there."
        return (
            *(
                Finding("fault of the file", "store", sentence(said), _RESTORE)
                for said in self.faults
            ),
            *(
                Finding("broken reference", where, gone.format(table), _RESTORE)
                for where, table in self.references
            ),
            *(Finding("changed schema", name, _CHANGED, _COPY) for name in self.changed),
            *(
                Finding("unreadable row", where, f"its {what} cannot be read.", _RESTORE)
                for where, what in self.unreadable
            ),
        )

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
            faults, references = _faults(connection, "integrity_check"), _references(connection)
            changed, unreadable = changed_objects(connection), list[tuple[str, str]]()
            tables = contents(connection, tell, partial(_note_unreadable, unreadable))
            return CheckedStore(tables, faults, references, changed, tuple(unreadable))
        except (sa.exc.DatabaseError, ValueError) as error:
            if connection.dialect.name != "sqlite":
                raise
            cause = getattr(error, "orig", None) or error
            return CheckedStore((), (f"the file is damaged: {cause}",))


def _note_unreadable(
    found: list[tuple[str, str]], table: sa.Table, rows: Sequence[RowMapping]
) -> None:
    for row in rows:
        columns = [c.name for c in table.c if not _is_readable(c, row[c.name])]
        if columns:
            key = ",".join(str(row[column.name]) for column in table.primary_key)
            found.append((f"{table.name}/{key}", " and ".join(columns)))


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
    kept = (path.relative_to(archive.folder).as_posix() for path in archive.folder.glob("??/*"))
    return tuple(sorted(set(kept) - set(names)))


def _faults(connection: Connection, check: str) -> tuple[str, ...]:
    """Return what SQLite finds wrong with its file.

    A PostgreSQL server watches over its own pages.
    """
    if connection.dialect.name != "sqlite":
        return ()
    found = connection.exec_driver_sql(f"PRAGMA {check}").scalars()
    return tuple(f"the file is damaged: {said}" for said in found if said != "ok")


def _references(connection: Connection) -> tuple[tuple[str, str], ...]:
    """Rows that refer to one that is not there; a PostgreSQL server allows none."""
    if connection.dialect.name != "sqlite":
        return ()
    broken = connection.exec_driver_sql("PRAGMA foreign_key_check")
    return tuple((f"{row[0]}/{row[1]}", str(row[2])) for row in broken)
