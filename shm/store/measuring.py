"""Counts and durations of the flow, for those who watch over the daemon."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from datetime import datetime

import sqlalchemy as sa

from shm.store.database import Database
from shm.store.files import counts, in_force
from shm.store.rows import OTHER, DeliveryState, Stage, counts_by_name
from shm.store.stepping import STEPS
from shm.store.tables import acknowledgements, alerts, deliveries, recordings, steps, tests

ON_THE_WAY = (Stage.RECEIVED, Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)
"""Where recordings stand that are not through."""


@dataclass(frozen=True)
class Standing:
    """A recording that is not through: how far it has come, and since when it is there."""

    id: int
    file_name: str
    stage: Stage
    hanger: int | None
    since: datetime


@dataclass(frozen=True)
class LatestTest:
    """The number of a hanger's tests and the time of the latest."""

    tests: int
    time: datetime


class Measuring(Database):
    """The part of the store that says how the flow is doing."""

    def oldest_waiting(self) -> datetime | None:
        """When the oldest recording came in that is not through yet; None where all are."""
        query = sa.select(recordings.c.received_at).where(recordings.c.stage.in_(ON_THE_WAY))
        with self.reading() as connection:
            row = connection.execute(query.order_by(recordings.c.id).limit(1)).first()
        return None if row is None else row.received_at

    def newest_row_at(self) -> datetime | None:
        """When the newest stage was reached, by the clock of then; None in an empty store."""
        with self.reading() as connection:
            found: datetime | None = connection.scalar(sa.select(sa.func.max(steps.c.at)))
        return found

    def standing(self) -> tuple[Standing, ...]:
        """The recordings that are not through, and since when each stands where it stands."""
        reached = sa.func.max(steps.c.at).label("reached_at")
        query = (
            sa.select(recordings, reached)
            .outerjoin(steps, steps.c.recording_id == recordings.c.id)
            .where(recordings.c.stage.in_(ON_THE_WAY))
            .group_by(recordings.c.id)
            .order_by(recordings.c.id)
        )
        with self.reading() as connection:
            rows = connection.execute(query).all()
        return tuple(
            Standing(
                row.id,
                row.file_name,
                Stage(row.stage),
                row.hanger,
                row.reached_at or row.received_at,
            )
            for row in rows
        )

    def latest_tests(self) -> dict[int, LatestTest]:
        """How many tests in force each hanger has, and when the latest was taken."""
        shown = counts(tests) & in_force(tests)
        counted = (tests.c.hanger, sa.func.count().label("tests"), sa.func.max(tests.c.time))
        with self.reading() as connection:
            rows = connection.execute(sa.select(*counted).where(shown).group_by(tests.c.hanger))
            return {row[0]: LatestTest(int(row[1]), row[2]) for row in rows}

    def alert_counts(self) -> tuple[int, int]:
        """How many alerts are open, and how many were acknowledged."""
        with self.reading() as connection:
            raised = _count(connection, alerts)
            noted = _count(connection, acknowledgements)
        return raised - noted, noted

    def delivery_counts(self) -> dict[str, int]:
        """How many deliveries stand in each state; see `counts_by_name`."""
        query = sa.select(deliveries.c.state, sa.func.count()).group_by(deliveries.c.state)
        with self.reading() as connection:
            return counts_by_name(DeliveryState, connection.execute(query))

    def stage_seconds(self, since: datetime) -> dict[str, list[float]]:
        """How long after the stage before each step was reached, of steps made since then.

        By the name of the step, which need be no `Stage`; a name that this version does not know
        is `OTHER`, so that what reads it has few names to keep.
        """
        lately = sa.select(steps.c.recording_id).where(steps.c.at >= since)
        query = sa.select(steps).where(steps.c.recording_id.in_(lately)).order_by(steps.c.id)
        found: defaultdict[str, list[float]] = defaultdict(list)
        before: dict[tuple[int, int | None], datetime] = {}
        with self.reading() as connection:
            for row in connection.execute(query):
                of_file, of_test = (row.recording_id, None), (row.recording_id, row.test_id)
                began = before.get(of_test) or before.get(of_file)
                if began is not None and row.at >= since and row.stage != Stage.RECEIVED:
                    name = row.stage if row.stage in STEPS else OTHER
                    found[name].append((row.at - began).total_seconds())
                before[of_test] = row.at
        return dict(found)


def _count(connection: sa.Connection, table: sa.Table) -> int:
    return int(connection.scalar(sa.select(sa.func.count()).select_from(table)) or 0)
