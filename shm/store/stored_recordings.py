"""Recordings: received, refused, looked up, named, timed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere, UsageError
from shm.store.database import insert
from shm.store.disposition import Dispositions
from shm.store.files import (
    by_checksum,
    by_former_names,
    by_id,
    end_recording,
    end_tests,
    in_force,
    note_name,
    recording_from,
)
from shm.store.holding import standing_discard
from shm.store.journal import ARCHIVED, DIED, REFUSED, is_step, write
from shm.store.list_rows import (
    ON_THE_WAY,
    Deaths,
    Outcome,
    Receipt,
    ReceivedFile,
    Standing,
    StoredRecording,
)
from shm.store.rerun import redescribe, reopen
from shm.store.rows import ENDED, Stage, counts_by_name
from shm.store.tables import journal, recordings, tests


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
            return Receipt(outcome, recording_from(by_id(connection, row_id)))

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
            end_recording(connection, recording_id, reason, at, row.file_name)
            end_tests(connection, recording_id, test_ids, at)

    def refuse_unread(self, file_name: str, message: str, at: datetime) -> None:
        """Notes that a file was refused for its size, of which nothing else is known."""
        with self.writing() as connection:
            write(connection, at, REFUSED, subject=file_name, detail=message)

    def is_waiting(self, recording_id: int, stage: Stage, test_ids: Collection[int] = ()) -> bool:
        """Whether a recording, or its tests where some are named, are still at a stage."""
        with self.reading() as connection:
            return _waits(connection, by_id(connection, recording_id), stage, test_ids)

    def get(self, recording_id: int) -> StoredRecording:
        """One recording by its number; raises NothingThere."""
        with self.reading() as connection:
            return recording_from(by_id(connection, recording_id))

    def with_checksum(self, sha256: str) -> StoredRecording | None:
        """The recording with these bytes, if it was received."""
        with self.reading() as connection:
            row = by_checksum(connection, sha256)
        return None if row is None else recording_from(row)

    def find(self, which: str) -> tuple[int, str | None]:
        """The recording that is meant: by its number, by the name of a test of it, or by a name
        that its file, with or without suffix, came under.

        Also the test's name, where it was that. Raises NothingThere, and UsageError where several
        recordings are called so.
        """
        with self.reading() as connection:
            if which.isdecimal():
                by_number = sa.select(recordings.c.id).where(recordings.c.id == int(which))
                if connection.scalar(by_number) is not None:
                    return int(which), None
            by_name = sa.select(tests.c.recording_id).where(tests.c.name == which, in_force(tests))
            found = connection.scalars(by_name.order_by(tests.c.recording_id)).all()
            if found:
                return _single(found, f"{len(found)} hangers have a test {which!r}."), which
            former = by_former_names(connection, which)
        if not former:
            raise NothingThere(f"no recording and no test {which!r}.", remedy="See `shm status`.")
        return _single(former, f"{len(former)} recordings were called {which!r}."), None

    def list_all(self, stage: Stage | None = None) -> tuple[StoredRecording, ...]:
        """All recordings, or those at one stage, as they came in."""
        query = sa.select(recordings).order_by(recordings.c.id)
        if stage is not None:
            query = query.where(recordings.c.stage == stage)
        return self._recordings(query)

    def list_waiting(
        self, limit: int, excluding: Collection[int] = ()
    ) -> tuple[StoredRecording, ...]:
        """The first recordings that are received and not yet identified."""
        waiting = recordings.c.stage == Stage.RECEIVED
        query = sa.select(recordings).where(waiting, recordings.c.id.not_in(excluding))
        return self._recordings(query.order_by(recordings.c.id).limit(limit))

    def list_under_way(self) -> tuple[Standing, ...]:
        """The recordings that are not through, and since when each stands where it stands."""
        reached = sa.func.max(journal.c.at).label("reached_at")
        query = (
            sa.select(recordings, reached)
            .outerjoin(journal, (journal.c.recording_id == recordings.c.id) & is_step)
            .where(recordings.c.stage.in_(ON_THE_WAY))
            .group_by(recordings.c.id)
            .order_by(recordings.c.id)
        )
        rows = self.rows(query)
        return tuple(
            Standing(
                row.id,
                row.file_name,
                Stage(row.stage),
                row.hanger,
                row.reached_at or row.received_at,
            )
            for row in rows
        )

    def oldest_waiting(self) -> datetime | None:
        """When the oldest recording came in that is not through yet; None where all are."""
        query = sa.select(recordings.c.received_at).where(recordings.c.stage.in_(ON_THE_WAY))
        row = self.first(query.order_by(recordings.c.id).limit(1))
        return None if row is None else row.received_at

    def stage_counts(self) -> dict[str, int]:
        """How many recordings stand at each stage; see `counts_by_name`."""
        query = sa.select(recordings.c.stage, sa.func.count()).group_by(recordings.c.stage)
        return counts_by_name(Stage, self.rows(query))

    def stage_seconds(self, since: datetime) -> dict[str, list[float]]:
        """How long after the stage before each step was reached, of steps made since then.

        By the name of the step, which need be no `Stage`.
        """
        lately = sa.select(journal.c.recording_id).where(is_step, journal.c.at >= since)
        query = sa.select(journal).where(journal.c.recording_id.in_(lately), is_step)
        found: defaultdict[str, list[float]] = defaultdict(list)
        before: dict[tuple[int, int | None], datetime] = {}
        for row in self.rows(query.order_by(journal.c.id)):
            of_file, of_test = (row.recording_id, None), (row.recording_id, row.test_id)
            began = before.get(of_test) or before.get(of_file)
            if began is not None and row.at >= since and row.kind != Stage.RECEIVED:
                found[row.kind].append((row.at - began).total_seconds())
            before[of_test] = row.at
        return dict(found)

    def note_death(self, recording_id: int, message: str, at: datetime) -> None:
        """Note that a process that worked on a recording died."""
        with self.writing() as connection:
            row = by_id(connection, recording_id)
            write(connection, at, DIED, row.id, subject=row.file_name, detail=message)

    def deaths(self) -> dict[int, Deaths]:
        """Return the deaths at each recording on its way, since it last moved on."""
        moved_at = (
            sa.select(journal.c.recording_id, sa.func.max(journal.c.at).label("at"))
            .where(is_step)
            .group_by(journal.c.recording_id)
            .subquery()
        )
        own = journal.c.recording_id
        query = (
            sa.select(own, sa.func.count(), sa.func.max(journal.c.at))
            .join(recordings, recordings.c.id == own)
            .join(moved_at, moved_at.c.recording_id == own)
            .where(journal.c.kind == DIED, journal.c.at >= moved_at.c.at)
            .where(recordings.c.stage.not_in(ENDED))
            .group_by(own)
        )
        return {row[0]: Deaths(row[1], row[2]) for row in self.rows(query)}

    def _recordings(self, query: sa.Select[Any]) -> tuple[StoredRecording, ...]:
        return tuple(map(recording_from, self.rows(query)))


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


def _single(found: Sequence[int], several: str) -> int:
    if len(found) > 1:
        numbers = ", ".join(map(str, found))
        raise UsageError(several, remedy=f"Give its recording's number: {numbers}.")
    return found[0]
