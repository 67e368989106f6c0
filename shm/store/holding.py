"""Verbs on what is held: listed, confirmed, discarded; and what a new recording is judged by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere, UsageError, sentence
from shm.modes_document import test_document
from shm.store.blobs import test_from_document
from shm.store.checksums import decoding, loads
from shm.store.database import insert
from shm.store.files import by_id, counts, end_recording, end_tests, in_force, write_event
from shm.store.hold_rows import Decision, Hold
from shm.store.judging import fingerprint_from, held_tests_from, notice_key
from shm.store.queries import Queries, plain_tests
from shm.store.results import advance_recordings
from shm.store.rows import Stage, StoredTest
from shm.store.stepping import write_step
from shm.store.tables import (
    acknowledgements,
    alerts,
    events,
    fingerprints,
    holds,
    recordings,
    tests,
)
from shm.values import Fingerprint, KnownSamples

_MOST_COMPARED = (
    1000  # recordings of a hanger: some 20 MB, at most 110; older ones are found by their digest
)
_holds = sa.select(holds, recordings.c.file_name, recordings.c.hanger).join(recordings)


class Holding(Queries):
    """The part of the store that keeps account of what is held."""

    def holds(self, hanger: int | None = None) -> tuple[Hold, ...]:
        """What nobody has decided on yet, the oldest first; of one hanger where named."""
        query = _holds.where(holds.c.decision.is_(None)).order_by(holds.c.id)
        if hanger is not None:
            query = query.where(recordings.c.hanger == hanger)
        with self.reading() as connection:
            return tuple(_hold(row) for row in connection.execute(query))

    def latest_hold(self, recording_id: int) -> Hold | None:
        """Why a recording is or was last held, and what a person made of it."""
        with self.reading() as connection:
            row = _latest(connection, recording_id)
        return None if row is None else _hold(row)

    def discarded(self, recording_id: int) -> Hold | None:
        """The decision by which a recording is out; None where it counts, or was refused since."""
        with self.reading() as connection:
            return standing_discard(connection, by_id(connection, recording_id))

    def confirm(
        self,
        recording_id: int,
        who: str,
        why: str,
        at: datetime,
        time: datetime | None = None,
    ) -> Hold:
        """Lets the held tests of a recording count from now on; the hold with that decision.

        `time` is the true time of its test; without it, one whose time is certainly wrong counts
        from its receipt. Raises NothingThere where there is no such recording, UsageError where it
        is not held, or where the time cannot be right.
        """
        with self.writing() as connection:
            hold = _undecided(connection, recording_id)
            _refuse_time(hold, time, at)
            for row in _held(connection, recording_id):
                values = confirmed_values(connection, row, hold, time, who)
                this = sa.update(tests).where(tests.c.id == row.id)
                connection.execute(this.values(stage=Stage.IDENTIFIED, **values))
                write_step(connection, recording_id, Stage.IDENTIFIED, at, row.id)
            own = sa.update(recordings).where(recordings.c.id == recording_id)
            connection.execute(own.values(reason=None))
            advance_recordings(connection, [recording_id], at)
            decided = replace(hold, decision=Decision.CONFIRMED, time=time)
            return _decide(connection, decided, who, why, at)

    def discard(self, recording_id: int, who: str, why: str, at: datetime) -> Hold:
        """Ends the held tests of a recording; its raw file stays in the archive.

        Raises NothingThere where there is no such recording, UsageError where it is not held.
        """
        with self.writing() as connection:
            hold = _undecided(connection, recording_id)
            end_tests(
                connection, recording_id, [row.id for row in _held(connection, recording_id)], at
            )
            reason = connection.scalar(
                sa.select(recordings.c.reason).where(recordings.c.id == recording_id)
            )
            decided = replace(hold, decision=Decision.DISCARDED, decided_at=at, who=who, why=why)
            told = {"message": discarded_reason(decided), "remedy": taking_back(decided)}
            end_recording(connection, recording_id, {**(loads(reason) or {}), **told}, at)
            return _decide(connection, decided, who, why, at)

    def known_samples(
        self, recording_id: int, hanger: int, fingerprint: Fingerprint
    ) -> tuple[KnownSamples, ...]:
        """Recordings that may hold the same samples: those of the hanger, and the same numbers of
        any other; the earliest first, as the others may be copies of it."""
        same_numbers = fingerprints.c.digest == fingerprint.digest
        query = (
            sa.select(fingerprints, *(recordings.c[n] for n in ("file_name", "hanger", "stage")))
            .join(recordings)
            .where(
                (recordings.c.hanger == hanger) | same_numbers,
                _before(recordings.c.id, recordings.c.stage, recording_id),
            )
            .order_by(same_numbers.desc(), recordings.c.id.desc())
            .limit(_MOST_COMPARED)
        )
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(
            KnownSamples(
                f"{row.file_name} (recording {row.recording_id})",
                row.hanger,
                fingerprint_from(row),
                row.recording_id,
                row.stage != Stage.HELD,
            )
            for row in sorted(rows, key=lambda row: int(row.recording_id))
        )

    def tests_at(self, hanger: int, time: datetime, recording_id: int) -> tuple[StoredTest, ...]:
        """Tests of a hanger with the very same time, in other recordings."""
        others = _before(tests.c.recording_id, tests.c.stage, recording_id)
        same = (tests.c.hanger == hanger) & (tests.c.taken_at == time) & in_force(tests)
        return self._tests(plain_tests.where(same, others).order_by(tests.c.id))

    def latest_tests_before(
        self, hanger: int, recording_id: int, limit: int
    ) -> tuple[StoredTest, ...]:
        """The latest tests of a hanger that count, but for those of one recording, by time."""
        return self._latest_but(hanger, recording_id, limit, tests.c.time)

    def latest_tests_received(
        self, hanger: int, recording_id: int, limit: int
    ) -> tuple[StoredTest, ...]:
        """Those of them that came in last, whatever their time."""
        return self._latest_but(hanger, recording_id, limit, tests.c.recording_id)

    def _latest_but(
        self, hanger: int, recording_id: int, limit: int, order: sa.Column[Any]
    ) -> tuple[StoredTest, ...]:
        mine = (tests.c.hanger == hanger) & (tests.c.recording_id != recording_id)
        query = plain_tests.where(mine, counts(tests), in_force(tests))
        latest = query.order_by(order.desc(), tests.c.id.desc()).limit(limit)
        return self._tests(latest)[::-1]


def holds_of(connection: Connection, recording_id: int) -> tuple[Hold, ...]:
    """All holds of a recording and decisions on it, the oldest first."""
    query = _holds.where(holds.c.recording_id == recording_id).order_by(holds.c.id)
    return tuple(_hold(row) for row in connection.execute(query))


def standing_discard(connection: Connection, recording: Row[Any]) -> Hold | None:
    """The decision by which a recording is out; None where it counts, or was refused since."""
    if recording.stage != Stage.REFUSED:
        return None
    row = _latest(connection, recording.id)
    hold = None if row is None else _hold(row)
    if hold is None or not hold.is_out:
        return None
    refusals = sa.select(events.c.kind).where(
        events.c.recording_id == recording.id,
        events.c.kind.in_(["refused", Decision.DISCARDED, Decision.WITHDRAWN]),
    )
    latest = connection.scalar(refusals.order_by(events.c.id.desc()).limit(1))
    return None if latest == "refused" else hold


def discarded_reason(hold: Hold) -> str:
    """Who discarded it, when and why, as a sentence."""
    because = f", because: {hold.why}" if hold.why else ""
    return sentence(f"discarded on {hold.decided_at:%Y-%m-%d} by {hold.who}{because}")


def taking_back(hold: Hold) -> str:
    """How to change one's mind about what was discarded."""
    return (
        "Its raw file stays in the archive. To let it count after all: "
        f"`shm ingest --confirm {hold.recording_id} --why TEXT`."
    )


def end_hold(connection: Connection, recording_id: int, at: datetime) -> None:
    """Nobody need decide any more: the recording is done again."""
    row = _latest(connection, recording_id)
    if row is not None and row.decision is None:
        hold = replace(_hold(row), decision=Decision.REPLACED)
        _decide(connection, hold, "shm", "done again", at)


def _before(
    id_: sa.Column[int], stage: sa.Column[str], recording_id: int
) -> sa.ColumnElement[bool]:
    """Other rows that count or, of those received before, are held: never a copy made later."""
    held_before = (stage == Stage.HELD) & (id_ < recording_id)
    return (id_ != recording_id) & (stage.not_in([Stage.REFUSED, Stage.HELD]) | held_before)


def _latest(connection: Connection, recording_id: int) -> Row[Any] | None:
    query = _holds.where(holds.c.recording_id == recording_id)
    return connection.execute(query.order_by(holds.c.id.desc()).limit(1)).one_or_none()


def _undecided(connection: Connection, recording_id: int) -> Hold:
    row = _latest(connection, recording_id)
    if row is None or row.decision is not None:
        known = sa.select(recordings.c.id).where(recordings.c.id == recording_id)
        if connection.scalar(known) is None:
            raise NothingThere(f"no recording {recording_id}.", remedy="See `shm ingest --held`.")
        if row is None:
            raise UsageError(
                f"recording {recording_id} is not held.", remedy="See `shm ingest --held`."
            )
        raise UsageError(
            f"recording {recording_id} is not held: it was {row.decision} by {row.who}.",
            remedy=f"`shm ingest --discard {recording_id} --why TEXT` takes out what counts, "
            f"`shm ingest --confirm {recording_id} --why TEXT` takes back what was discarded.",
        )
    return _hold(row)


def _refuse_time(hold: Hold, time: datetime | None, at: datetime) -> None:
    if time is None:
        return
    if len(hold.tests) > 1:
        raise UsageError(
            f"recording {hold.recording_id} holds {len(hold.tests)} tests, one time is given.",
            remedy="Correct their times in the file, and drop that.",
        )
    if time > at:
        raise UsageError("that time is yet to come.", remedy="Give it as 2026-05-01T10:00:00Z.")


def _held(connection: Connection, recording_id: int) -> Sequence[Row[Any]]:
    own = (tests.c.recording_id == recording_id) & (tests.c.stage == Stage.HELD)
    query = sa.select(tests, recordings.c.received_at).join(recordings)
    return connection.execute(query.where(own, in_force(tests)).order_by(tests.c.id)).all()


def confirmed_values(
    connection: Connection, row: Row[Any], hold: Hold, time: datetime | None, who: str
) -> dict[str, Any]:
    """What changes of a test whose time is given, or certainly wrong."""
    doubts = {test.position: test.doubts for test in hold.tests}.get(row.position, ())
    if time is None and not any(doubt.time_unknown for doubt in doubts):
        return {}
    with decoding(tests, row, row.hanger):
        test = replace(test_from_document(loads(row.document), row.hanger), time=time)
        notes = loads(row.notes)
    return {
        "document": test_document(test),
        "taken_at": time,
        "time": time or row.received_at,
        "notes": [*notes, time_note(hold, time, who)],
    }


def time_note(hold: Hold, time: datetime | None, who: str) -> str:
    """Where the time of a confirmed test comes from."""
    given = "not known: that of its receipt counts" if time is None else "given"
    why = f": {hold.doubts[0].state}" if hold.doubts else ""
    return f"time {given}, confirmed by {who}{why}"


def _decide(connection: Connection, hold: Hold, who: str, why: str, at: datetime) -> Hold:
    """Notes a decision, and with it that the notice was seen to its end."""
    made = {"decision": hold.decision, "decided_at": at, "who": who, "why": why, "time": hold.time}
    connection.execute(sa.update(holds).where(holds.c.id == hold.id).values(**made))
    told = f"{hold.decision}" + (f": {why}" if why else "")
    key = notice_key(hold.hanger, hold.id)
    open_notice = (
        sa.select(alerts.c.id)
        .outerjoin(acknowledgements)
        .where(alerts.c.key == key, acknowledgements.c.id.is_(None))
    )
    alert_id = connection.scalar(open_notice)
    if alert_id is not None:
        insert(
            connection, acknowledgements, {"alert_id": alert_id, "who": who, "why": told, "at": at}
        )
    write_event(connection, at, str(hold.decision), hold.recording_id, hold.file_name, told)
    return replace(hold, decided_at=at, who=who, why=why)


def _hold(row: Row[Any]) -> Hold:
    with decoding(holds, row, row.hanger):
        return _whole_hold(row, loads(row.document))


def _whole_hold(row: Row[Any], document: Mapping[str, Any]) -> Hold:
    return Hold(
        id=row.id,
        recording_id=row.recording_id,
        file_name=row.file_name,
        hanger=row.hanger,
        held_at=row.held_at,
        message=document["message"],
        tests=held_tests_from(document),
        sidecar_as=document["sidecar_as"],
        decision=None if row.decision is None else Decision(row.decision),
        decided_at=row.decided_at,
        who=row.who or "",
        why=row.why or "",
        time=row.time,
    )
