"""What keeps the store in order: who may come in, copies and backups, damaged and missing rows."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import DamagedRow, NothingThere, UsageError
from shm.store.archive import Archive
from shm.store.audit import note
from shm.store.damage import damaged_ids, damaged_rows, drop_rows, overwrite
from shm.store.database import Repository, insert
from shm.store.files import posterior_values, test_contents, write_event
from shm.store.list_rows import StoredRecording
from shm.store.missing import ACCEPTED, missing_rows
from shm.store.rows import IdentifiedTest, Lineage, StoredTest
from shm.store.tables import (
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
    tokens,
    watch_states,
    watches,
)
from shm.values import Posterior

_SECRET_BYTES = 32  # 256 bits: nobody guesses it
_LONGEST_NAME = 255  # technical: what a column and a line of a table take
_NOTED_AGAIN_AFTER = timedelta(minutes=1)
_REMOVED, _BACKUP = "removed", "backup"
_KIND = "damaged"


class Scope(StrEnum):
    """What a token allows; one that may write may read."""

    READ = "read"
    WRITE = "write"


@dataclass(frozen=True)
class StoredToken:
    """A token without its secret."""

    id: int
    name: str
    scopes: frozenset[Scope]
    created_at: datetime
    revoked_at: datetime | None = None
    last_used_at: datetime | None = None


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


class Upkeep(Repository):
    """Tokens, copies of raw files, backups, and the healing of rows.

    A raw file may be deleted here only once its recording has a copy.
    """

    def create_token(self, name: str, scope: Scope, at: datetime) -> str:
        """Makes a token and returns its secret, which is told this once and kept nowhere.

        Raises UsageError where a token of that name is in force, or where the name is none.
        """
        if not name.strip() or len(name) > _LONGEST_NAME or not name.isprintable():
            raise UsageError(
                "the name of a token is a short text.", remedy="Name it after who uses it."
            )
        secret = f"shm_{secrets.token_urlsafe(_SECRET_BYTES)}"
        scopes = (Scope.READ,) if scope is Scope.READ else (Scope.READ, Scope.WRITE)
        with self.writing() as connection:
            if connection.execute(_in_force.where(tokens.c.name == name)).first() is not None:
                raise UsageError(
                    f"a token named {name} is in force already.",
                    remedy=f"Take another name, or revoke it: `shm token revoke {name}`.",
                )
            values = {"name": name, "token_sha256": _hashed(secret), "created_at": at}
            insert(connection, tokens, {**values, "scopes": ",".join(scopes)})
            note(connection, at, "token made", f"token {name}", f"may {scope}")
        return secret

    def list_tokens(self) -> tuple[StoredToken, ...]:
        """All tokens, those revoked too, as they were made."""
        with self.reading() as connection:
            rows = connection.execute(sa.select(tokens).order_by(tokens.c.id)).all()
        return tuple(_token(row) for row in rows)

    def revoke_token(self, name: str, at: datetime) -> None:
        """Ends a token from now on; raises NothingThere where none of that name is in force."""
        with self.writing() as connection:
            ended = connection.execute(
                sa.update(tokens)
                .where(tokens.c.name == name, tokens.c.revoked_at.is_(None))
                .values(revoked_at=at)
            )
            if ended.rowcount == 0:
                raise NothingThere(
                    f"no token named {name} is in force.", remedy="See `shm token list`."
                )
            note(connection, at, "token revoked", f"token {name}")

    def token_of(self, secret: str, at: datetime) -> StoredToken | None:
        """The token in force with this secret, and a note that it was used; None where none has.

        Every token is compared, in constant time, so that the time taken tells nothing.
        """
        with self.reading() as connection:
            rows = connection.execute(_in_force).all()
        found = _matching(rows, _hashed(secret))
        if found is None:
            return None
        if found.last_used_at is None or at - found.last_used_at >= _NOTED_AGAIN_AFTER:
            with self.writing() as connection:
                noted = sa.update(tokens).where(tokens.c.id == found.id)
                connection.execute(noted.values(last_used_at=at))
        return _token(found)

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
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(ArchiveCopy(row.recording_id, row.folder, row.at) for row in rows)

    def note_removed(self, recording: StoredRecording, copy_folder: str, at: datetime) -> None:
        """Notes that a raw file is no longer here, and where its copy lies."""
        name = recording.file.file_name
        with self.writing() as connection:
            write_event(connection, at, _REMOVED, recording.id, name, copy_folder)
            note(connection, at, "raw file removed", name, f"copied to {copy_folder}")

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

    def newest_row_at(self) -> datetime | None:
        """When the newest stage was reached, by the clock of then; None in an empty store."""
        with self.reading() as connection:
            found: datetime | None = connection.scalar(sa.select(sa.func.max(steps.c.at)))
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


_in_force = sa.select(tokens).where(tokens.c.revoked_at.is_(None))


def _hashed(secret: str) -> str:
    """A secret is 256 random bits: a plain checksum of it cannot be searched for."""
    return hashlib.sha256(secret.encode()).hexdigest()


def _matching(rows: Collection[Row[Any]], hashed: str) -> Row[Any] | None:
    found = None
    for row in rows:
        if hmac.compare_digest(row.token_sha256, hashed):
            found = row
    return found


def _token(row: Row[Any]) -> StoredToken:
    scopes = frozenset(Scope(scope) for scope in row.scopes.split(","))
    return StoredToken(row.id, row.name, scopes, row.created_at, row.revoked_at, row.last_used_at)


def _is_there(target: Archive, recording: sa.Row[Any]) -> bool:
    names = (recording.archived_as, recording.sidecar_as)
    return all((target.folder / name).is_file() for name in names if name is not None)


def _origin(connection: Connection, posterior_id: int) -> tuple[str, tuple[int, ...]]:
    model = connection.scalar(sa.select(posteriors.c.model).where(posteriors.c.id == posterior_id))
    of_it = posterior_tests.c.posterior_id == posterior_id
    query = sa.select(tests.c.id).join(posterior_tests).where(of_it)
    return str(model), tuple(connection.scalars(query.order_by(tests.c.time, tests.c.id)))
