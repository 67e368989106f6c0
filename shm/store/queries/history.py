"""Read what happened: steps and events of a recording, changes by people, former results."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import sqlalchemy as sa

from shm.store.database import Repository
from shm.store.journal import ACTIONS, is_event, is_step
from shm.store.mapping import value_in
from shm.store.rows import (
    AuditRow,
    Decision,
    Event,
    FormerPosterior,
    FormerTest,
    Outcome,
    Stage,
    Step,
)
from shm.store.tables import journal, posterior_tests, posteriors, tests

_LINEAGE = ("input_sha256", "settings_sha256", "version")


_WITHOUT_SAMPLES = ("id", "model", "updated_at", "superseded_at")


def find_newest_entry(store: Repository) -> int:
    """Return the number of the last entry, 0 where there is none: it changes with results."""
    return store.scalar(sa.select(sa.func.max(journal.c.id))) or 0


def list_changes(
    store: Repository, limit: int | None = None, before: int | None = None
) -> tuple[AuditRow, ...]:
    """Return what people changed, the newest first; `before` is the number to go on after."""
    query = sa.select(journal).where(journal.c.who.is_not(None)).order_by(journal.c.id.desc())
    if before is not None:
        query = query.where(journal.c.id < before)
    return tuple(map(_change, store.rows(query.limit(limit))))


def list_events(
    store: Repository,
    kind: str | None = None,
    *,
    recording_id: int | None = None,
    file_name: str | None = None,
) -> tuple[Event, ...]:
    """Return what was noticed of recordings, the oldest first; `kind` as duplicate or refused.

    Of one recording, or of what came under one name, where that is given.
    """
    query = sa.select(journal).where(is_event).order_by(journal.c.id)
    wanted = {"kind": kind, "recording_id": recording_id, "subject": file_name}
    for name, value in wanted.items():
        if value is not None:
            query = query.where(journal.c[name] == value)
    return tuple(map(_event, store.rows(query)))


def list_steps(store: Repository, recording_id: int) -> tuple[Step, ...]:
    """Return the stages that a recording and its tests have reached, in that order."""
    query = sa.select(journal, tests.c.name).outerjoin(tests, tests.c.id == journal.c.test_id)
    query = query.where(is_step, journal.c.recording_id == recording_id)
    return tuple(
        Step(row.kind, row.at, row.version, row.test_id, row.name)
        for row in store.rows(query.order_by(journal.c.id))
    )


def list_former_tests(store: Repository, recording_id: int) -> tuple[FormerTest, ...]:
    """List every identification of a recording's tests with its posteriors, oldest first."""
    own = (column for column in tests.c if column is not tests.c.frequency_response)
    found = sa.select(*own).where(tests.c.recording_id == recording_id).order_by(tests.c.id)
    columns = [posteriors.c[name] for name in (*_WITHOUT_SAMPLES, *_LINEAGE)]
    made: sa.Select[Any] = (
        sa.select(posterior_tests.c.test_id, *columns)
        .select_from(posterior_tests.join(posteriors).join(tests))
        .where(tests.c.recording_id == recording_id)
        .order_by(posteriors.c.id)
    )
    with store.reading() as connection:
        rows = connection.execute(found).all()
        by_test: defaultdict[int, list[FormerPosterior]] = defaultdict(list)
        for row in connection.execute(made):
            by_test[row.test_id].append(value_in(row, FormerPosterior))
    return tuple(value_in(row, FormerTest, posteriors=tuple(by_test[row.id])) for row in rows)


def _change(row: sa.Row[Any]) -> AuditRow:
    detail = row.detail
    if row.kind in (Stage.RECEIVED, *Outcome):
        detail = str(Outcome.NEW) if row.kind == Stage.RECEIVED else row.kind
    action = ACTIONS.get(row.kind, row.kind)
    return AuditRow(row.id, row.at, row.who, row.via or "", action, row.subject, detail)


def _event(row: sa.Row[Any]) -> Event:
    message = row.detail
    if row.kind in (*Decision,) and row.who:
        message = f"{row.kind} by {row.who}" + (f": {row.detail}" if row.detail else "")
    return Event(row.at, row.kind, row.subject, message, row.recording_id)
