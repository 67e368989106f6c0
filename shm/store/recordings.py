"""Recordings: received, refused, looked up, named, timed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere, UsageError
from shm.store.columns import value_in
from shm.store.database import Repository, insert
from shm.store.disposition import (
    Dispositions,
    hold_from,
    last_refusal,
    latest_hold,
    redescribe,
    reopen,
    standing_discard,
    stored_holds,
)
from shm.store.files import (
    by_checksum,
    by_former_names,
    by_id,
    end_recording,
    end_tests,
    is_current,
    note_name,
)
from shm.store.journal import ARCHIVED, DIED, REFUSED, is_step, write
from shm.store.rows import (
    ENDED,
    ON_THE_WAY,
    Deaths,
    Decision,
    Hold,
    Outcome,
    Receipt,
    ReceivedFile,
    Stage,
    StoredRecording,
    sum_counts,
)
from shm.store.tables import holds, journal, recordings, tests


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
            test_ids = _of_recording(connection, recording_id, test_ids)
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
    ids = _of_recording(connection, recording.id, test_ids)
    waiting = sa.select(tests.c.id).where(is_current(tests), tests.c.stage == stage)
    return len(connection.scalars(waiting.where(tests.c.id.in_(ids))).all()) == len(ids)


def _of_recording(
    connection: Connection, recording_id: int, test_ids: Collection[int]
) -> Collection[int]:
    """Return those of the tests that are of one recording."""
    of_recording = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
    return connection.scalars(
        of_recording.where(tests.c.id.in_(test_ids)).order_by(tests.c.id)
    ).all()


def is_waiting(
    store: Repository, recording_id: int, stage: Stage, test_ids: Collection[int] = ()
) -> bool:
    """Return True while a recording, or its named tests, are at a stage."""
    with store.reading() as connection:
        return waits_at(connection, by_id(connection, recording_id), stage, test_ids)


def find_by_checksum(store: Repository, sha256: str) -> StoredRecording | None:
    """Return the recording with these bytes, if it was received."""
    with store.reading() as connection:
        row = by_checksum(connection, sha256)
    return None if row is None else value_in(row, StoredRecording)


def find_recording(store: Repository, which: str) -> tuple[int, str | None]:
    """Find a recording by its number, the name of a test, or a name of its file.

    A file may be named without suffix. The name of the test is returned too, where it was that.
    Raises NothingThere, and UsageError where several recordings are called so.
    """
    with store.reading() as connection:
        if which.isdecimal():
            by_number = sa.select(recordings.c.id).where(recordings.c.id == int(which))
            if connection.scalar(by_number) is not None:
                return int(which), None
        by_name = sa.select(tests.c.recording_id).where(tests.c.name == which, is_current(tests))
        found = connection.scalars(by_name.order_by(tests.c.recording_id)).all()
        if found:
            return _single(found, f"{len(found)} hangers have a test {which!r}."), which
        former = by_former_names(connection, which)
    if not former:
        raise NothingThere(f"no recording and no test {which!r}.", remedy="See `shm status`.")
    return _single(former, f"{len(former)} recordings were called {which!r}."), None


def list_recordings(store: Repository, stage: Stage | None = None) -> tuple[StoredRecording, ...]:
    """List all recordings, or those at one stage, as they came in."""
    query = sa.select(recordings).order_by(recordings.c.id)
    if stage is not None:
        query = query.where(recordings.c.stage == stage)
    return _load(store, query)


def list_waiting_recordings(
    store: Repository, limit: int, excluding: Collection[int] = ()
) -> tuple[StoredRecording, ...]:
    """List the first recordings that are not yet identified."""
    waiting = recordings.c.stage == Stage.RECEIVED
    query = sa.select(recordings).where(waiting, recordings.c.id.not_in(excluding))
    return _load(store, query.order_by(recordings.c.id).limit(limit))


def list_under_way(store: Repository) -> tuple[tuple[StoredRecording, datetime], ...]:
    """List recordings under way, each with the time of its last step."""
    reached = sa.func.max(journal.c.at).label("reached_at")
    query = (
        sa.select(recordings, reached)
        .outerjoin(journal, (journal.c.recording_id == recordings.c.id) & is_step)
        .where(recordings.c.stage.in_(ON_THE_WAY))
        .group_by(recordings.c.id)
        .order_by(recordings.c.id)
    )
    return tuple(
        (value_in(row, StoredRecording), row.reached_at or row.received_at)
        for row in store.rows(query)
    )


def find_oldest_waiting(store: Repository) -> datetime | None:
    """Return when the oldest recording under way came in; None without one."""
    query = sa.select(recordings.c.received_at).where(recordings.c.stage.in_(ON_THE_WAY))
    row = store.first(query.order_by(recordings.c.id).limit(1))
    return None if row is None else row.received_at


def count_stages(store: Repository) -> dict[str, int]:
    """Count the recordings at each stage, and apart those that a person discarded."""
    decisions = (Decision.DISCARDED, Decision.WITHDRAWN)
    is_out = (recordings.c.stage == Stage.REFUSED) & last_refusal(recordings.c.id).in_(decisions)
    name = sa.type_coerce(recordings.c.stage, sa.Text)
    stage = sa.case((is_out, str(Decision.DISCARDED)), else_=name)
    query = sa.select(stage, sa.func.count()).select_from(recordings).group_by(sa.text("1"))
    return sum_counts([*Stage, Decision.DISCARDED], store.rows(query))


def list_stage_seconds(store: Repository, since: datetime) -> dict[str, list[float]]:
    """Return the seconds that each step took, of steps made since then.

    By the name of the step, which need be no `Stage`.
    """
    lately = sa.select(journal.c.recording_id).where(is_step, journal.c.at >= since)
    query = sa.select(journal).where(journal.c.recording_id.in_(lately), is_step)
    found: defaultdict[str, list[float]] = defaultdict(list)
    before: dict[tuple[int, int | None], datetime] = {}
    for row in store.rows(query.order_by(journal.c.id)):
        of_file, of_test = (row.recording_id, None), (row.recording_id, row.test_id)
        began = before.get(of_test) or before.get(of_file)
        if began is not None and row.at >= since and row.kind != Stage.RECEIVED:
            found[row.kind].append((row.at - began).total_seconds())
        before[of_test] = row.at
    return dict(found)


def count_deaths(store: Repository) -> dict[int, Deaths]:
    """Return the deaths at each recording on its way, since it last moved on."""
    moved_at = (
        sa.select(journal.c.recording_id, sa.func.max(journal.c.at).label("at"))
        .where(is_step)
        .group_by(journal.c.recording_id)
        .subquery()
    )
    recording_id = journal.c.recording_id
    query = (
        sa.select(recording_id, sa.func.count(), sa.func.max(journal.c.at))
        .join(recordings, recordings.c.id == recording_id)
        .join(moved_at, moved_at.c.recording_id == recording_id)
        .where(journal.c.kind == DIED, journal.c.at >= moved_at.c.at)
        .where(recordings.c.stage.not_in(ENDED))
        .group_by(recording_id)
    )
    return {row[0]: Deaths(row[1], row[2]) for row in store.rows(query)}


def list_holds(store: Repository, hanger: int | None = None) -> tuple[Hold, ...]:
    """Return the holds that nobody has decided on, the oldest first; of one hanger if named."""
    query = stored_holds.where(holds.c.decision.is_(None)).order_by(holds.c.id)
    if hanger is not None:
        query = query.where(recordings.c.hanger == hanger)
    return tuple(map(hold_from, store.rows(query)))


def find_latest_hold(store: Repository, recording_id: int) -> Hold | None:
    """Return the last hold of a recording with its reason and decision, None if it had none."""
    with store.reading() as connection:
        return latest_hold(connection, recording_id)


def find_discard(store: Repository, recording_id: int) -> Hold | None:
    """Return the decision that excludes a recording; None where it counts or was refused since."""
    with store.reading() as connection:
        return standing_discard(connection, by_id(connection, recording_id))


def _single(found: Sequence[int], several: str) -> int:
    if len(found) > 1:
        numbers = ", ".join(map(str, found))
        raise UsageError(several, remedy=f"Give its recording's number: {numbers}.")
    return found[0]


def _load(store: Repository, query: sa.Select[Any]) -> tuple[StoredRecording, ...]:
    return tuple(value_in(row, StoredRecording) for row in store.rows(query))
