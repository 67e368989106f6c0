"""Whether a store and its archive are whole."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.errors import DamagedRow, sentence
from shm.read.sidecar import SIDECAR_SUFFIX
from shm.store.archive import Archive, checksum
from shm.store.checksums import RESTORE
from shm.store.copying import Rows, TableContent, Tell, contents
from shm.store.database import Database
from shm.store.missing import MissingRow, missing_rows
from shm.store.schema import changed_objects
from shm.store.store import Store
from shm.store.tables import recordings
from shm.store.upkeep import damaged_among


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
    """What every table holds, and what is wrong; nothing is wrong where `troubles` is empty."""

    tables: tuple[TableContent, ...]
    troubles: tuple[str, ...]
    damaged: tuple[DamagedRow, ...] = ()
    missing: tuple[MissingRow, ...] = ()
    changed: tuple[str, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The troubles, each with its place and its remedy apart."""
        known = {str(row): _damaged_finding(row) for row in self.damaged}
        known |= {str(row): _missing_finding(row) for row in self.missing}
        known |= {
            _changed(name): Finding("changed schema", name, _CHANGED, _COPY)
            for name in self.changed
        }
        file = "fault of the file"
        return tuple(
            known.get(each) or Finding(file, "store", sentence(each), RESTORE)
            for each in self.troubles
        )

    @property
    def unfit(self) -> tuple[str, ...]:
        """Troubles for which it cannot be put in another's place: not rows that only are no more,
        since an older backup may lack more than that, nor a changed schema, which is not copied."""
        gone = {str(row) for row in self.missing if not row.referred}
        gone |= set(map(_changed, self.changed))
        return tuple(each for each in self.troubles if each not in gone)


_CHANGED = "its schema is not what the migrations make; rows may be read or kept wrongly."
_COPY = "Write `shm db backup FILE` and restore it with `shm db restore FILE --replace`."


def _changed(name: str) -> str:
    return f"{name}: {_CHANGED} {_COPY}"


def _damaged_finding(row: DamagedRow) -> Finding:
    return Finding("damaged row", f"{row.table}/{row.id}", row.message, row.remedy)


def _missing_finding(row: MissingRow) -> Finding:
    where = row.table if row.id is None else f"{row.table}/{row.id}"
    return Finding("missing row", where, row.message, row.remedy)


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
    """What a look at the pages of a SQLite file finds wrong; of a server, nothing."""
    if store.engine.dialect.name != "sqlite":
        return ()
    with store.reading() as connection:
        found = connection.exec_driver_sql("PRAGMA quick_check(5)").scalars().all()
    return tuple(str(said) for said in found if said != "ok")


def check_store(store: Database, tell: Tell) -> CheckedStore:
    """Reads everything that the store holds; raises StoreError where it cannot be read."""
    with store.reading() as connection:
        try:
            structure, missing = tuple(_damage(connection)), missing_rows(connection)
            changed = changed_objects(connection)
        except sa.exc.DatabaseError as error:
            if connection.dialect.name != "sqlite":
                raise
            structure, missing, changed = (f"the file is damaged: {error.orig}",), (), ()
        checked = read_rows(connection, tell, structure)
        troubles = (*checked.troubles, *map(str, missing), *map(_changed, changed))
        return replace(checked, troubles=troubles, missing=missing, changed=changed)


def read_rows(connection: Connection, tell: Tell, troubles: tuple[str, ...] = ()) -> CheckedStore:
    """What every table holds, and each row that is not as it was written or cannot be decoded."""
    rows: list[DamagedRow] = []
    tables: tuple[TableContent, ...] = ()

    def look(table: sa.Table, some: Rows) -> None:
        rows.extend(damaged_among(table, some))

    try:
        tables = contents(connection, tell, look)
    except sa.exc.DatabaseError as error:
        if connection.dialect.name != "sqlite":
            raise
        troubles = (*troubles, f"the file cannot be read to its end: {error.orig}")
    return CheckedStore(tables, (*troubles, *map(str, rows)), tuple(rows))


def check_archive(store: Store, archive: Archive, tell: Tell) -> CheckedArchive:
    """Reads every raw file that the store refers to and compares it with its name, a SHA-256."""
    referenced, removed = archived_names(store), store.upkeep.removed_names(archive)
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
    with store.reading() as connection:
        rows = connection.execute(sa.select(recordings.c.archived_as, recordings.c.sidecar_as))
        # A flipped bit in the schema may make a name a number.
    return tuple(sorted({str(name) for row in rows for name in row if name is not None}))


def unknown_files(store: Database, archive: Archive) -> tuple[str, ...]:
    """Raw files that no recording refers to, by their path in the archive; no sidecars."""
    found = _unreferenced(archive, archived_names(store))
    return tuple(name for name in found if not name.endswith(SIDECAR_SUFFIX))


def of_no_recording(names: Sequence[str]) -> tuple[str, str]:
    """What is said of such files, and what to do."""
    return (
        f"{len(names)} of the archive belong to no recording: {names[0]}"
        + (" and others" if names[1:] else ""),
        "They came after the backup that was restored, or while a process ended. Take each in "
        f"again: `shm ingest archive/{names[0]}`.",
    )


def _unreferenced(archive: Archive, names: Collection[str]) -> tuple[str, ...]:
    kept = (path.relative_to(archive.folder).as_posix() for path in archive.folder.glob("??/*"))
    return tuple(sorted(set(kept) - set(names)))


def _damage(connection: Connection) -> list[str]:
    """What SQLite finds wrong with its file; a PostgreSQL server watches over its own pages."""
    if connection.dialect.name != "sqlite":
        return []
    found = connection.exec_driver_sql("PRAGMA integrity_check").scalars()
    return [f"the file is damaged: {said}" for said in found if said != "ok"]
