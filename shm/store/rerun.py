"""Do work again from a stage on: what it replaces is superseded and stays, with its lineage.

Whoever asks for it, a person, another sidecar, a changed threshold or a decision on a test: `rerun`
sends the tests back.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import UsageError
from shm.store.files import begin_again, by_id, is_counted, is_current, move_numbers
from shm.store.holding import discarded_reason, end_hold, standing_discard, taking_back
from shm.store.journal import AGAIN, write
from shm.store.mapping import value_in
from shm.store.rows import ReceivedFile, Rerun, Stage, StoredRecording
from shm.store.tables import (
    baselines,
    drifts,
    posterior_tests,
    posteriors,
    recordings,
    selection_entries,
    tests,
    watch_states,
    watches,
)

RERUN_STAGES = (Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)
_BEFORE = {Stage.UPDATED: Stage.IDENTIFIED, Stage.WATCHED: Stage.UPDATED}


def rerun(
    connection: Connection, chosen: Sequence[Any], from_stage: Stage, at: datetime
) -> tuple[int, int]:
    """Send tests back so that a stage is reached anew; return how many posteriors and watches are
    superseded.

    What the watch keeps of their hangers was made with them, and goes. An identification is of
    whole recordings, whose tests are all chosen.
    """
    ids = [row.id for row in chosen]
    superseded = supersede_results(connection, ids, from_stage, at)
    hangers = {row.hanger for row in chosen}
    connection.execute(sa.delete(watch_states).where(watch_states.c.hanger.in_(hangers)))
    if from_stage is not Stage.IDENTIFIED:
        of_tests = {row.id: row.recording_id for row in chosen}
        move_numbers(connection, of_tests, _BEFORE[from_stage], at)
        return superseded
    _mark(connection, tests, tests.c.id.in_(ids), at)
    for recording_id in sorted({row.recording_id for row in chosen}):
        end_hold(connection, recording_id, at)
        begin_again(connection, recording_id, at)
    return superseded


def rerun_watched(
    connection: Connection,
    hanger: int,
    which: sa.ColumnElement[bool],
    from_stage: Stage,
    at: datetime,
) -> int:
    """Send the watched tests of a hanger back of whose watches something holds; return how many."""
    query = (
        sa.select(tests.c.id, tests.c.recording_id, tests.c.hanger)
        .join(watches)
        .where(watches.c.hanger == hanger, which, is_current(watches))
        .where(tests.c.stage == Stage.WATCHED, is_current(tests))
        .distinct()
    )
    chosen = connection.execute(query).all()
    rerun(connection, chosen, from_stage, at)
    return len(chosen)


def rerun_recording(
    connection: Connection,
    recording_id: int,
    from_stage: Stage,
    at: datetime,
    test: str | None = None,
) -> Rerun:
    """Send a recording back, or of a later stage one test of it, as a person asked for.

    Raises NothingThere, and UsageError where the recording has not come so far.
    """
    recording = by_id(connection, recording_id)
    out = standing_discard(connection, recording)
    if out is not None and not _any_counts(connection, recording_id):
        text = f"{recording.file_name} was {discarded_reason(out)}"
        raise UsageError(text, remedy=taking_back(out))
    chosen = _chosen(connection, recording, from_stage, test)
    own = of_baselines(connection, chosen)
    if from_stage is not Stage.IDENTIFIED:
        reopened = sa.update(recordings).where(recordings.c.id == recording_id)
        connection.execute(reopened.values(stage=_BEFORE[from_stage], reason=None))
    superseded = rerun(connection, chosen, from_stage, at)
    if not chosen:  # it was refused before it was identified
        begin_again(connection, recording_id, at)
    text = f"sent back by request, to be {from_stage} again."
    name = recording.file_name
    write(connection, at, AGAIN, recording_id, subject=name, detail=text, who="")
    stored = value_in(by_id(connection, recording_id), StoredRecording)
    names = tuple(row.name for row in chosen)
    return Rerun(stored, names, *superseded, tuple(row.name for row in chosen if row.id in own))


def reopen(connection: Connection, recording_id: int, file: ReceivedFile, at: datetime) -> None:
    """A refused file starts anew; results it had before the refusal stay in force."""
    refused = (tests.c.recording_id == recording_id) & (tests.c.stage == Stage.REFUSED)
    _mark(connection, tests, refused, at)
    connection.execute(
        sa.update(recordings).where(recordings.c.id == recording_id).values(**vars(file))
    )
    begin_again(connection, recording_id, at)


def redescribe(connection: Connection, known: Row[Any], file: ReceivedFile, at: datetime) -> str:
    """Do a recording again with another sidecar; return what that replaces.

    `known` is its row as it was.
    """
    query = sa.select(tests).where(tests.c.recording_id == known.id, is_current(tests))
    rows = connection.execute(query).all()
    own = of_baselines(connection, rows)
    of_baseline = sorted(row.name for row in rows if row.id in own)
    connection.execute(
        sa.update(recordings).where(recordings.c.id == known.id).values(**vars(file))
    )
    rerun(connection, rows, Stage.IDENTIFIED, at)
    if not rows:
        begin_again(connection, known.id, at)
    text = f"the same bytes as {known.file_name} with another sidecar: done again with that."
    if of_baseline:
        text += f" The baseline made from {', '.join(of_baseline)} stays: `shm drift rebaseline`."
    return text


def of_baselines(connection: Connection, chosen: Sequence[Row[Any]]) -> set[int]:
    """Return which of the tests, or former identifications of them, a baseline was made from."""
    made = (
        sa.select(tests.c.hanger, tests.c.name)
        .join(posterior_tests)
        .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
    )
    names = {(row.hanger, row.name) for row in connection.execute(made)}
    return {row.id for row in chosen if (row.hanger, row.name) in names}


def supersede_results(
    connection: Connection, ids: Collection[int], stage: Stage, at: datetime
) -> tuple[int, int]:
    """Supersede the results of tests from a stage on; return how many posteriors and watches.

    Posteriors of baselines and selections stay.
    """
    updated = 0
    if stage is not Stage.WATCHED:
        own = sa.select(posterior_tests.c.posterior_id).where(posterior_tests.c.test_id.in_(ids))
        lasting = sa.union(
            sa.select(baselines.c.posterior_id), sa.select(selection_entries.c.posterior_id)
        )
        theirs = posteriors.c.id.in_(own) & posteriors.c.id.not_in(lasting)
        updated = _mark(connection, posteriors, theirs, at)
    _mark(connection, drifts, drifts.c.test_id.in_(ids), at)
    return updated, _mark(connection, watches, watches.c.test_id.in_(ids), at)


def _chosen(
    connection: Connection, recording: Row[Any], stage: Stage, test: str | None
) -> Sequence[Row[Any]]:
    """Return the tests that are sent back: those of a whole file, or the one that is named."""
    query = sa.select(tests).where(tests.c.recording_id == recording.id, is_current(tests))
    if test is not None and stage is not Stage.IDENTIFIED:
        query = query.where(tests.c.name == test)
    rows = connection.execute(query.order_by(tests.c.id)).all()
    waits = recording.stage == Stage.RECEIVED
    if stage is not Stage.IDENTIFIED:
        reached = RERUN_STAGES[RERUN_STAGES.index(stage) :]
        waits = not rows or any(row.stage not in reached for row in rows)
    if waits:
        raise UsageError(
            f"{recording.file_name} has not come so far as to be {stage} again: it is "
            f"{recording.stage}.",
            remedy="Wait until it is done, or give an earlier --from.",
        )
    return rows


def _any_counts(connection: Connection, recording_id: int) -> bool:
    own = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
    return connection.execute(own.where(is_current(tests), is_counted(tests))).first() is not None


def _mark(
    connection: Connection, table: sa.Table, which: sa.ColumnElement[bool], at: datetime
) -> int:
    found = sa.update(table).where(which, is_current(table)).values(superseded_at=at)
    return connection.execute(found).rowcount
