"""Recordings: received, refused, looked up, named, timed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.store.database import insert
from shm.store.disposition import Dispositions
from shm.store.files import (
    by_checksum,
    by_id,
    end_recording,
    end_tests,
    is_current,
    note_name,
)
from shm.store.holding import standing_discard
from shm.store.journal import ARCHIVED, DIED, REFUSED, write
from shm.store.mapping import value_in
from shm.store.rerun import redescribe, reopen
from shm.store.rows import Outcome, Receipt, ReceivedFile, Stage, StoredRecording
from shm.store.tables import recordings, tests


class Recordings(Dispositions):
    """Received files: how far each has come, and what people decided of it."""

    def receive(self, file: ReceivedFile, at: datetime) -> Receipt:
        """Enters a file that is safe in the archive. The same bytes are never entered twice.

        With another sidecar than before they are done again with that.
        """
        with self.writing() as connection:
            known = by_checksum(connection, file.sha256)
            outcome = _outcome(connection, known, file)
            if known is None:
                row_id = _enter(connection, file, at)
            else:
                row_id = known.id
                _notice(connection, known, file, outcome, at)
            return Receipt(outcome, value_in(by_id(connection, row_id), StoredRecording))

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
            if stage is not None and not waits_at(connection, row, stage, test_ids):
                return
            test_ids = _own(connection, recording_id, test_ids)
            end_recording(connection, recording_id, reason, at, row.file_name)
            end_tests(connection, recording_id, test_ids, at)

    def refuse_unread(self, file_name: str, message: str, at: datetime) -> None:
        """Notes that a file was refused for its size, of which nothing else is known."""
        with self.writing() as connection:
            write(connection, at, REFUSED, subject=file_name, detail=message)

    def get(self, recording_id: int) -> StoredRecording:
        """One recording by its number; raises NothingThere."""
        with self.reading() as connection:
            return value_in(by_id(connection, recording_id), StoredRecording)

    def note_death(self, recording_id: int, message: str, at: datetime) -> None:
        """Note that a process that worked on a recording died."""
        with self.writing() as connection:
            row = by_id(connection, recording_id)
            write(connection, at, DIED, row.id, subject=row.file_name, detail=message)


def _outcome(connection: Connection, known: Row[Any] | None, file: ReceivedFile) -> Outcome:
    if known is None:
        return Outcome.NEW
    if known.arrival == file.arrival:
        return Outcome.RESUMED
    is_described = file.sidecar_as not in (None, known.sidecar_as)
    if known.stage == Stage.REFUSED:
        is_out = standing_discard(connection, known) is not None
        return Outcome.DISCARDED if is_out and not is_described else Outcome.REOPENED
    return Outcome.REDESCRIBED if is_described else Outcome.DUPLICATE


def _enter(connection: Connection, file: ReceivedFile, at: datetime) -> int:
    values = {**vars(file), "received_at": at, "stage": Stage.RECEIVED}
    row_id = insert(connection, recordings, values)
    write(connection, at, ARCHIVED, row_id)
    write(connection, at, Stage.RECEIVED, row_id, subject=file.file_name, who="")
    return row_id


def _notice(
    connection: Connection, known: Row[Any], file: ReceivedFile, outcome: Outcome, at: datetime
) -> None:
    if outcome is Outcome.RESUMED:
        return
    if outcome in (Outcome.REOPENED, Outcome.REDESCRIBED):
        note_name(connection, known, file.file_name, at)
    message = f"the same file as {known.file_name}; not stored twice."
    if outcome is Outcome.REOPENED:
        reopen(connection, known.id, file, at)
        message = "dropped again after its refusal; tried again."
    elif outcome is Outcome.DISCARDED:
        message = f"the same file as {known.file_name}, which was discarded and stays so."
    elif outcome is Outcome.REDESCRIBED:
        message = redescribe(connection, known, file, at)
    write(connection, at, outcome, known.id, subject=file.file_name, detail=message, who="")


def waits_at(
    connection: Connection, recording: Row[Any], stage: Stage, test_ids: Collection[int]
) -> bool:
    if not test_ids:
        return bool(recording.stage == stage)
    own = _own(connection, recording.id, test_ids)
    waiting = sa.select(tests.c.id).where(is_current(tests), tests.c.stage == stage)
    return len(connection.scalars(waiting.where(tests.c.id.in_(own))).all()) == len(own)


def _own(connection: Connection, recording_id: int, test_ids: Collection[int]) -> Collection[int]:
    """Return those of the tests that are of one recording."""
    own = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
    return connection.scalars(own.where(tests.c.id.in_(test_ids)).order_by(tests.c.id)).all()
