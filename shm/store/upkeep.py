"""What was done to keep the store in order: backups, and raw files taken out of the archive."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import sqlalchemy as sa

from shm.store.archive import Archive
from shm.store.database import Database, insert
from shm.store.files import write_event
from shm.store.missing import ACCEPTED, missing_rows
from shm.store.rows import StoredRecording
from shm.store.tables import events, recordings

_REMOVED, _BACKUP = "removed", "backup"


class Upkeep(Database):
    """The part of the store that remembers what was done to keep it in order."""

    def accept_missing(self, who: str, why: str, at: datetime) -> int:
        """Notes that a person knows what only a backup has to be gone for good: it is missed no
        more. How many rows that is.
        """
        with self.writing() as connection:
            gone = [
                row.key
                for row in missing_rows(connection)
                if row.only_in_backup
                for _ in range(row.count)
            ]
            for key in gone:
                write_event(connection, at, ACCEPTED, None, key, f"by {who}: {why}")
        return len(gone)

    def note_removed(self, recording: StoredRecording, copy_folder: str, at: datetime) -> None:
        """Notes that a raw file is no longer here, and where its copy lies."""
        name = recording.file.file_name
        with self.writing() as connection:
            write_event(connection, at, _REMOVED, recording.id, name, copy_folder)

    def removed_to(self) -> dict[int, str]:
        """Recordings whose raw files were taken out of the archive: where their copies lie."""
        query = sa.select(events.c.recording_id, events.c.message).where(events.c.kind == _REMOVED)
        with self.reading() as connection:
            return {row[0]: row[1] for row in connection.execute(query.order_by(events.c.id))}

    def removed_names(self, archive: Archive) -> frozenset[str]:
        """Raw files, by their path in the archive, that were taken out of it and are not back."""
        ids = self.removed_to()
        query = sa.select(recordings.c.id, recordings.c.archived_as, recordings.c.sidecar_as)
        with self.reading() as connection:
            rows = connection.execute(query).all()
        names = {name for row in rows if row[0] in ids for name in row[1:] if name is not None}
        return frozenset(name for name in names if not (archive.folder / name).exists())

    def note_backup(self, file: Path, at: datetime) -> None:
        """Notes that a backup of the store was written."""
        values = {"at": at, "kind": _BACKUP, "file_name": str(file), "message": ""}
        with self.writing() as connection:
            insert(connection, events, values)

    def last_backup(self) -> tuple[datetime, str] | None:
        """When and where the newest backup of the store was written; None where none was."""
        query = sa.select(events.c.at, events.c.file_name).where(events.c.kind == _BACKUP)
        with self.reading() as connection:
            row = connection.execute(query.order_by(events.c.id.desc()).limit(1)).first()
        return None if row is None else (row.at, row.file_name)
