"""Verbs on received files: refuse, look up."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import datetime
from itertools import takewhile
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.store.checksums import decoding, loads, readable
from shm.store.database import Database, insert
from shm.store.deaths import Death, Deaths
from shm.store.rows import (
    ENDED,
    Event,
    ReceivedFile,
    Stage,
    StoredRecording,
    counts_by_name,
)
from shm.store.stepping import write_step
from shm.store.tables import events, recordings, steps, tests

RENAMED = "renamed"
"""The kind of event that keeps the former name of a file that came again under another."""


def end_recording(
    connection: Connection, recording_id: int, reason: Mapping[str, Any], at: datetime
) -> None:
    """A recording is refused, with a reason."""
    own = sa.update(recordings).where(recordings.c.id == recording_id)
    connection.execute(own.values(stage=Stage.REFUSED, reason=dict(reason)))
    write_step(connection, recording_id, Stage.REFUSED, at)


def end_tests(
    connection: Connection, recording_id: int, test_ids: Collection[int], at: datetime
) -> None:
    """Tests of a recording are refused."""
    chosen = sa.update(tests).where(tests.c.id.in_(test_ids))
    connection.execute(chosen.values(stage=Stage.REFUSED))
    for test_id in test_ids:
        write_step(connection, recording_id, Stage.REFUSED, at, test_id)


class Files(Database):
    """The part of the store that keeps account of the files."""

    def refuse(
        self,
        recording_id: int,
        reason: Mapping[str, Any],
        at: datetime,
        test_ids: Collection[int] = (),
        *,
        stage: Stage | None = None,
    ) -> None:
        """Ends a recording with a reason; of its tests only those named, the others go on.

        With `stage` only where it, or those tests, still wait there: another process may have done
        the step that failed here, or refused it already.
        """
        with self.writing() as connection:
            row = by_id(connection, recording_id)
            if stage is not None and not _waits(connection, row, stage, test_ids):
                return
            test_ids = _own(connection, recording_id, test_ids)
            end_recording(connection, recording_id, reason, at)
            end_tests(connection, recording_id, test_ids, at)
            message = str(reason.get("message", ""))
            write_event(connection, at, "refused", row.id, row.file_name, message)

    def refused_unread(self, file_name: str, message: str, at: datetime) -> None:
        """Notes that a file was refused for its size, of which nothing else is known."""
        with self.writing() as connection:
            write_event(connection, at, "refused", None, file_name, message)

    def waits(self, recording_id: int, stage: Stage, test_ids: Collection[int] = ()) -> bool:
        """Whether a recording, or its tests where some are named, are still at a stage."""
        with self.reading() as connection:
            return _waits(connection, by_id(connection, recording_id), stage, test_ids)

    def recording(self, recording_id: int) -> StoredRecording:
        """Raises NothingThere."""
        with self.reading() as connection:
            return recording_from(by_id(connection, recording_id))

    def recording_of(self, sha256: str) -> StoredRecording | None:
        """The recording with these bytes, if it was received."""
        with self.reading() as connection:
            row = by_checksum(connection, sha256)
        return None if row is None else recording_from(row)

    def recordings(self, stage: Stage | None = None) -> tuple[StoredRecording, ...]:
        """All recordings, or those at one stage, as they came in."""
        query = sa.select(recordings).order_by(recordings.c.id)
        if stage is not None:
            query = query.where(recordings.c.stage == stage)
        return self._recordings(query)

    def waiting_recordings(
        self, limit: int, excluding: Collection[int] = ()
    ) -> tuple[StoredRecording, ...]:
        """The first recordings that are received and not yet identified."""
        waiting = recordings.c.stage == Stage.RECEIVED
        query = sa.select(recordings).where(waiting, recordings.c.id.not_in(excluding))
        return self._recordings(query.order_by(recordings.c.id).limit(limit))

    def stage_counts(self) -> dict[str, int]:
        """How many recordings stand at each stage; see `counts_by_name`."""
        query = sa.select(recordings.c.stage, sa.func.count()).group_by(recordings.c.stage)
        with self.reading() as connection:
            return counts_by_name(Stage, connection.execute(query))

    def died(self, recording_id: int, death: Death, message: str, at: datetime) -> None:
        """Notes that a process that worked on a recording died."""
        with self.writing() as connection:
            row = by_id(connection, recording_id)
            write_event(connection, at, death, row.id, row.file_name, message)

    def deaths(self) -> dict[int, Deaths]:
        """What is noted of the recordings that are on their way, since each last moved on."""
        moved_at = (
            sa.select(steps.c.recording_id, sa.func.max(steps.c.at).label("at"))
            .group_by(steps.c.recording_id)
            .subquery()
        )
        noted = (
            sa.select(events.c.id, events.c.kind, events.c.at, events.c.recording_id)
            .join(recordings, recordings.c.id == events.c.recording_id)
            .join(moved_at, moved_at.c.recording_id == events.c.recording_id)
            .where(events.c.kind.in_(list(Death)), events.c.at >= moved_at.c.at)
            .where(recordings.c.stage.not_in(ENDED))
            .order_by(events.c.id)
        )
        not_of_it = events.c.kind.in_((Death.FROM_OUTSIDE, Death.BESIDE_OTHERS))
        killed = sa.select(events.c.recording_id, events.c.id, events.c.kind).where(not_of_it)
        killed = killed.order_by(events.c.id.desc())
        found: dict[int, Deaths] = {}
        with self.reading() as connection:
            latest = connection.execute(killed.limit(100)).all()
            own = takewhile(lambda row: row.recording_id == latest[0].recording_id, latest)
            in_a_row = {row.id for row in own if row.kind == Death.FROM_OUTSIDE}
            for row in connection.execute(noted):
                before = found.get(row.recording_id, Deaths(0, 0, row.at))
                found[row.recording_id] = Deaths(
                    before.by_itself + (row.kind == Death.BY_ITSELF),
                    before.from_outside + (row.id in in_a_row),
                    row.at,
                )
        return found

    def events(
        self,
        kind: str | None = None,
        *,
        recording_id: int | None = None,
        file_name: str | None = None,
    ) -> tuple[Event, ...]:
        """What was noticed on the way, oldest first; `kind` as duplicate or refused.

        Of one recording, or of what came under one name, where that is given.
        """
        query = sa.select(events).order_by(events.c.id)
        wanted = {"kind": kind, "recording_id": recording_id, "file_name": file_name}
        for name, value in wanted.items():
            if value is not None:
                query = query.where(events.c[name] == value)
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(Event(r.at, r.kind, r.file_name, r.message, r.recording_id) for r in rows)

    def _recordings(self, query: sa.Select[Any]) -> tuple[StoredRecording, ...]:
        with self.reading() as connection:
            return tuple(readable(connection.execute(query), recording_from))


def by_checksum(connection: Connection, sha256: str) -> Row[Any] | None:
    query = sa.select(recordings).where(recordings.c.sha256 == sha256)
    return connection.execute(query).one_or_none()


def by_id(connection: Connection, recording_id: int) -> Row[Any]:
    query = sa.select(recordings).where(recordings.c.id == recording_id)
    row = connection.execute(query).one_or_none()
    if row is None:
        raise NothingThere(f"no recording {recording_id}.", remedy="See `shm status`.")
    return row


def _waits(
    connection: Connection, recording: Row[Any], stage: Stage, test_ids: Collection[int]
) -> bool:
    if not test_ids:
        return bool(recording.stage == stage)
    own = _own(connection, recording.id, test_ids)
    waiting = sa.select(tests.c.id).where(in_force(tests), tests.c.stage == stage)
    return len(connection.scalars(waiting.where(tests.c.id.in_(own))).all()) == len(own)


def _own(connection: Connection, recording_id: int, test_ids: Collection[int]) -> Collection[int]:
    """Those of the tests that are of one recording."""
    own = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
    return connection.scalars(own.where(tests.c.id.in_(test_ids)).order_by(tests.c.id)).all()


def recording_from(row: Row[Any]) -> StoredRecording:
    with decoding(recordings, row, row.hanger):
        file = ReceivedFile(
            row.sha256,
            row.file_name,
            row.size_bytes,
            row.arrival,
            row.archived_as,
            row.sidecar_as,
            row.modified_at,
        )
        stage, reason = Stage(row.stage), loads(row.reason)
        return StoredRecording(row.id, file, row.received_at, stage, row.hanger, reason)


def begin_again(connection: Connection, recording_id: int, at: datetime) -> None:
    """A recording waits to be identified as if it had just come in."""
    own = sa.update(recordings).where(recordings.c.id == recording_id)
    connection.execute(own.values(stage=Stage.RECEIVED, reason=None))
    write_step(connection, recording_id, Stage.RECEIVED, at)


def counts(table: sa.Table) -> sa.ColumnElement[bool]:
    """What is neither refused nor held: all that is shown and computed with."""
    return table.c.stage.not_in([Stage.REFUSED, Stage.HELD])


def in_force(table: sa.Table) -> sa.ColumnElement[bool]:
    """What no later run has replaced."""
    return table.c.superseded_at.is_(None)


def note_name(connection: Connection, known: Row[Any], file_name: str, at: datetime) -> None:
    """Keeps the former name of a file that comes again under another: it is found by both."""
    if known.file_name != file_name:
        said = f"called {file_name} from now on."
        write_event(connection, at, RENAMED, known.id, known.file_name, said)


def write_event(
    connection: Connection,
    at: datetime,
    kind: str,
    recording_id: int | None,
    file_name: str,
    message: str,
) -> None:
    about = {"recording_id": recording_id, "file_name": file_name}
    insert(connection, events, {"at": at, "kind": kind, "message": message, **about})
