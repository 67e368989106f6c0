"""Decide which tests count: a person accepts or excludes them, or has them done again.

Nothing is deleted: raw file, test and results stay, and each decision can be taken back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import UsageError, sentence
from shm.store.database import Repository
from shm.store.files import (
    advance_recordings,
    by_id,
    end_recording,
    end_tests,
    is_counted,
    is_current,
)
from shm.store.holding import (
    confirmed_values,
    decide,
    discarded_reason,
    held_rows,
    holds_of,
    insert_hold,
    latest_hold,
    reason_of,
    refuse_time,
    taking_back,
)
from shm.store.journal import write
from shm.store.outbox import resolve
from shm.store.rerun import of_baselines, rerun_recording, rerun_watched, supersede_results
from shm.store.rows import Decision, HeldTest, Hold, Rerun, Stage
from shm.store.selects import WEIGHED
from shm.store.tables import alerts, recordings, tests, watches


@dataclass(frozen=True)
class Exclusion:
    """Tests that were excluded: the decision, and what follows where they had counted.

    `of_baseline` names those that a baseline was made from, `since` is the time of the first, and
    `watched_again` counts the later tests that are watched again without them.
    """

    hold: Hold
    of_baseline: tuple[str, ...] = ()
    since: datetime | None = None
    watched_again: int = 0


class Dispositions(Repository):
    """The part of `Recordings` by which people decide what counts."""

    def accept(
        self,
        recording_id: int,
        who: str,
        why: str,
        at: datetime,
        time: datetime | None = None,
        test: str | None = None,
    ) -> Hold:
        """Let tests of a recording count that are held or, where none is, that were excluded.

        `time` is the true time of its test; without it, one whose time is certainly wrong counts
        from its receipt. Raises NothingThere where there is no such recording, UsageError where
        nothing of it, or not that `test`, is held or excluded, or where the time cannot be right.
        """
        with self.writing() as connection:
            recording = by_id(connection, recording_id)
            hold, rows = _held(connection, recording_id, test)
            own = sa.update(recordings).where(recordings.c.id == recording_id)
            if hold is None:
                hold, rows = _excluded(connection, recording, time, test)
                own = own.where(recordings.c.stage == Stage.REFUSED).values(stage=Stage.RECEIVED)
            else:
                hold = replace(hold, decision=Decision.CONFIRMED, time=time)
            refuse_time(hold, time, at)
            hold = _decide(connection, hold, who, why, at)
            _let_count(connection, rows, hold, who, at)
            connection.execute(own.values(reason=None))
            advance_recordings(connection, [recording_id], at)
            if hold.decision is Decision.REINSTATED:
                _watch_again(connection, rows, _weighed(connection, rows), at)
            return hold

    def exclude(
        self, recording_id: int, who: str, why: str, at: datetime, test: str | None = None
    ) -> Exclusion:
        """Let the held tests of a recording or, where none is, those that count, count in nothing.

        With `test` it is that one of those that count. Results of these are superseded, alerts that
        they raised end, and later tests of the hanger are watched again; baselines stay as they
        were made. The recording ends where no test of it is left. Raises NothingThere where there
        is no such recording, UsageError where none of it is held or counts.
        """
        with self.writing() as connection:
            recording = by_id(connection, recording_id)
            hold, rows = _held(connection, recording_id, test)
            if hold is not None:
                hold = replace(hold, decision=Decision.DISCARDED)
                end_tests(connection, recording_id, [row.id for row in rows], at)
                hold = _decide(connection, hold, who, why, at)
                _end_or_advance(connection, recording, hold, at)
                return Exclusion(hold)
            rows = _chosen(connection, recording_id, is_counted(tests), test)
            if not rows or recording.stage == Stage.RECEIVED:
                raise _not_counting(connection, recording)
            ids, weighed = [row.id for row in rows], _weighed(connection, rows)
            own = of_baselines(connection, rows)
            end_tests(connection, recording_id, ids, at)
            supersede_results(connection, ids, Stage.IDENTIFIED, at)
            text = f"test discarded by {who}" + (f": {why}" if why else "")
            raised = sa.select(alerts.c.id).where(alerts.c.test_id.in_(ids))
            for alert_id in connection.scalars(raised).all():
                resolve(connection, alert_id, who, text, at)
            again = _watch_again(connection, rows, weighed, at)
            named = [HeldTest(row.position, row.name, ()) for row in rows]
            hold = _unheld(recording, Decision.WITHDRAWN, named)
            hold = _decide(connection, hold, who, why, at)
            _end_or_advance(connection, recording, hold, at)
            names = tuple(sorted(row.name for row in rows if row.id in own))
            return Exclusion(hold, names, min(row.time for row in rows), again)

    def rerun(
        self, recording_id: int, from_stage: Stage, at: datetime, test: str | None = None
    ) -> Rerun:
        """Send a recording back so that a stage is reached anew; what came of it is superseded.

        A file is always identified as a whole; from a later stage on it may be one `test` alone.
        Raises NothingThere, and UsageError where the recording has not come so far.
        """
        with self.writing() as connection:
            return rerun_recording(connection, recording_id, from_stage, at, test)


def _held(
    connection: Connection, recording_id: int, test: str | None
) -> tuple[Hold | None, Sequence[Row[Any]]]:
    """Return the hold that waits for a decision and its tests, unless `test` is none of them."""
    hold = latest_hold(connection, recording_id)
    if hold is None or hold.decision is not None:
        return None, ()
    rows = held_rows(connection, recording_id)
    if test is not None and all(row.name != test for row in rows):
        return None, ()
    return hold, rows


def _excluded(
    connection: Connection, recording: Row[Any], time: datetime | None, test: str | None
) -> tuple[Hold, Sequence[Row[Any]]]:
    """Return the decision that takes an exclusion back, and its tests; raises UsageError."""
    refused = _chosen(connection, recording.id, tests.c.stage == Stage.REFUSED, test)
    past = decided_with(connection, recording.id, recording.sidecar_as)
    rows = [row for row in refused if row.position in past and past[row.position].is_out]
    if not rows:
        raise _not_held(connection, recording)
    former = [past[row.position] for row in rows]
    named = [
        each
        for row, hold in zip(rows, former, strict=True)
        for each in hold.tests
        if each.position == row.position
    ]
    return _unheld(recording, Decision.REINSTATED, named, time or former[-1].time), rows


def _not_held(connection: Connection, recording: Row[Any]) -> UsageError:
    hold, number = latest_hold(connection, recording.id), recording.id
    if hold is None or hold.decision is not Decision.CONFIRMED:
        return UsageError(
            f"nothing of recording {number} is held or discarded: it is {recording.stage}.",
            remedy="See `shm ingest --held`.",
        )
    return UsageError(
        f"recording {number} is not held: it was {hold.decision} by {hold.who}.",
        remedy=f"`shm ingest --discard {number} --why TEXT` takes out what counts.",
    )


def _not_counting(connection: Connection, recording: Row[Any]) -> UsageError:
    hold = latest_hold(connection, recording.id)
    now = "was discarded" if hold is not None and hold.is_out else f"is {recording.stage}"
    return UsageError(
        f"recording {recording.id} does not count: it {now}.", remedy="See `shm ingest --held`."
    )


def _let_count(
    connection: Connection, rows: Sequence[Row[Any]], hold: Hold, who: str, at: datetime
) -> None:
    """Bring tests of one recording to identified, at the time that a person gave."""
    for row in rows:
        values = confirmed_values(connection, row, hold, hold.time, who)
        this = sa.update(tests).where(tests.c.id == row.id)
        connection.execute(this.values(stage=Stage.IDENTIFIED, **values))
        write(connection, at, Stage.IDENTIFIED, row.recording_id, row.id)


def decided_with(
    connection: Connection, recording_id: int, sidecar_as: str | None
) -> dict[int, Hold]:
    return {
        test.position: hold
        for hold in holds_of(connection, recording_id)
        if hold.sidecar_as == sidecar_as and (hold.is_in or hold.is_out)
        for test in hold.tests
    }


def _chosen(
    connection: Connection, recording_id: int, which: sa.ColumnElement[bool], test: str | None
) -> Sequence[Row[Any]]:
    query = sa.select(tests, recordings.c.received_at).join(recordings)
    query = query.where(tests.c.recording_id == recording_id, is_current(tests), which)
    if test is not None:
        query = query.where(tests.c.name == test)
    return connection.execute(query.order_by(tests.c.id)).all()


def _end_or_advance(connection: Connection, recording: Row[Any], hold: Hold, at: datetime) -> None:
    """End a recording of which a decision left no test; else move it on without that test."""
    if connection.scalar(_count_left(recording.id)):
        still_held = sa.update(recordings).where(
            recordings.c.id == recording.id, recordings.c.stage == Stage.HELD
        )
        connection.execute(still_held.values(reason=None))
        advance_recordings(connection, [recording.id], at)
    else:
        reason = reason_of(recording, discarded_reason(hold), at, taking_back(hold))
        end_recording(connection, recording.id, reason, at)


def _count_left(recording_id: int) -> sa.Select[Any]:
    """Return the query for the number of tests of a recording that count or are held."""
    own = (tests.c.recording_id == recording_id) & is_current(tests)
    return sa.select(sa.func.count()).where(own, tests.c.stage != Stage.REFUSED)


def _unheld(
    recording: Row[Any],
    decision: Decision,
    named: Sequence[HeldTest],
    time: datetime | None = None,
) -> Hold:
    """Return a decision that no hold came before; `_decide` gives it its number."""
    return Hold(
        id=0,
        recording_id=recording.id,
        file_name=recording.file_name,
        hanger=recording.hanger,
        held_at=recording.received_at,
        message="",
        tests=tuple(named),
        sidecar_as=recording.sidecar_as,
        decision=decision,
        time=time,
    )


def _decide(connection: Connection, hold: Hold, who: str, why: str, at: datetime) -> Hold:
    """Store a decision: of a hold, whose notice ends with it, or of what was never held."""
    if not hold.id:
        names = ", ".join(test.name for test in hold.tests)
        message = sentence(f"{hold.decision} by {who}: {names}" + (f": {why}" if why else ""))
        hold = replace(hold, message=message, held_at=at)
        hold = replace(hold, id=insert_hold(connection, hold))
    return decide(connection, hold, who, why, at)


def _weighed(connection: Connection, chosen: Sequence[Row[Any]]) -> bool:
    """Return True where the tension was read at one of the tests: later ones learnt from it."""
    query = sa.select(tests.c.id).where(tests.c.id.in_([row.id for row in chosen]), WEIGHED)
    return connection.execute(query).first() is not None


def _watch_again(
    connection: Connection, chosen: Sequence[Row[Any]], weighed: bool, at: datetime
) -> int:
    """Sends the later tests of the hangers back, to be watched with what counts now.

    To be updated, where they learnt from a tension that was read. How many that are.
    """
    stage = Stage.UPDATED if weighed else Stage.WATCHED
    ids, count = [row.id for row in chosen], 0
    for hanger in {row.hanger for row in chosen}:
        since = min(row.time for row in chosen if row.hanger == hanger)
        later = (watches.c.time >= since) & tests.c.id.not_in(ids)
        count += rerun_watched(connection, hanger, later, stage, at)
    return count
