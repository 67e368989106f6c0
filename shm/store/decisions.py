"""What a person decides of a recording: to confirm or discard it, take it out or back, do it again.

Nothing is deleted: the raw file, the test and what was made of it stay.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import UsageError, sentence
from shm.store.audit import note
from shm.store.database import Repository, insert
from shm.store.files import (
    advance_recordings,
    by_id,
    counts,
    end_recording,
    end_tests,
    in_force,
    write_event,
    write_step,
)
from shm.store.holding import (
    confirmed_values,
    decide,
    discarded_reason,
    held_rows,
    holds_of,
    latest_hold,
    open_holds,
    reason_of,
    refuse_time,
    standing_discard,
    taking_back,
    undecided,
)
from shm.store.list_rows import Decision, HeldTest, Hold, Rerun
from shm.store.outbox import resolve
from shm.store.queries import WEIGHED
from shm.store.reprocessing import of_baselines, reprocess, send_back, supersede_results
from shm.store.rows import Stage
from shm.store.tables import alerts, holds, recordings, tests, watches


@dataclass(frozen=True)
class Withdrawal:
    """What came of taking tests out: the decision, the names of those a baseline was made from and
    since when it is, and how many later tests are watched again without them."""

    hold: Hold
    of_baseline: tuple[str, ...]
    since: datetime
    watched_again: int


class Decisions(Repository):
    """The part of `Recordings` by which people decide what counts."""

    def list_holds(self, hanger: int | None = None) -> tuple[Hold, ...]:
        """What nobody has decided on yet, the oldest first; of one hanger where named."""
        with self.reading() as connection:
            return open_holds(connection, hanger)

    def latest_hold(self, recording_id: int) -> Hold | None:
        """Why a recording is or was last held, and what a person made of it."""
        with self.reading() as connection:
            return latest_hold(connection, recording_id)

    def discard_in_force(self, recording_id: int) -> Hold | None:
        """The decision by which a recording is out; None where it counts, or was refused since."""
        with self.reading() as connection:
            return standing_discard(connection, by_id(connection, recording_id))

    def decisions(self, recording_id: int, sidecar_as: str | None) -> Mapping[int, Hold]:
        """The newest decision on each test of a recording, by its place in the file, among those
        that were made on it with one sidecar."""
        with self.reading() as connection:
            return _decided_with(connection, recording_id, sidecar_as)

    def confirm(
        self, recording_id: int, who: str, why: str, at: datetime, time: datetime | None = None
    ) -> Hold:
        """Lets the held tests of a recording count from now on; the hold with that decision.

        `time` is the true time of its test; without it, one whose time is certainly wrong counts
        from its receipt. Raises NothingThere where there is no such recording, UsageError where it
        is not held, or where the time cannot be right.
        """
        with self.writing() as connection:
            hold = undecided(connection, recording_id)
            refuse_time(hold, time, at)
            _let_count(connection, held_rows(connection, recording_id), hold, time, who, at)
            own = sa.update(recordings).where(recordings.c.id == recording_id)
            connection.execute(own.values(reason=None))
            advance_recordings(connection, [recording_id], at)
            decided = replace(hold, decision=Decision.CONFIRMED, time=time)
            return decide(connection, decided, who, why, at)

    def discard(self, recording_id: int, who: str, why: str, at: datetime) -> Hold:
        """Refuse the held tests of a recording; its other tests go on counting.

        Its raw file stays in the archive, and the recording ends where no test of it is left.
        Raises NothingThere where there is no such recording, UsageError where it is not held.
        """
        with self.writing() as connection:
            hold = undecided(connection, recording_id)
            held = [row.id for row in held_rows(connection, recording_id)]
            end_tests(connection, recording_id, held, at)
            decided = replace(hold, decision=Decision.DISCARDED, decided_at=at, who=who, why=why)
            _end_or_advance(connection, by_id(connection, recording_id), decided, at)
            return decide(connection, decided, who, why, at)

    def withdraw(
        self, recording_id: int, who: str, why: str, at: datetime, test: str | None = None
    ) -> Withdrawal:
        """From now on the tests of a recording, or one of them, count in nothing.

        Their posteriors and watches are superseded, the alerts that they raised end, and the later
        tests of the hanger are watched again; baselines stay as they were made. Raises NothingThere
        where there is no such recording, UsageError where none of it counts.
        """
        with self.writing() as connection:
            recording = by_id(connection, recording_id)
            chosen = _chosen(connection, recording_id, counts(tests), test)
            if not chosen or recording.stage == Stage.RECEIVED:
                out = any(each.is_out for each in holds_of(connection, recording_id)[-1:])
                now = "was discarded" if out else f"is {recording.stage}"
                raise UsageError(
                    f"recording {recording_id} does not count: it {now}.",
                    remedy="See `shm ingest --held`.",
                )
            own = of_baselines(connection, chosen)
            weighed = _weighed(connection, chosen)
            ids = [row.id for row in chosen]
            end_tests(connection, recording_id, ids, at)
            supersede_results(connection, ids, Stage.IDENTIFIED, at)
            told = f"test discarded by {who}" + (f": {why}" if why else "")
            raised = sa.select(alerts.c.id).where(alerts.c.test_id.in_(ids))
            for alert_id in connection.scalars(raised).all():
                resolve(connection, alert_id, who, told, at)
            again = _watch_again(connection, chosen, weighed, at)
            held = [HeldTest(row.position, row.name, ()) for row in chosen]
            record = (Decision.WITHDRAWN, who, why, at, None)
            hold = _decide_unheld(connection, recording, held, record)
            _end_or_advance(connection, recording, hold, at)
            names = tuple(sorted(row.name for row in chosen if row.id in own))
            return Withdrawal(hold, names, min(row.time for row in chosen), again)

    def reinstate(
        self,
        recording_id: int,
        who: str,
        why: str,
        at: datetime,
        time: datetime | None = None,
        test: str | None = None,
    ) -> Hold:
        """What was discarded of a recording, or one test of it, counts again; with its true `time`
        where that is given.

        Raises NothingThere where there is no such recording, UsageError where nothing of it, or not
        that test, was discarded.
        """
        with self.writing() as connection:
            recording = by_id(connection, recording_id)
            refused = _chosen(connection, recording_id, tests.c.stage == Stage.REFUSED, test)
            past = _decided_with(connection, recording_id, recording.sidecar_as)
            chosen = [row for row in refused if row.position in past and past[row.position].is_out]
            if not chosen:
                raise UsageError(
                    f"nothing of recording {recording_id} is held or discarded: it is "
                    f"{recording.stage}.",
                    remedy="See `shm ingest --held`.",
                )
            former = [past[row.position] for row in chosen]
            held = [
                each
                for row, hold in zip(chosen, former, strict=True)
                for each in hold.tests
                if each.position == row.position
            ]
            record = (Decision.REINSTATED, who, why, at, time or former[-1].time)
            hold = _decide_unheld(connection, recording, held, record)
            _let_count(connection, chosen, hold, hold.time, who, at)
            by_number = sa.update(recordings).where(
                recordings.c.id == recording_id, recordings.c.stage == Stage.REFUSED
            )
            connection.execute(by_number.values(stage=Stage.RECEIVED, reason=None))
            advance_recordings(connection, [recording_id], at)
            _watch_again(connection, chosen, _weighed(connection, chosen), at)
            return hold

    def reprocess(
        self, recording_id: int, stage: Stage, at: datetime, test: str | None = None
    ) -> Rerun:
        """Sends a recording back so that `stage` is reached anew; what came of it is superseded.

        A file is always identified as a whole; from a later stage on it may be one `test` alone.
        Raises NothingThere, and UsageError where the recording has not come so far.
        """
        with self.writing() as connection:
            made = reprocess(connection, recording_id, stage, at, test)
            subject = test or by_id(connection, recording_id).file_name
            note(connection, at, "recording done again", subject, f"from {stage}")
            return made


def _let_count(
    connection: Connection,
    rows: Sequence[Row[Any]],
    hold: Hold,
    time: datetime | None,
    who: str,
    at: datetime,
) -> None:
    """Tests of one recording are identified from now on, at the `time` that a person gave."""
    for row in rows:
        values = confirmed_values(connection, row, hold, time, who)
        this = sa.update(tests).where(tests.c.id == row.id)
        connection.execute(this.values(stage=Stage.IDENTIFIED, **values))
        write_step(connection, row.recording_id, Stage.IDENTIFIED, at, row.id)


def _decided_with(
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
    query = query.where(tests.c.recording_id == recording_id, in_force(tests), which)
    if test is not None:
        query = query.where(tests.c.name == test)
    return connection.execute(query.order_by(tests.c.id)).all()


def _end_or_advance(connection: Connection, recording: Row[Any], hold: Hold, at: datetime) -> None:
    """End a recording of which a decision left no test; else move it on without that test."""
    if connection.scalar(_left(recording.id)):
        still_held = sa.update(recordings).where(
            recordings.c.id == recording.id, recordings.c.stage == Stage.HELD
        )
        connection.execute(still_held.values(reason=None))
        advance_recordings(connection, [recording.id], at)
    else:
        reason = reason_of(recording, discarded_reason(hold), at, taking_back(hold))
        end_recording(connection, recording.id, reason, at)


def _left(recording_id: int) -> sa.Select[Any]:
    """How many tests of a recording count or are held."""
    own = (tests.c.recording_id == recording_id) & in_force(tests)
    return sa.select(sa.func.count()).where(own, tests.c.stage != Stage.REFUSED)


def _decide_unheld(
    connection: Connection,
    recording: Row[Any],
    held: Sequence[HeldTest],
    record: tuple[Decision, str, str, datetime, datetime | None],
) -> Hold:
    """Notes a decision that no hold came before; told of in no alert.

    `record` is which, by whom, why, when, and the time that the test is given.
    """
    decision, who, why, at, time = record
    names = ", ".join(test.name for test in held)
    message = sentence(f"{decision} by {who}: {names}" + (f": {why}" if why else ""))
    document = {
        "message": message,
        "sidecar_as": recording.sidecar_as,
        "tests": [asdict(test) for test in held],
    }
    row = {"recording_id": recording.id, "held_at": at, "document": document}
    made = {"decision": decision, "decided_at": at, "who": who, "why": why, "time": time}
    insert(connection, holds, {**row, **made})
    write_event(connection, at, str(decision), recording.id, recording.file_name, message)
    note(connection, at, f"recording {decision}", f"{recording.file_name}: {names}", why, who)
    return holds_of(connection, recording.id)[-1]


def _weighed(connection: Connection, chosen: Sequence[Row[Any]]) -> bool:
    """Whether the tension was read at one of the tests, which taught later ones."""
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
        count += send_back(connection, hanger, later, stage, at)
    return count
