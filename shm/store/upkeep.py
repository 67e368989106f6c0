"""Copies of raw files, removals and backups."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import sqlalchemy as sa

from shm.store.archive import Archive
from shm.store.columns import value_in
from shm.store.database import Repository
from shm.store.journal import BACKUP, REMOVED, is_step, write
from shm.store.people import Tokens
from shm.store.rows import ArchiveCopy, StoredRecording
from shm.store.tables import archive_copies, journal, recordings


class Upkeep(Tokens):
    """Tokens, copies of raw files, backups.

    A raw file may be deleted here only once its recording has a copy.
    """

    def note_copies(self, target: Archive, at: datetime) -> int:
        """Notes the recordings whose files are in `target`; how many were not noted before."""
        folder = str(target.folder.resolve())
        noted = sa.select(archive_copies.c.recording_id).where(archive_copies.c.folder == folder)
        query = sa.select(recordings).where(recordings.c.id.not_in(noted))
        with self.writing() as connection:
            new = [
                {"recording_id": row.id, "folder": folder, "at": at}
                for row in connection.execute(query)
                if row.archived_as is not None and _is_there(target, row)
            ]
            if new:
                connection.execute(sa.insert(archive_copies), new)
        return len(new)

    def note_removed(self, recording: StoredRecording, copy_folder: str, at: datetime) -> None:
        """Notes that a raw file is no longer here, and where its copy lies."""
        name = recording.file.file_name
        with self.writing() as connection:
            write(connection, at, REMOVED, recording.id, None, name, copy_folder, who="")

    def note_backup(self, file: Path, at: datetime) -> None:
        """Notes that a backup of the store was written."""
        with self.writing() as connection:
            write(connection, at, BACKUP, subject=str(file))


def _is_there(target: Archive, recording: sa.Row[tuple[object, ...]]) -> bool:
    names = (recording.archived_as, recording.sidecar_as)
    return all((target.folder / name).is_file() for name in names if name is not None)


def list_copies(store: Repository) -> tuple[ArchiveCopy, ...]:
    """List all copies that were noted, as they were made."""
    query = sa.select(archive_copies).order_by(archive_copies.c.id)
    return tuple(value_in(row, ArchiveCopy) for row in store.rows(query))


def list_removed(store: Repository) -> dict[int, str]:
    """Return the folder with the copy of each recording taken out of the archive."""
    columns = journal.c.recording_id, journal.c.detail
    query = sa.select(*columns).where(journal.c.kind == REMOVED).order_by(journal.c.id)
    return {row[0]: row[1] for row in store.rows(query)}


def list_removed_names(store: Repository, archive: Archive) -> frozenset[str]:
    """List raw files, by their path in the archive, that were taken out and are not back."""
    ids = list_removed(store)
    query = sa.select(recordings.c.id, recordings.c.archived_as, recordings.c.sidecar_as)
    rows = store.rows(query)
    names = {name for row in rows if row[0] in ids for name in row[1:] if name is not None}
    return frozenset(name for name in names if not (archive.folder / name).exists())


def find_last_backup(store: Repository) -> tuple[datetime, str] | None:
    """Return time and place of the newest backup of the store; None without one."""
    query = sa.select(journal.c.at, journal.c.subject).where(journal.c.kind == BACKUP)
    row = store.first(query.order_by(journal.c.id.desc()).limit(1))
    return None if row is None else (row.at, row.subject)


def find_newest_step(store: Repository) -> datetime | None:
    """Return when the newest step was made, by the clock of then; None in an empty store."""
    found: datetime | None = store.scalar(sa.select(sa.func.max(journal.c.at)).where(is_step))
    return found
