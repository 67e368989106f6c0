"""Doing work again: what it replaces is superseded and stays, with its lineage.

Tests that are compared with their baseline again, since what they are judged by has changed, or
with none.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import UsageError
from shm.store.audit import note
from shm.store.database import Repository
from shm.store.files import (
    advance_recordings,
    all_at,
    begin_again,
    by_id,
    counts,
    in_force,
    move,
    move_numbers,
    recording_from,
    write_event,
    write_step,
)
from shm.store.holding import discarded_reason, end_hold, standing_discard, taking_back
from shm.store.list_rows import ReceivedFile, Rerun
from shm.store.rows import Baseline, Stage, StoredTest
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

AGAIN_FROM = (Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)
BEFORE = {Stage.UPDATED: Stage.IDENTIFIED, Stage.WATCHED: Stage.UPDATED}


def reprocess(
    connection: Connection, recording_id: int, stage: Stage, at: datetime, test: str | None = None
) -> Rerun:
    """Sends a recording back so that `stage` is reached anew; what came of it is superseded.

    Raises NothingThere, and UsageError where the recording has not come so far.
    """
    recording = by_id(connection, recording_id)
    out = standing_discard(connection, recording)
    if out is not None and not _any_counts(connection, recording_id):
        told = f"{recording.file_name} was {discarded_reason(out)}"
        raise UsageError(told, remedy=taking_back(out))
    chosen = _chosen(connection, recording, stage, test)
    ids = [row.id for row in chosen]
    own = of_baselines(connection, chosen)
    counts = supersede_results(connection, ids, stage, at)
    if stage is Stage.IDENTIFIED:
        _identify_again(connection, recording_id, ids, at)
    else:
        _send_back(connection, recording_id, ids, stage, at)
    kept = _kept_states(recording.hanger)
    connection.execute(sa.delete(watch_states).where(kept))
    message = f"sent back by request, to be {stage} again."
    write_event(connection, at, "again", recording_id, recording.file_name, message)
    stored = recording_from(by_id(connection, recording_id))
    names = tuple(row.name for row in chosen)
    return Rerun(stored, names, *counts, tuple(r.name for r in chosen if r.id in own))


def reopen(connection: Connection, recording_id: int, file: ReceivedFile, at: datetime) -> None:
    """A refused file starts anew; results it had before the refusal stay in force."""
    refused = (tests.c.recording_id == recording_id) & (tests.c.stage == Stage.REFUSED)
    connection.execute(sa.update(tests).where(refused, in_force(tests)).values(superseded_at=at))
    connection.execute(
        sa.update(recordings).where(recordings.c.id == recording_id).values(**vars(file))
    )
    begin_again(connection, recording_id, at)


def redescribe(connection: Connection, known: Row[Any], file: ReceivedFile, at: datetime) -> str:
    """Does a recording again with another sidecar, from its identification on; what that replaces.

    `known` is its row as it was.
    """
    query = sa.select(tests).where(tests.c.recording_id == known.id, in_force(tests))
    rows = connection.execute(query).all()
    ids = [row.id for row in rows]
    of_baseline = sorted(row.name for row in rows if row.id in of_baselines(connection, rows))
    by_id = sa.update(recordings).where(recordings.c.id == known.id)
    connection.execute(by_id.values(**vars(file)))
    supersede_results(connection, ids, Stage.IDENTIFIED, at)
    _identify_again(connection, known.id, ids, at)
    connection.execute(sa.delete(watch_states).where(_kept_states(known.hanger)))
    told = f"the same bytes as {known.file_name} with another sidecar: done again with that."
    if of_baseline:
        told += f" The baseline made from {', '.join(of_baseline)} stays: `shm drift rebaseline`."
    return told


def of_baselines(connection: Connection, chosen: Sequence[Row[Any]]) -> set[int]:
    """Which of the tests, or former identifications of them, a baseline was made from."""
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
    """How many posteriors and watches are superseded; those of baselines and selections stay."""
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


def _identify_again(
    connection: Connection, recording_id: int, ids: Collection[int], at: datetime
) -> None:
    _mark(connection, tests, tests.c.id.in_(ids), at)
    end_hold(connection, recording_id, at)
    begin_again(connection, recording_id, at)


def _chosen(
    connection: Connection, recording: Row[Any], stage: Stage, test: str | None
) -> Sequence[Row[Any]]:
    """The tests that are sent back: those of a whole file, or the one that is named."""
    query = sa.select(tests).where(tests.c.recording_id == recording.id, in_force(tests))
    if test is not None and stage is not Stage.IDENTIFIED:
        query = query.where(tests.c.name == test)
    rows = connection.execute(query.order_by(tests.c.id)).all()
    waits = recording.stage == Stage.RECEIVED
    if stage is not Stage.IDENTIFIED:
        waits = not rows or any(not _has_reached(row.stage, stage) for row in rows)
    if waits:
        raise UsageError(
            f"{recording.file_name} has not come so far as to be {stage} again: it is "
            f"{recording.stage}.",
            remedy="Wait until it is done, or give an earlier --from.",
        )
    return rows


def _any_counts(connection: Connection, recording_id: int) -> bool:
    """Whether any test of a recording counts."""
    own = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
    return connection.execute(own.where(in_force(tests), counts(tests))).first() is not None


def _has_reached(stage: str, wanted: Stage) -> bool:
    """Whether a test has what is to be done anew; one that was refused has got to nothing."""
    return stage in AGAIN_FROM[AGAIN_FROM.index(wanted) :]


def _mark(
    connection: Connection, table: sa.Table, which: sa.ColumnElement[bool], at: datetime
) -> int:
    found = sa.update(table).where(which, in_force(table)).values(superseded_at=at)
    return connection.execute(found).rowcount


def _send_back(
    connection: Connection, recording_id: int, ids: Collection[int], stage: Stage, at: datetime
) -> None:
    before = BEFORE[stage]
    connection.execute(sa.update(tests).where(tests.c.id.in_(ids)).values(stage=before))
    for test_id in ids:
        write_step(connection, recording_id, before, at, test_id)
    reopened = sa.update(recordings).where(recordings.c.id == recording_id)
    connection.execute(reopened.values(stage=before, reason=None))
    advance_recordings(connection, [recording_id], at)


def _kept_states(hanger: int | None) -> sa.ColumnElement[bool]:
    """What the watch keeps of a hanger was made with the test that is done again."""
    return watch_states.c.hanger == hanger


class WatchedAgain(Repository):
    """Sends watched tests back, tells those that were watched before, passes tests over."""

    def judge_again(self, hanger: int, baseline_id: int, why: str, at: datetime) -> int:
        """Sends back what was compared with a baseline, to be judged anew; how many tests."""
        with self.writing() as connection:
            which = watches.c.baseline_id == baseline_id
            count = send_back(connection, hanger, which, Stage.WATCHED, at)
            if count:
                note(connection, at, "tests judged again", f"hanger {hanger}", why, "shm")
            return count

    def pass_over(self, test: StoredTest, at: datetime) -> None:
        """A test within a maintenance window is compared with nothing."""
        with self.writing() as connection:
            if all_at(connection, [test], Stage.UPDATED):
                move(connection, [test], Stage.WATCHED, at)

    def is_again(self, test: StoredTest, baseline: Baseline) -> bool:
        """Whether a test has been compared with a baseline before."""
        own = (watches.c.test_id == test.id) & (watches.c.baseline_id == baseline.id)
        return self.first(sa.select(watches.c.id).where(own)) is not None

    def is_caught_up(self, test: StoredTest, baseline: Baseline) -> bool:
        """Return True where no other test waits to be compared with a baseline once more."""
        waiting = tests.c.stage.in_([Stage.IDENTIFIED, Stage.UPDATED]) & in_force(tests)
        query = sa.select(tests.c.id).join(watches).where(watches.c.baseline_id == baseline.id)
        return self.first(query.where(waiting, tests.c.id != test.id)) is None


def send_back(
    connection: Connection, hanger: int, which: sa.ColumnElement[bool], stage: Stage, at: datetime
) -> int:
    """Sends watched tests of a hanger back so that `stage` is reached anew; how many tests."""
    query = (
        sa.select(tests.c.id, tests.c.recording_id)
        .join(watches)
        .where(watches.c.hanger == hanger, which, in_force(watches))
        .where(tests.c.stage == Stage.WATCHED, in_force(tests))
    )
    again = {row.id: row.recording_id for row in connection.execute(query)}
    connection.execute(sa.delete(watch_states).where(watch_states.c.hanger == hanger))
    supersede_results(connection, list(again), stage, at)
    move_numbers(connection, again, BEFORE[stage], at)
    return len(again)
