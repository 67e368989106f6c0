"""Verbs on received files: take in, refuse, look up."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.store.database import Database, insert
from shm.store.rows import Event, Outcome, Receipt, ReceivedFile, Stage, StoredRecording
from shm.store.stepping import ARCHIVED, write_step
from shm.store.tables import events, recordings, tests


class Files(Database):
    """The part of the store that keeps account of the files."""

    def receive(self, file: ReceivedFile, at: datetime) -> Receipt:
        """Enters a file that is safe in the archive. The same bytes are never entered twice."""
        with self.writing() as connection:
            known = _by_checksum(connection, file.sha256)
            outcome = _outcome(known, file)
            if known is None:
                row_id = _enter(connection, file, at)
            else:
                row_id = known.id
                _notice(connection, known, file, outcome, at)
            return Receipt(outcome, recording_from(_by_id(connection, row_id)))

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
            row = _by_id(connection, recording_id)
            if stage is not None and not _waits(connection, row, stage, test_ids):
                return
            test_ids = _own(connection, recording_id, test_ids)
            connection.execute(
                sa.update(recordings)
                .where(recordings.c.id == recording_id)
                .values(stage=Stage.REFUSED, reason=dict(reason))
            )
            connection.execute(
                sa.update(tests).where(tests.c.id.in_(test_ids)).values(stage=Stage.REFUSED)
            )
            for test_id in (None, *test_ids):
                write_step(connection, recording_id, Stage.REFUSED, at, test_id)
            message = str(reason.get("message", ""))
            write_event(connection, at, "refused", row.id, row.file_name, message)

    def waits(self, recording_id: int, stage: Stage, test_ids: Collection[int] = ()) -> bool:
        """Whether a recording, or its tests where some are named, are still at a stage."""
        with self.reading() as connection:
            return _waits(connection, _by_id(connection, recording_id), stage, test_ids)

    def recording(self, recording_id: int) -> StoredRecording:
        """Raises NothingThere."""
        with self.reading() as connection:
            return recording_from(_by_id(connection, recording_id))

    def recording_of(self, sha256: str) -> StoredRecording | None:
        """The recording with these bytes, if it was received."""
        with self.reading() as connection:
            row = _by_checksum(connection, sha256)
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

    def stage_counts(self) -> dict[Stage, int]:
        """How many recordings stand at each stage; every stage is named."""
        query = sa.select(recordings.c.stage, sa.func.count()).group_by(recordings.c.stage)
        with self.reading() as connection:
            counted = {Stage(row[0]): int(row[1]) for row in connection.execute(query)}
        return {stage: counted.get(stage, 0) for stage in Stage}

    def events(self, kind: str | None = None) -> tuple[Event, ...]:
        """What was noticed on the way, oldest first; `kind` as duplicate or refused."""
        query = sa.select(events).order_by(events.c.id)
        if kind is not None:
            query = query.where(events.c.kind == kind)
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(Event(r.at, r.kind, r.file_name, r.message, r.recording_id) for r in rows)

    def _recordings(self, query: sa.Select[Any]) -> tuple[StoredRecording, ...]:
        with self.reading() as connection:
            return tuple(recording_from(row) for row in connection.execute(query))


def _by_checksum(connection: Connection, sha256: str) -> Row[Any] | None:
    query = sa.select(recordings).where(recordings.c.sha256 == sha256)
    return connection.execute(query).one_or_none()


def _by_id(connection: Connection, recording_id: int) -> Row[Any]:
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
    file = ReceivedFile(
        row.sha256, row.file_name, row.size_bytes, row.arrival, row.archived_as, row.sidecar_as
    )
    return StoredRecording(row.id, file, row.received_at, Stage(row.stage), row.hanger, row.reason)


def _outcome(known: Row[Any] | None, file: ReceivedFile) -> Outcome:
    if known is None:
        return Outcome.NEW
    if known.arrival == file.arrival:
        return Outcome.RESUMED
    return Outcome.REOPENED if known.stage == Stage.REFUSED else Outcome.DUPLICATE


def _enter(connection: Connection, file: ReceivedFile, at: datetime) -> int:
    values = {**vars(file), "received_at": at, "stage": Stage.RECEIVED}
    row_id = insert(connection, recordings, values)
    write_step(connection, row_id, ARCHIVED, at)
    write_step(connection, row_id, Stage.RECEIVED, at)
    return row_id


def _notice(
    connection: Connection, known: Row[Any], file: ReceivedFile, outcome: Outcome, at: datetime
) -> None:
    if outcome is Outcome.RESUMED:
        return
    message = "dropped again after its refusal; tried again."
    if outcome is Outcome.REOPENED:
        _reopen(connection, known.id, file, at)
    else:
        message = f"the same file as {known.file_name}; not stored twice."
        if file.sidecar_as not in (None, known.sidecar_as):
            message += " Its sidecar differs: the first one holds."
    write_event(connection, at, outcome, known.id, file.file_name, message)


def _reopen(connection: Connection, recording_id: int, file: ReceivedFile, at: datetime) -> None:
    """A refused file starts anew; results it had before the refusal stay in force."""
    refused = (tests.c.recording_id == recording_id) & (tests.c.stage == Stage.REFUSED)
    connection.execute(sa.update(tests).where(refused, in_force(tests)).values(superseded_at=at))
    connection.execute(
        sa.update(recordings).where(recordings.c.id == recording_id).values(**vars(file))
    )
    begin_again(connection, recording_id, at)


def begin_again(connection: Connection, recording_id: int, at: datetime) -> None:
    """A recording waits to be identified as if it had just come in."""
    by_id = sa.update(recordings).where(recordings.c.id == recording_id)
    connection.execute(by_id.values(stage=Stage.RECEIVED, reason=None))
    write_step(connection, recording_id, Stage.RECEIVED, at)


def in_force(table: sa.Table) -> sa.ColumnElement[bool]:
    """What no later run has replaced."""
    return table.c.superseded_at.is_(None)


def write_event(
    connection: Connection,
    at: datetime,
    kind: str,
    recording_id: int,
    file_name: str,
    message: str,
) -> None:
    about = {"recording_id": recording_id, "file_name": file_name}
    insert(connection, events, {"at": at, "kind": kind, "message": message, **about})
