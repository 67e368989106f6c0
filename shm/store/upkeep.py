"""Keep the store in order: tokens, copies of raw files, backups."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import sqlalchemy as sa

from shm.store.archive import Archive
from shm.store.journal import BACKUP, REMOVED, write
from shm.store.people import Tokens
from shm.store.rows import StoredRecording
from shm.store.tables import archive_copies, recordings


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
