"""Read copies, removals and backups."""

from __future__ import annotations

from datetime import datetime

import sqlalchemy as sa

from shm.store.archive import Archive
from shm.store.database import Repository
from shm.store.journal import BACKUP, REMOVED, is_step
from shm.store.mapping import value_in
from shm.store.rows import ArchiveCopy
from shm.store.tables import archive_copies, journal, recordings


def list_copies(store: Repository) -> tuple[ArchiveCopy, ...]:
    """List all copies that were noted, as they were made."""
    query = sa.select(archive_copies).order_by(archive_copies.c.id)
    return tuple(value_in(row, ArchiveCopy) for row in store.rows(query))


def list_removed(store: Repository) -> dict[int, str]:
    """Return the folder with the copy of each recording taken out of the archive."""
    own = journal.c.recording_id, journal.c.detail
    query = sa.select(*own).where(journal.c.kind == REMOVED).order_by(journal.c.id)
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
