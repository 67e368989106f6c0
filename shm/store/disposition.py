"""Decide which tests count: a person accepts or excludes them, or has them done again.

Nothing is deleted: raw file, test and results stay, and each decision can be taken back. What is
done again is superseded and stays, with its lineage.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import UsageError, sentence
from shm.modes_document import test_document
from shm.store.alerts import acknowledge, raise_alert, resolve
from shm.store.blobs import pack, test_from_document, unpack
from shm.store.columns import loads, value_from, value_in
from shm.store.database import Repository, insert
from shm.store.files import (
    advance_recordings,
    begin_again,
    by_id,
    end_recording,
    end_tests,
    is_counted,
    is_current,
    move_numbers,
    reason_document,
)
from shm.store.journal import AGAIN, REFUSED, write
from shm.store.rows import (
    Decision,
    Ending,
    HeldTest,
    Hold,
    ReceivedFile,
    Rerun,
    Stage,
    StoredAlert,
    StoredRecording,
)
from shm.store.selects import WEIGHED
from shm.store.tables import (
    alerts,
    baselines,
    drifts,
    fingerprints,
    holds,
    journal,
    posterior_tests,
    posteriors,
    recordings,
    selection_entries,
    tests,
    watch_states,
    watches,
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
    held = {
        test.name: _mark(connection, recording.id, test.position, Stage.HELD, at)
        for test in judged.held
    }
    context = (recording.id, recording.file_name, recording.hanger, at)
    hold = Hold(0, *context, judged.notice.message, judged.held, judged.sidecar_as)
    hold_id = insert_hold(connection, hold)
    reason = _reason(recording, judged.notice.message, at)
    by_id = recordings.c.id == recording.id
    connection.execute(sa.update(recordings).where(by_id).values(reason=reason))
    notice = replace(judged.notice, key=notice_key(judged.notice.hanger, hold_id))
    leading = held[notice.test]
    return raise_alert(connection, leading, None, notice, judged.hooks, at)


def insert_hold(connection: Connection, hold: Hold) -> int:
    """Store what is held, or a decision of what was not; return its number."""
    document = asdict(_Held(hold.message, hold.tests, hold.sidecar_as))
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


def _mark(
    connection: Connection, recording_id: int, position: int, stage: Stage, at: datetime
) -> int:
    """Brings the test at a place of a file to a stage; its number."""
    of_recording = (tests.c.recording_id == recording_id) & is_current(tests)
    here = of_recording & (tests.c.position == position)
    number: int = connection.scalars(sa.select(tests.c.id).where(here)).one()
    connection.execute(sa.update(tests).where(here).values(stage=stage))
    write(connection, at, stage, recording_id, number)
    return number


def _reason(recording: Row[Any], message: str, at: datetime, remedy: str = "") -> dict[str, Any]:
    """Return why a recording is held, or counts no more."""
    return reason_document(recording.file_name, recording.sha256, message, remedy, at)


def holds_of(connection: Connection, recording_id: int) -> tuple[Hold, ...]:
    """All holds of a recording and decisions on it, the oldest first."""
    query = stored_holds.where(holds.c.recording_id == recording_id).order_by(holds.c.id)
    return tuple(hold_from(row) for row in connection.execute(query))


def latest_hold(connection: Connection, recording_id: int) -> Hold | None:
    """Return why a recording is or was last held, and what a person made of it."""
    query = stored_holds.where(holds.c.recording_id == recording_id)
    row = connection.execute(query.order_by(holds.c.id.desc()).limit(1)).one_or_none()
    return None if row is None else hold_from(row)


def standing_discard(connection: Connection, recording: Row[Any]) -> Hold | None:
    """The decision by which a recording is out; None where it counts, or was refused since."""
    if recording.stage != Stage.REFUSED:
        return None
    hold = latest_hold(connection, recording.id)
    if hold is None or not hold.is_out:
        return None
    return None if connection.scalar(sa.select(last_refusal(recording.id))) == REFUSED else hold


def last_refusal(recording_id: Any) -> sa.ScalarSelect[Any]:
    """Select the last entry by which a recording is out: a refusal, or a person's decision."""
    refusals = sa.select(journal.c.kind).where(
        journal.c.recording_id == recording_id,
        journal.c.subject != "",
        journal.c.kind.in_([REFUSED, Decision.DISCARDED, Decision.WITHDRAWN]),
    )
    return refusals.order_by(journal.c.id.desc()).limit(1).scalar_subquery()


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
    hold = latest_hold(connection, recording_id)
    if hold is not None and hold.decision is None:
        hold = replace(hold, decision=Decision.REPLACED)
        _decide(connection, hold, "shm", "done again", at)


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


def time_note(hold: Hold, time: datetime | None, who: str) -> str:
    """Return where the time of a confirmed test comes from."""
    given = "not known: that of its receipt counts" if time is None else "given"
    why = f": {hold.doubts[0].state}" if hold.doubts else ""
    return f"time {given}, confirmed by {who}{why}"


def _decide(connection: Connection, hold: Hold, who: str, why: str, at: datetime) -> Hold:
    """Store a decision: of a hold, whose notice ends with it, or of what was never held."""
    names = ", ".join(test.name for test in hold.tests)
    if not hold.id:
        message = sentence(f"{hold.decision} by {who}: {names}" + (f": {why}" if why else ""))
        hold = replace(hold, message=message, held_at=at)
        hold = replace(hold, id=insert_hold(connection, hold))
    made = {"decision": hold.decision, "decided_at": at, "who": who, "why": why, "time": hold.time}
    connection.execute(sa.update(holds).where(holds.c.id == hold.id).values(**made))
    text = f"{hold.decision}" + (f": {why}" if why else "")
    key = notice_key(hold.hanger, hold.id)
    notice = connection.scalar(sa.select(alerts.c.id).where(alerts.c.key == key))
    if notice is not None:
        acknowledge(connection, notice, who, text, at)
        resolve(connection, notice, who, text, at)
    detail = why
    if hold.decision in (Decision.WITHDRAWN, Decision.REINSTATED):
        detail = f"{names}: {why}" if why else names
    subject, about = hold.file_name, hold.recording_id
    write(connection, at, str(hold.decision), about, None, subject, detail, who)
    return replace(hold, decided_at=at, who=who, why=why)


def hold_from(row: Row[Any]) -> Hold:
    """Return a row of `stored_holds` as a value."""
    return value_in(row, Hold, **vars(value_from(_Held, row.document)))


@dataclass(frozen=True)
class _Held:
    """The document of a hold."""

    message: str
    tests: tuple[HeldTest, ...]
    sidecar_as: str | None = None


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
    _supersede(connection, tests, tests.c.id.in_(ids), at)
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


def reopen(connection: Connection, recording_id: int, file: ReceivedFile, at: datetime) -> None:
    """A refused file starts anew; results it had before the refusal stay in force."""
    refused = (tests.c.recording_id == recording_id) & (tests.c.stage == Stage.REFUSED)
    _supersede(connection, tests, refused, at)
    connection.execute(
        sa.update(recordings).where(recordings.c.id == recording_id).values(**vars(file))
    )
    begin_again(connection, recording_id, at)


def redescribe(connection: Connection, known: Row[Any], file: ReceivedFile, at: datetime) -> str:
    """Do a recording again with another sidecar; return what that replaces.

    `known` is its row as it was.
    """
    rows = _chosen(connection, known.id, sa.true())
    baseline_ids = of_baselines(connection, rows)
    of_baseline = sorted(row.name for row in rows if row.id in baseline_ids)
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
        of_tests = sa.select(posterior_tests.c.posterior_id).where(
            posterior_tests.c.test_id.in_(ids)
        )
        lasting = sa.union(
            sa.select(baselines.c.posterior_id), sa.select(selection_entries.c.posterior_id)
        )
        theirs = posteriors.c.id.in_(of_tests) & posteriors.c.id.not_in(lasting)
        updated = _supersede(connection, posteriors, theirs, at)
    _supersede(connection, drifts, drifts.c.test_id.in_(ids), at)
    return updated, _supersede(connection, watches, watches.c.test_id.in_(ids), at)


def _sent_back(
    connection: Connection, recording: Row[Any], stage: Stage, test: str | None
) -> Sequence[Row[Any]]:
    """Return the tests that are sent back: those of a whole file, or the one that is named."""
    one = None if stage is Stage.IDENTIFIED else test
    rows = _chosen(connection, recording.id, sa.true(), one)
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


def _supersede(
    connection: Connection, table: sa.Table, which: sa.ColumnElement[bool], at: datetime
) -> int:
    found = sa.update(table).where(which, is_current(table)).values(superseded_at=at)
    return connection.execute(found).rowcount


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
            statement = sa.update(recordings).where(recordings.c.id == recording_id)
            if hold is None:
                hold, rows = _excluded(connection, recording, time, test)
                statement = statement.where(recordings.c.stage == Stage.REFUSED).values(
                    stage=Stage.RECEIVED
                )
            else:
                hold = replace(hold, decision=Decision.CONFIRMED, time=time)
            refuse_time(hold, time, at)
            hold = _decide(connection, hold, who, why, at)
            _let_count(connection, rows, hold, who, at)
            connection.execute(statement.values(reason=None))
            advance_recordings(connection, [recording_id], at)
            if hold.decision is Decision.REINSTATED:
                _watch_again(connection, rows, at)
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
            ids = [row.id for row in rows]
            baseline_ids = of_baselines(connection, rows)
            end_tests(connection, recording_id, ids, at)
            supersede_results(connection, ids, Stage.IDENTIFIED, at)
            text = f"test discarded by {who}" + (f": {why}" if why else "")
            raised = sa.select(alerts.c.id).where(alerts.c.test_id.in_(ids))
            for alert_id in connection.scalars(raised).all():
                resolve(connection, alert_id, who, text, at, Ending.TEST_DISCARDED)
            again = _watch_again(connection, rows, at)
            named = [HeldTest(row.position, row.name, ()) for row in rows]
            hold = _unheld(recording, Decision.WITHDRAWN, named)
            hold = _decide(connection, hold, who, why, at)
            _end_or_advance(connection, recording, hold, at)
            names = tuple(sorted(row.name for row in rows if row.id in baseline_ids))
            return Exclusion(hold, names, min(row.time for row in rows), again)

    def rerun(
        self, recording_id: int, from_stage: Stage, at: datetime, test: str | None = None
    ) -> Rerun:
        """Send a recording back so that a stage is reached anew; what came of it is superseded.

        A file is always identified as a whole; from a later stage on it may be one `test` alone.
        Raises NothingThere, and UsageError where the recording has not come so far.
        """
        with self.writing() as connection:
            recording = by_id(connection, recording_id)
            out = standing_discard(connection, recording)
            if out is not None and not _chosen(connection, recording_id, is_counted(tests)):
                text = f"{recording.file_name} was {discarded_reason(out)}"
                raise UsageError(text, remedy=taking_back(out))
            chosen = _sent_back(connection, recording, from_stage, test)
            baseline_ids = of_baselines(connection, chosen)
            if from_stage is not Stage.IDENTIFIED:
                reopened = sa.update(recordings).where(recordings.c.id == recording_id)
                connection.execute(reopened.values(stage=_BEFORE[from_stage], reason=None))
            superseded = rerun(connection, chosen, from_stage, at)
            if not chosen:  # it was refused before it was identified
                begin_again(connection, recording_id, at)
            text, name = f"sent back by request, to be {from_stage} again.", recording.file_name
            write(connection, at, AGAIN, recording_id, subject=name, detail=text, who="")
            stored = value_in(by_id(connection, recording_id), StoredRecording)
            of_baseline = tuple(row.name for row in chosen if row.id in baseline_ids)
            return Rerun(stored, tuple(row.name for row in chosen), *superseded, of_baseline)


def _held(
    connection: Connection, recording_id: int, test: str | None
) -> tuple[Hold | None, Sequence[Row[Any]]]:
    """Return the hold that waits for a decision and its tests, unless `test` is none of them."""
    hold = latest_hold(connection, recording_id)
    if hold is None or hold.decision is not None:
        return None, ()
    rows = _chosen(connection, recording_id, tests.c.stage == Stage.HELD)
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
    """Bring tests of one recording to identified, at the time that a person gave.

    Without one, a test whose time is certainly wrong counts from its receipt.
    """
    doubts = {test.position: test.doubts for test in hold.tests}
    for row in rows:
        values: dict[str, Any] = {"stage": Stage.IDENTIFIED}
        if hold.time or any(each.time_unknown for each in doubts.get(row.position, ())):
            test = replace(test_from_document(loads(row.document), row.hanger), time=hold.time)
            values |= {
                "document": test_document(test),
                "taken_at": hold.time,
                "time": hold.time or row.received_at,
                "notes": (*row.notes, time_note(hold, hold.time, who)),
            }
        connection.execute(sa.update(tests).where(tests.c.id == row.id).values(**values))
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
    connection: Connection,
    recording_id: int,
    which: sa.ColumnElement[bool],
    test: str | None = None,
) -> Sequence[Row[Any]]:
    """Return tests in force of a recording, or the one of a name, with the time of receipt."""
    query = sa.select(tests, recordings.c.received_at).join(recordings)
    query = query.where(tests.c.recording_id == recording_id, is_current(tests), which)
    if test is not None:
        query = query.where(tests.c.name == test)
    return connection.execute(query.order_by(tests.c.id)).all()


def _end_or_advance(connection: Connection, recording: Row[Any], hold: Hold, at: datetime) -> None:
    """End a recording of which a decision left no test; else move it on without that test."""
    if _chosen(connection, recording.id, tests.c.stage != Stage.REFUSED):
        still_held = sa.update(recordings).where(
            recordings.c.id == recording.id, recordings.c.stage == Stage.HELD
        )
        connection.execute(still_held.values(reason=None))
        advance_recordings(connection, [recording.id], at)
    else:
        reason = _reason(recording, discarded_reason(hold), at, taking_back(hold))
        end_recording(connection, recording.id, reason, at)


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


def _watch_again(connection: Connection, chosen: Sequence[Row[Any]], at: datetime) -> int:
    """Sends the later tests of the hangers back, to be watched with what counts now.

    To be updated, where they learnt from a tension that was read. How many that are.
    """
    ids, count = [row.id for row in chosen], 0
    weighed = connection.execute(sa.select(tests.c.id).where(tests.c.id.in_(ids), WEIGHED)).first()
    stage = Stage.WATCHED if weighed is None else Stage.UPDATED
    for hanger in {row.hanger for row in chosen}:
        since = min(row.time for row in chosen if row.hanger == hanger)
        later = (watches.c.time >= since) & tests.c.id.not_in(ids)
        count += rerun_watched(connection, hanger, later, stage, at)
    return count
