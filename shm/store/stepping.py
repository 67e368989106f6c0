"""Each stage that was reached, as a row written with what brought it there."""

from __future__ import annotations

from datetime import datetime

import sqlalchemy as sa
from sqlalchemy.engine import Connection

import shm
from shm.store.database import Database
from shm.store.rows import Stage, Step
from shm.store.tables import steps, tests

ARCHIVED = "archived"
NOTIFIED = "notified"
STEPS = frozenset({*Stage, ARCHIVED, NOTIFIED})
"""Names of all steps that this version writes."""


class Stepping(Database):
    """The part of the store that tells how each result came about."""

    def steps(self, recording_id: int) -> tuple[Step, ...]:
        """The stages that a recording and its tests have reached, in that order."""
        query = (
            sa.select(steps, tests.c.name)
            .outerjoin(tests)
            .where(steps.c.recording_id == recording_id)
            .order_by(steps.c.id)
        )
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(Step(row.stage, row.at, row.version, row.test_id, row.name) for row in rows)


def write_step(
    connection: Connection, recording_id: int, stage: str, at: datetime, test_id: int | None = None
) -> None:
    """Notes, within the caller's transaction, that a recording or one of its tests came so far."""
    row = {"recording_id": recording_id, "test_id": test_id, "stage": stage, "at": at}
    connection.execute(sa.insert(steps).values(**row, version=shm.__version__))
