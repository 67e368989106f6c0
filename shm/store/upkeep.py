"""Keep the store in order: tokens, copies of raw files, backups."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import sqlalchemy as sa

from shm.store.archive import Archive
from shm.store.journal import BACKUP, REMOVED, is_step, write
from shm.store.list_rows import StoredRecording
from shm.store.people import Tokens
from shm.store.tables import archive_copies, journal, recordings


@dataclass(frozen=True)
class ArchiveCopy:
    """A recording whose file, and sidecar if it has one, were copied whole into a folder."""

    recording_id: int
    folder: str
    at: datetime


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

    def list_copies(self) -> tuple[ArchiveCopy, ...]:
        """All copies that were noted, as they were made."""
        query = sa.select(archive_copies).order_by(archive_copies.c.id)
        return tuple(ArchiveCopy(row.recording_id, row.folder, row.at) for row in self.rows(query))

    def note_removed(self, recording: StoredRecording, copy_folder: str, at: datetime) -> None:
        """Notes that a raw file is no longer here, and where its copy lies."""
        name = recording.file.file_name
        with self.writing() as connection:
            write(connection, at, REMOVED, recording.id, None, name, copy_folder, who="")

    def removed_to(self) -> dict[int, str]:
        """Recordings whose raw files were taken out of the archive: where their copies lie."""
        own = journal.c.recording_id, journal.c.detail
        query = sa.select(*own).where(journal.c.kind == REMOVED).order_by(journal.c.id)
        return {row[0]: row[1] for row in self.rows(query)}

    def removed_names(self, archive: Archive) -> frozenset[str]:
        """Raw files, by their path in the archive, that were taken out of it and are not back."""
        ids = self.removed_to()
        query = sa.select(recordings.c.id, recordings.c.archived_as, recordings.c.sidecar_as)
        rows = self.rows(query)
        names = {name for row in rows if row[0] in ids for name in row[1:] if name is not None}
        return frozenset(name for name in names if not (archive.folder / name).exists())

    def note_backup(self, file: Path, at: datetime) -> None:
        """Notes that a backup of the store was written."""
        with self.writing() as connection:
            write(connection, at, BACKUP, subject=str(file))

    def last_backup(self) -> tuple[datetime, str] | None:
        """When and where the newest backup of the store was written; None where none was."""
        query = sa.select(journal.c.at, journal.c.subject).where(journal.c.kind == BACKUP)
        row = self.first(query.order_by(journal.c.id.desc()).limit(1))
        return None if row is None else (row.at, row.subject)

    def newest_row_at(self) -> datetime | None:
        """When the newest stage was reached, by the clock of then; None in an empty store."""
        found: datetime | None = self.scalar(sa.select(sa.func.max(journal.c.at)).where(is_step))
        return found


def _is_there(target: Archive, recording: sa.Row[tuple[object, ...]]) -> bool:
    names = (recording.archived_as, recording.sidecar_as)
    return all((target.folder / name).is_file() for name in names if name is not None)
