"""Read how far recordings have come, and which are held."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from shm.errors import NothingThere, UsageError
from shm.store.database import Repository
from shm.store.files import by_checksum, by_former_names, by_id, is_current
from shm.store.holding import hold_from, latest_hold, standing_discard, stored_holds
from shm.store.journal import DIED, is_step
from shm.store.mapping import value_in
from shm.store.rows import (
    ENDED,
    ON_THE_WAY,
    Deaths,
    Hold,
    RecordingInProgress,
    Stage,
    StoredRecording,
    sum_counts,
)
from shm.store.stored_recordings import waits_at
from shm.store.tables import holds, journal, recordings, tests


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


def list_under_way(store: Repository) -> tuple[RecordingInProgress, ...]:
    """List recordings under way, each with the time of its last step."""
    reached = sa.func.max(journal.c.at).label("reached_at")
    query = (
        sa.select(recordings, reached)
        .outerjoin(journal, (journal.c.recording_id == recordings.c.id) & is_step)
        .where(recordings.c.stage.in_(ON_THE_WAY))
        .group_by(recordings.c.id)
        .order_by(recordings.c.id)
    )
    rows = store.rows(query)
    return tuple(
        RecordingInProgress(
            row.id,
            row.file_name,
            row.stage,
            row.hanger,
            row.reached_at or row.received_at,
        )
        for row in rows
    )


def find_oldest_waiting(store: Repository) -> datetime | None:
    """Return when the oldest recording under way came in; None without one."""
    query = sa.select(recordings.c.received_at).where(recordings.c.stage.in_(ON_THE_WAY))
    row = store.first(query.order_by(recordings.c.id).limit(1))
    return None if row is None else row.received_at


def count_stages(store: Repository) -> dict[str, int]:
    """Count the recordings at each stage; see `sum_counts`."""
    query = sa.select(sa.type_coerce(recordings.c.stage, sa.Text), sa.func.count()).group_by(
        recordings.c.stage
    )
    return sum_counts(Stage, store.rows(query))


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
    own = journal.c.recording_id
    query = (
        sa.select(own, sa.func.count(), sa.func.max(journal.c.at))
        .join(recordings, recordings.c.id == own)
        .join(moved_at, moved_at.c.recording_id == own)
        .where(journal.c.kind == DIED, journal.c.at >= moved_at.c.at)
        .where(recordings.c.stage.not_in(ENDED))
        .group_by(own)
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
