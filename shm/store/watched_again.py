"""Tests that are compared with their baseline again, since what they are judged by has changed, or
with none.
"""

from __future__ import annotations

from datetime import datetime

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.store.audit import note
from shm.store.database import Repository
from shm.store.files import in_force
from shm.store.reprocessing import BEFORE, supersede_results
from shm.store.results import all_at, move, move_numbers
from shm.store.rows import Baseline, Stage, StoredTest
from shm.store.tables import tests, watch_states, watches


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
        with self.reading() as connection:
            return connection.execute(sa.select(watches.c.id).where(own)).first() is not None

    def is_last(self, test: StoredTest, baseline: Baseline) -> bool:
        """Whether no later test that counts has ever been compared with a baseline."""
        query = (
            sa.select(tests.c.id)
            .join(watches)
            .where(watches.c.baseline_id == baseline.id, tests.c.stage != Stage.REFUSED)
            .where(in_force(tests), tests.c.time > test.time)
        )
        with self.reading() as connection:
            return connection.execute(query).first() is None


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
