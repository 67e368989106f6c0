"""Which archived files have a second copy elsewhere, and the making of such copies."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from shm.store.archive import Archive
from shm.store.checking import file_troubles
from shm.store.copying import Tell
from shm.store.database import Database
from shm.store.tables import archive_copies, recordings


@dataclass(frozen=True)
class ArchiveCopy:
    """A recording whose file, and sidecar if it has one, were copied whole into a folder."""

    recording_id: int
    folder: str
    at: datetime


@dataclass(frozen=True)
class CopiedArchive:
    """What came of copying an archive: files copied now and before, and what could not be."""

    copied: int
    present: int
    missing: tuple[str, ...]
    damaged: tuple[str, ...]

    @property
    def troubles(self) -> tuple[str, ...]:
        return file_troubles(self.missing, self.damaged)


class ArchiveCopies(Database):
    """The part of the store that knows of copies of the archive.

    A raw file may be deleted here only once its recording has such a copy.
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

    def archive_copies(self) -> tuple[ArchiveCopy, ...]:
        """All copies that were noted, as they were made."""
        query = sa.select(archive_copies).order_by(archive_copies.c.id)
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(ArchiveCopy(row.recording_id, row.folder, row.at) for row in rows)


def copy_archive(
    source: Archive, target: Archive, names: Collection[str], tell: Tell
) -> CopiedArchive:
    """Copies files of one archive, by their path in it, into another; what is there stays.

    Raises ShmError with `retry_after_s` where the disk is full.
    """
    target.folder.mkdir(parents=True, exist_ok=True)
    copied, present = 0, 0
    missing, damaged = [], []
    for number, name in enumerate(names, start=1):
        if _has(target, source, name):
            present += 1
        elif not (source.folder / name).is_file():
            missing.append(name)
        elif target.keep(source.folder / name, follow=True).archived_as == name:
            copied += 1
        else:  # it went to where its content belongs, which is not where its name says
            damaged.append(name)
        tell("archive", number / len(names))
    return CopiedArchive(copied, present, tuple(missing), tuple(damaged))


def _has(target: Archive, source: Archive, name: str) -> bool:
    """Files appear in an archive whole or not at all, so one of the right size is the right one."""
    path, original = target.folder / name, source.folder / name
    if not path.is_file():
        return False
    return not original.is_file() or original.stat().st_size == path.stat().st_size


def _is_there(target: Archive, recording: sa.Row[Any]) -> bool:
    names = (recording.archived_as, recording.sidecar_as)
    return all((target.folder / name).is_file() for name in names if name is not None)
