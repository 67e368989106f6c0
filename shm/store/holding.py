"""Rows of what is held and of what people decide of it, within the caller's transaction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import value_of
from shm.errors import UsageError, sentence
from shm.modes_document import test_document
from shm.store.blobs import pack, test_from_document, unpack
from shm.store.columns import loads
from shm.store.database import insert
from shm.store.files import is_current, reason_document
from shm.store.journal import REFUSED, write
from shm.store.mapping import value_in
from shm.store.outbox import acknowledge, raise_alert, resolve
from shm.store.rows import Decision, HeldTest, Hold, Stage, StoredAlert
from shm.store.tables import (
    alerts,
    fingerprints,
    holds,
    journal,
    recordings,
    tests,
)
from shm.values import Alert, Fingerprint

stored_holds = sa.select(holds, recordings.c.file_name, recordings.c.hanger).join(recordings)


@dataclass(frozen=True, eq=False)
class Judgement:
    """Judgement of plausibility on a recording with the sidecar that it was judged with.

    `held` are its tests that are held, `notice` what to tell of that; None where none is.
    `fingerprint` is that of its samples, None where it has none. `out` are the places in the file
    of tests that a person has discarded with this sidecar: they stay so.
    """

    sidecar_as: str | None
    fingerprint: Fingerprint | None = None
    held: tuple[HeldTest, ...] = ()
    notice: Alert | None = None
    hooks: Sequence[str] = ()
    out: tuple[int, ...] = ()


def keep_judgement(
    connection: Connection, recording: Row[Any], judged: Judgement, at: datetime
) -> StoredAlert | None:
    """Holds what is in doubt; the notice of that, None where nothing is."""
    if judged.fingerprint is not None:
        _keep_fingerprint(connection, recording.id, judged.fingerprint)
    for position in judged.out:
        _mark(connection, recording.id, position, Stage.REFUSED, at)
    if judged.notice is None:
        return None
    held = _hold_tests(connection, recording.id, judged.held, at)
    own = (recording.id, recording.file_name, recording.hanger, at)
    hold = Hold(0, *own, judged.notice.message, judged.held, judged.sidecar_as)
    hold_id = insert_hold(connection, hold)
    reason = reason_of(recording, judged.notice.message, at)
    by_id = recordings.c.id == recording.id
    connection.execute(sa.update(recordings).where(by_id).values(reason=reason))
    notice = replace(judged.notice, key=notice_key(judged.notice.hanger, hold_id))
    leading = held[notice.test]
    return raise_alert(connection, leading, None, notice, judged.hooks, at)


def insert_hold(connection: Connection, hold: Hold) -> int:
    """Store what is held, or a decision of what was not; return its number."""
    tests = [asdict(test) for test in hold.tests]
    document = {"message": hold.message, "sidecar_as": hold.sidecar_as, "tests": tests}
    row = {"recording_id": hold.recording_id, "held_at": hold.held_at, "document": document}
    return insert(connection, holds, row)


def notice_key(hanger: int, hold_id: int) -> str:
    """The key of the notice of a hold: once for each time that a recording is held."""
    return f"hanger-{hanger}:held-{hold_id}"


_ARRAYS = ("shapes", "marks")
"""Of a fingerprint, in the order of its fields."""


def fingerprint_from(row: Row[Any]) -> Fingerprint:
    """Return the stored fingerprint; older ones lack marks, or have arrays that nothing reads."""
    arrays = unpack(row.shapes)
    return Fingerprint(row.digest, **{name: arrays[name] for name in _ARRAYS if name in arrays})


def _keep_fingerprint(connection: Connection, recording_id: int, found: Fingerprint) -> None:
    former = fingerprints.c.recording_id == recording_id
    connection.execute(sa.delete(fingerprints).where(former))
    shapes = pack(**{name: getattr(found, name) for name in _ARRAYS})
    row = {"recording_id": recording_id, "digest": found.digest, "shapes": shapes}
    connection.execute(sa.insert(fingerprints).values(row))


def _hold_tests(
    connection: Connection, recording_id: int, held: Sequence[HeldTest], at: datetime
) -> dict[str, int]:
    """Marks the tests that are held; their numbers by the name that they came with."""
    return {
        test.name: _mark(connection, recording_id, test.position, Stage.HELD, at) for test in held
    }


def _mark(
    connection: Connection, recording_id: int, position: int, stage: Stage, at: datetime
) -> int:
    """Brings the test at a place of a file to a stage; its number."""
    own = (tests.c.recording_id == recording_id) & is_current(tests)
    here = own & (tests.c.position == position)
    number: int = connection.scalars(sa.select(tests.c.id).where(here)).one()
    connection.execute(sa.update(tests).where(here).values(stage=stage))
    write(connection, at, stage, recording_id, number)
    return number


def reason_of(recording: Row[Any], message: str, at: datetime, remedy: str = "") -> dict[str, Any]:
    """Return why a recording is held, or counts no more."""
    return reason_document(recording.file_name, recording.sha256, message, remedy, at)


def holds_of(connection: Connection, recording_id: int) -> tuple[Hold, ...]:
    """All holds of a recording and decisions on it, the oldest first."""
    query = stored_holds.where(holds.c.recording_id == recording_id).order_by(holds.c.id)
    return tuple(hold_from(row) for row in connection.execute(query))


def latest_hold(connection: Connection, recording_id: int) -> Hold | None:
    """Return why a recording is or was last held, and what a person made of it."""
    row = _latest(connection, recording_id)
    return None if row is None else hold_from(row)


def _latest(connection: Connection, recording_id: int) -> Row[Any] | None:
    query = stored_holds.where(holds.c.recording_id == recording_id)
    return connection.execute(query.order_by(holds.c.id.desc()).limit(1)).one_or_none()


def standing_discard(connection: Connection, recording: Row[Any]) -> Hold | None:
    """The decision by which a recording is out; None where it counts, or was refused since."""
    if recording.stage != Stage.REFUSED:
        return None
    row = _latest(connection, recording.id)
    hold = None if row is None else hold_from(row)
    if hold is None or not hold.is_out:
        return None
    refusals = sa.select(journal.c.kind).where(
        journal.c.recording_id == recording.id,
        journal.c.subject != "",
        journal.c.kind.in_([REFUSED, Decision.DISCARDED, Decision.WITHDRAWN]),
    )
    latest = connection.scalar(refusals.order_by(journal.c.id.desc()).limit(1))
    return None if latest == REFUSED else hold


def discarded_reason(hold: Hold) -> str:
    """Return who discarded it, when and why, as a sentence."""
    because = f", because: {hold.why}" if hold.why else ""
    return sentence(f"discarded on {hold.decided_at:%Y-%m-%d} by {hold.who}{because}")


def taking_back(hold: Hold) -> str:
    """Return how to change one's mind about what was discarded."""
    return (
        "Its raw file stays in the archive. To let it count after all: "
        f"`shm ingest --confirm {hold.recording_id} --why TEXT`."
    )


def end_hold(connection: Connection, recording_id: int, at: datetime) -> None:
    """Nobody need decide any more: the recording is done again."""
    row = _latest(connection, recording_id)
    if row is not None and row.decision is None:
        hold = replace(hold_from(row), decision=Decision.REPLACED)
        decide(connection, hold, "shm", "done again", at)


def refuse_time(hold: Hold, time: datetime | None, at: datetime) -> None:
    """Raises UsageError where the time that a person gives a held test cannot be right."""
    if time is None:
        return
    if len(hold.tests) > 1:
        raise UsageError(
            f"recording {hold.recording_id} holds {len(hold.tests)} tests, one time is given.",
            remedy="Correct their times in the file, and drop that.",
        )
    if time > at:
        raise UsageError("that time is yet to come.", remedy="Give it as 2026-05-01T10:00:00Z.")


def held_rows(connection: Connection, recording_id: int) -> Sequence[Row[Any]]:
    """The tests of a recording that are held, each with the time of its receipt."""
    own = (tests.c.recording_id == recording_id) & (tests.c.stage == Stage.HELD)
    query = sa.select(tests, recordings.c.received_at).join(recordings)
    return connection.execute(query.where(own, is_current(tests)).order_by(tests.c.id)).all()


def confirmed_values(
    connection: Connection, row: Row[Any], hold: Hold, time: datetime | None, who: str
) -> dict[str, Any]:
    """Return the changed columns of a test whose time is given, or certainly wrong."""
    doubts = {test.position: test.doubts for test in hold.tests}.get(row.position, ())
    if time is None and not any(doubt.time_unknown for doubt in doubts):
        return {}
    test = replace(test_from_document(loads(row.document), row.hanger), time=time)
    return {
        "document": test_document(test),
        "taken_at": time,
        "time": time or row.received_at,
        "notes": (*row.notes, time_note(hold, time, who)),
    }


def time_note(hold: Hold, time: datetime | None, who: str) -> str:
    """Return where the time of a confirmed test comes from."""
    given = "not known: that of its receipt counts" if time is None else "given"
    why = f": {hold.doubts[0].state}" if hold.doubts else ""
    return f"time {given}, confirmed by {who}{why}"


def decide(connection: Connection, hold: Hold, who: str, why: str, at: datetime) -> Hold:
    """Notes a decision, and with it that the notice was seen to its end."""
    made = {"decision": hold.decision, "decided_at": at, "who": who, "why": why, "time": hold.time}
    connection.execute(sa.update(holds).where(holds.c.id == hold.id).values(**made))
    text = f"{hold.decision}" + (f": {why}" if why else "")
    key = notice_key(hold.hanger, hold.id)
    notice = connection.scalar(sa.select(alerts.c.id).where(alerts.c.key == key))
    if notice is not None:
        acknowledge(connection, notice, who, text, at)
        resolve(connection, notice, who, text, at)
    if hold.decision in (Decision.WITHDRAWN, Decision.REINSTATED):
        names = ", ".join(test.name for test in hold.tests)
        text = f"{names}: {why}" if why else names
    else:
        text = why
    subject, about = hold.file_name, hold.recording_id
    write(connection, at, str(hold.decision), about, None, subject, text, who)
    return replace(hold, decided_at=at, who=who, why=why)


def hold_from(row: Row[Any]) -> Hold:
    """Return a row of `stored_holds` as a value."""
    document = loads(row.document)
    known = {name: document[name] for name in ("message", "sidecar_as")}
    return value_in(row, Hold, tests=value_of(tuple[HeldTest, ...], document["tests"]), **known)
