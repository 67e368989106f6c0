"""Rows of received files, their steps and events, and how far their tests have come.

Within the caller's transaction.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import PurePath
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.modes_document import test_document
from shm.store.archive import suffix_of
from shm.store.blobs import pack_response
from shm.store.journal import RENAMED, write
from shm.store.rows import IdentifiedTest, Stage, StoredTest
from shm.store.tables import journal, recordings, tests


def by_id(connection: Connection, recording_id: int) -> Row[Any]:
    query = sa.select(recordings).where(recordings.c.id == recording_id)
    row = connection.execute(query).one_or_none()
    if row is None:
        raise NothingThere(f"no recording {recording_id}.", remedy="See `shm status`.")
    return row


def by_checksum(connection: Connection, sha256: str) -> Row[Any] | None:
    query = sa.select(recordings).where(recordings.c.sha256 == sha256)
    return connection.execute(query).one_or_none()


def is_counted(table: sa.Table) -> sa.ColumnElement[bool]:
    """Select what is neither refused nor held: all that is shown and computed with."""
    return table.c.stage.not_in([Stage.REFUSED, Stage.HELD])


def is_current(table: sa.Table) -> sa.ColumnElement[bool]:
    """Select what no later run has replaced."""
    return table.c.superseded_at.is_(None)


def begin_again(connection: Connection, recording_id: int, at: datetime) -> None:
    """A recording waits to be identified as if it had just come in."""
    statement = sa.update(recordings).where(recordings.c.id == recording_id)
    connection.execute(statement.values(stage=Stage.RECEIVED, reason=None))
    write(connection, at, Stage.RECEIVED, recording_id)


def end_recording(
    connection: Connection,
    recording_id: int,
    reason: Mapping[str, Any],
    at: datetime,
    subject: str = "",
) -> None:
    """A recording is refused, with a reason; of a file with a fault `subject` is its name."""
    statement = sa.update(recordings).where(recordings.c.id == recording_id)
    connection.execute(statement.values(stage=Stage.REFUSED, reason=dict(reason)))
    detail = str(reason.get("message", "")) if subject else ""
    write(connection, at, Stage.REFUSED, recording_id, subject=subject, detail=detail)


def reason_document(
    file_name: str, sha256: str | None, message: str, remedy: str, at: datetime
) -> dict[str, Any]:
    """Return why a file is held or refused, no `line` and no `channel` of it being at fault."""
    return {
        "schema": "shm.reason/1",
        "file": file_name,
        "line": None,
        "channel": None,
        "message": message,
        "remedy": remedy,
        "time": at,
        "sha256": sha256,
    }


def end_tests(
    connection: Connection, recording_id: int, test_ids: Collection[int], at: datetime
) -> None:
    """Tests of a recording are refused."""
    chosen = sa.update(tests).where(tests.c.id.in_(test_ids))
    connection.execute(chosen.values(stage=Stage.REFUSED))
    for test_id in test_ids:
        write(connection, at, Stage.REFUSED, recording_id, test_id)


def note_name(connection: Connection, known: Row[Any], file_name: str, at: datetime) -> None:
    """Keeps the former name of a file that comes again under another: it is found by both."""
    if known.file_name != file_name:
        text = f"called {file_name} from now on."
        write(connection, at, RENAMED, known.id, subject=known.file_name, detail=text)


def by_former_names(connection: Connection, which: str) -> list[int]:
    """Recordings with a test that was called so once, or a file that came under that name."""
    superseded = sa.select(tests.c.recording_id).where(tests.c.name == which)
    found = set(connection.scalars(superseded))
    files = sa.select(recordings.c.id, recordings.c.file_name).union(
        sa.select(journal.c.recording_id, journal.c.subject).where(
            journal.c.recording_id.is_not(None), journal.c.subject != ""
        )
    )
    rows = files.subquery()
    query = sa.select(rows).where(rows.c.file_name.contains(which, autoescape=True))
    found |= {id_ for id_, name in connection.execute(query) if which in _called(name)}
    return sorted(found)


def _called(file_name: str) -> set[str]:
    """A file's name with its folder and suffix, and without either."""
    whole, last = file_name, PurePath(file_name).name
    return {name[: len(name) - cut] for name in (whole, last) for cut in (0, len(suffix_of(name)))}


_PROGRESS = (Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)


def all_at(connection: Connection, chosen: Iterable[StoredTest], stage: Stage) -> bool:
    """Return True if tests are in force and still at a stage.

    Another process may have been first.
    """
    query = sa.select(tests.c.stage, tests.c.superseded_at).where(
        tests.c.id.in_([test.id for test in chosen])
    )
    rows = connection.execute(query).all()
    return all(row.stage == stage and row.superseded_at is None for row in rows)


def move(connection: Connection, chosen: Iterable[StoredTest], stage: Stage, at: datetime) -> None:
    """Brings tests to a stage, and their recordings along."""
    move_numbers(connection, {test.id: test.recording_id for test in chosen}, stage, at)


def move_numbers(
    connection: Connection, chosen: Mapping[int, int], stage: Stage, at: datetime
) -> None:
    """The same of tests by their numbers, each with that of its recording."""
    connection.execute(sa.update(tests).where(tests.c.id.in_(list(chosen))).values(stage=stage))
    for test_id, recording_id in chosen.items():
        write(connection, at, stage, recording_id, test_id)
    advance_recordings(connection, sorted(set(chosen.values())), at)


def advance_recordings(connection: Connection, ids: Collection[int], at: datetime) -> None:
    """A recording stands where the least advanced of its tests stands, and is held with one."""
    for recording_id in ids:
        query = sa.select(tests.c.stage).where(
            tests.c.recording_id == recording_id, is_current(tests), tests.c.stage != Stage.REFUSED
        )
        stages = connection.scalars(query).all()
        stage = Stage.HELD if Stage.HELD in stages else min(stages, key=_PROGRESS.index)
        stage = Stage.DONE if stage is Stage.WATCHED else stage
        moved = connection.execute(
            sa.update(recordings)
            .where(recordings.c.id == recording_id)
            .where(recordings.c.stage.not_in([Stage.REFUSED, stage]))
            .values(stage=stage)
        )
        if moved.rowcount:
            subject, why = _why_held(connection, recording_id) if stage is Stage.HELD else ("", "")
            write(connection, at, stage, recording_id, subject=subject, detail=why)


def _why_held(connection: Connection, recording_id: int) -> tuple[str, str]:
    row = by_id(connection, recording_id)
    return row.file_name, row.reason["message"]


def test_contents(item: IdentifiedTest, name: str) -> dict[str, Any]:
    """Return the result of an identification, by column."""
    response = item.frequency_response
    return {
        "hanger": item.test.hanger,
        "document": test_document(replace(item.test, id=name)),
        "frequency_response": None if response is None else pack_response(response),
        "notes": item.notes,
        "quality": item.quality,
        "set_aside": item.set_aside,
        "taken_at": item.test.time,
        "temperature_c": item.test.temperature_c,
    }
