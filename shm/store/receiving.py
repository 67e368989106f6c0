"""The verb that takes a file in: entered once, tried again, or done again with another sidecar."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.store.database import insert
from shm.store.files import (
    Files,
    begin_again,
    by_checksum,
    by_id,
    in_force,
    note_name,
    recording_from,
    write_event,
)
from shm.store.holding import standing_discard
from shm.store.rows import Outcome, Receipt, ReceivedFile, Stage
from shm.store.stepping import ARCHIVED, write_step
from shm.store.superseding import redescribe
from shm.store.tables import recordings, tests


class Receiving(Files):
    """The part of the store that takes files in."""

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
            return Receipt(outcome, recording_from(by_id(connection, row_id)))


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
    write_step(connection, row_id, ARCHIVED, at)
    write_step(connection, row_id, Stage.RECEIVED, at)
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
        _reopen(connection, known.id, file, at)
        message = "dropped again after its refusal; tried again."
    elif outcome is Outcome.DISCARDED:
        message = f"the same file as {known.file_name}, which was discarded and stays so."
    elif outcome is Outcome.REDESCRIBED:
        message = redescribe(connection, known, file, at)
    write_event(connection, at, outcome, known.id, file.file_name, message)


def _reopen(connection: Connection, recording_id: int, file: ReceivedFile, at: datetime) -> None:
    """A refused file starts anew; results it had before the refusal stay in force."""
    refused = (tests.c.recording_id == recording_id) & (tests.c.stage == Stage.REFUSED)
    connection.execute(sa.update(tests).where(refused, in_force(tests)).values(superseded_at=at))
    connection.execute(
        sa.update(recordings).where(recordings.c.id == recording_id).values(**vars(file))
    )
    begin_again(connection, recording_id, at)
