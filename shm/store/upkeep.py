"""What keeps the store in order: copies and backups, rows that are missing, rows made whole again.

What can be computed anew is written over the damaged row, whose number others refer to; what the
next test makes anyway is thrown away.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.documents import value_of
from shm.errors import DamagedRow
from shm.store.archive import Archive
from shm.store.audit import note
from shm.store.blobs import change_in, posterior_from, test_from_document, unpack
from shm.store.checksums import (
    Values,
    checksum_of,
    content_checksum,
    damaged,
    healed,
    key_of,
    loads,
    plain_table,
)
from shm.store.columns import Document
from shm.store.copying import Rows, forget
from shm.store.database import insert
from shm.store.files import test_contents, write_event
from shm.store.list_rows import StoredRecording
from shm.store.missing import ACCEPTED, missing_rows
from shm.store.people import Tokens
from shm.store.queries import posterior_values
from shm.store.rows import IdentifiedTest, Lineage, StoredTest
from shm.store.tables import (
    APART,
    archive_copies,
    drifts,
    events,
    metadata,
    posterior_tests,
    posteriors,
    recordings,
    steps,
    summaries,
    tests,
    watch_states,
    watches,
)
from shm.values import Alert, Posterior

_REMOVED, _BACKUP = "removed", "backup"
_KIND = "damaged"


@dataclass(frozen=True)
class ArchiveCopy:
    """A recording whose file, and sidecar if it has one, were copied whole into a folder."""

    recording_id: int
    folder: str
    at: datetime


@dataclass(frozen=True)
class DamagedPosterior:
    """A posterior that must be made again: of which class, and of which tests, by their rows."""

    id: int
    model: str
    tests: tuple[int, ...]


class Upkeep(Tokens):
    """Copies of raw files, backups, and the healing of rows.

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
            write_event(connection, at, _REMOVED, recording.id, name, copy_folder)
            note(connection, at, "raw file removed", name, f"copied to {copy_folder}")

    def removed_to(self) -> dict[int, str]:
        """Recordings whose raw files were taken out of the archive: where their copies lie."""
        query = sa.select(events.c.recording_id, events.c.message).where(events.c.kind == _REMOVED)
        return {row[0]: row[1] for row in self.rows(query.order_by(events.c.id))}

    def removed_names(self, archive: Archive) -> frozenset[str]:
        """Raw files, by their path in the archive, that were taken out of it and are not back."""
        ids = self.removed_to()
        query = sa.select(recordings.c.id, recordings.c.archived_as, recordings.c.sidecar_as)
        rows = self.rows(query)
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
        row = self.first(query.order_by(events.c.id.desc()).limit(1))
        return None if row is None else (row.at, row.file_name)

    def newest_row_at(self) -> datetime | None:
        """When the newest stage was reached, by the clock of then; None in an empty store."""
        found: datetime | None = self.scalar(sa.select(sa.func.max(steps.c.at)))
        return found

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

    def note_damage(self, error: DamagedRow, at: datetime) -> bool:
        """Notes a damaged row that stopped a hanger; whether it was not noted before."""
        place = f"{error.table}/{error.id}"
        same = sa.select(events.c.id).where(events.c.kind == _KIND, events.c.file_name == place)
        with self.writing() as connection:
            if connection.execute(same).first() is not None:
                return False
            values = {"at": at, "kind": _KIND, "file_name": place, "message": str(error)}
            insert(connection, events, values)
        return True

    def known_damage(self) -> tuple[DamagedRow, ...]:
        """The rows that were noted and are damaged still; each is looked at once more."""
        query = sa.select(events.c.file_name).where(events.c.kind == _KIND).distinct()
        with self.reading() as connection:
            places = [place.partition("/") for place in connection.scalars(query)]
            return tuple(
                row
                for table, _, id_ in places
                if table in metadata.tables and id_.isdecimal()
                for row in damaged_rows(connection, metadata.tables[table], [int(id_)])
            )

    def damaged_tests(self, recording_id: int) -> tuple[int, ...]:
        """The rows of a recording's tests, former ones too, that are damaged."""
        of_recording = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
        with self.reading() as connection:
            ids = connection.scalars(of_recording).all()
            return tuple(damaged_ids(connection, tests, ids))

    def damaged_posteriors(self, recording_id: int) -> tuple[DamagedPosterior, ...]:
        """The posteriors made from tests of a recording, former ones too, that are damaged."""
        made = sa.select(posterior_tests.c.posterior_id).join(tests)
        made = made.where(tests.c.recording_id == recording_id).distinct()
        with self.reading() as connection:
            ids = connection.scalars(made).all()
            return tuple(
                DamagedPosterior(id_, *_origin(connection, id_))
                for id_ in damaged_ids(connection, posteriors, ids)
            )

    def heal_tests(
        self, ids: Sequence[int], found: Sequence[IdentifiedTest], lineage: Lineage
    ) -> None:
        """Writes what was identified anew over damaged rows, each by its place in its file."""
        at_position = {item.position: item for item in found}
        chosen = sa.select(tests.c.id, tests.c.position, tests.c.name).where(tests.c.id.in_(ids))
        with self.writing() as connection:
            for row in connection.execute(chosen).all():
                item = at_position.get(row.position)
                if item is not None:
                    values = {**test_contents(item, row.name), **lineage.columns}
                    overwrite(connection, tests, row.id, values)

    def heal_posterior(
        self,
        id_: int,
        posterior: Posterior,
        chosen: Sequence[StoredTest],
        lineage: Lineage,
        at: datetime,
    ) -> None:
        """Writes a posterior made anew over a damaged one; its summary is made anew too."""
        with self.writing() as connection:
            hanger = chosen[0].hanger
            values = posterior_values(hanger, posterior, chosen, lineage, at)
            overwrite(connection, posteriors, id_, values)
            stale = summaries.c.posterior_id == id_
            connection.execute(sa.delete(summaries).where(stale))

    def drop_damaged(self, recording_id: int | None = None) -> int:
        """Throws away damaged rows that are made again by themselves; how many there were.

        Those are summaries and what the watch keeps; of a recording that is done again also what
        the watch said of its tests.
        """
        own = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
        dropped = 0
        with self.writing() as connection:
            for table in (summaries, watch_states):
                dropped += drop_rows(connection, table, sa.select(next(iter(table.primary_key))))
            for table in (drifts, watches):
                of_recording = sa.select(table.c.id).where(table.c.test_id.in_(own))
                dropped += drop_rows(connection, table, of_recording)
        return dropped


def _is_there(target: Archive, recording: sa.Row[Any]) -> bool:
    names = (recording.archived_as, recording.sidecar_as)
    return all((target.folder / name).is_file() for name in names if name is not None)


def _origin(connection: Connection, posterior_id: int) -> tuple[str, tuple[int, ...]]:
    model = connection.scalar(sa.select(posteriors.c.model).where(posteriors.c.id == posterior_id))
    of_it = posterior_tests.c.posterior_id == posterior_id
    query = sa.select(tests.c.id).join(posterior_tests).where(of_it)
    return str(model), tuple(connection.scalars(query.order_by(tests.c.time, tests.c.id)))


def damaged_among(table: sa.Table, rows: Rows) -> Iterator[DamagedRow]:
    """Those of some rows, read without types, that are damaged."""
    for row in rows:
        if not (_as_written(table, row) and _can_be_decoded(table, row)):
            key = key_of(table, row)
            yield damaged(table, key[0] if len(key) == 1 else key, _hanger(row))


def _as_written(table: sa.Table, row: Values) -> bool:
    """A row without a checksum was written by something else than shm, or lost it."""
    apart = APART.get(table.name)
    if apart and content_checksum(row[apart]) != row[f"{apart}_checksum"]:
        return False
    return bool(row["checksum"] == checksum_of(table, row))


def _can_be_decoded(table: sa.Table, row: Values) -> bool:
    """Whether its documents and arrays can be read: of a row that was damaged before there were
    checksums that is all that can be told."""
    try:
        for column in table.columns:
            if isinstance(column.type, Document):
                loads(row[column.name])
        if table.name in _DECODERS:
            _DECODERS[table.name](row)
    except Exception:  # noqa: BLE001 - damaged bytes fail in any way
        return False
    return True


def _decode_test(row: Values) -> None:
    test_from_document(loads(row["document"]), row["hanger"])
    if row["frequency_response"] is not None:
        unpack(row["frequency_response"])


# What is made of the contents of a row. What the watch keeps is its own affair, and may be thrown
# away at will; diagnoses of former versions are of other forms.
_DECODERS: Mapping[str, Callable[[Values], object]] = {
    "tests": _decode_test,
    "posteriors": lambda row: posterior_from(loads(row["document"]), row["samples"]),
    "watches": lambda row: change_in(row["document"]),
    "alerts": lambda row: value_of(Alert, loads(row["document"])),
}


def _hanger(row: Values) -> int | None:
    hanger = row.get("hanger")
    return hanger if isinstance(hanger, int) else None


def damaged_rows(connection: Connection, table: sa.Table, ids: Iterable[int]) -> list[DamagedRow]:
    """Those of the rows with these numbers that are damaged."""
    plain, key = plain_table(table.name), next(iter(table.primary_key)).name
    found: list[DamagedRow] = []
    for id_ in ids:
        rows = connection.execute(sa.select(plain).where(plain.c[key] == id_)).mappings().all()
        found.extend(damaged_among(table, rows))
    return found


def damaged_ids(connection: Connection, table: sa.Table, ids: Iterable[int]) -> list[int]:
    """The numbers of those that are damaged."""
    return [id_ for id_ in ids if damaged_rows(connection, table, [id_])]


def drop_rows(connection: Connection, table: sa.Table, chosen: sa.Select[Any]) -> int:
    """Throws away the damaged ones of the rows whose numbers are `chosen`; how many they are."""
    key = next(iter(table.primary_key))
    ids = damaged_ids(connection, table, connection.scalars(chosen).all())
    if ids:
        connection.execute(sa.delete(table).where(key.in_(ids)))
        forget(connection, table.name)
    return len(ids)


def overwrite(connection: Connection, table: sa.Table, id_: int, values: Mapping[str, Any]) -> None:
    """Writes what was made anew over a damaged row, which is whole from then on."""
    connection.execute(sa.update(table).where(table.c.id == id_).values(**values))
    healed(connection, table, id_)
