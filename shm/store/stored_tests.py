"""Tests: kept with what was judged of them, listed, found by name, time or samples."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.store.database import Repository, insert
from shm.store.files import advance_recordings, is_counted, is_current, test_contents
from shm.store.holding import Judgement, keep_judgement
from shm.store.journal import write
from shm.store.rows import IdentifiedTest, Lineage, Stage, StoredAlert, StoredTest
from shm.store.selects import counted_tests, load_tests, plain_tests
from shm.store.tables import recordings, tests

_LATEST = 3


class Tests(Repository):
    """Identified tests."""

    __test__ = False  # no test, though named so

    def save(
        self,
        recording_id: int,
        found: Sequence[IdentifiedTest],
        lineage: Lineage,
        at: datetime,
        judged: Judgement | None = None,
    ) -> StoredAlert | None:
        """Keeps the tests of a recording; does nothing where another process was first.

        Nor where it has another sidecar by now than it was `judged` with: it waits to be done with
        that. The notice where tests of it are held.
        """
        with self.writing() as connection:
            query = sa.select(recordings).where(recordings.c.id == recording_id)
            recording = connection.execute(query).one()
            if recording.stage != Stage.RECEIVED:
                return None
            if judged is not None and judged.sidecar_as != recording.sidecar_as:
                return None
            kept = _positions(connection, recording_id)
            for item in (item for item in found if item.position not in kept):
                values = {**_test_values(connection, item, recording), **lineage.columns}
                test_id = insert(connection, tests, {**values, "identified_at": at})
                write(connection, at, Stage.IDENTIFIED, recording_id, test_id)
            hanger = found[0].test.hanger
            by_id = recordings.c.id == recording_id
            connection.execute(sa.update(recordings).where(by_id).values(hanger=hanger))
            notice = keep_judgement(connection, recording, judged, at) if judged else None
            advance_recordings(connection, [recording_id], at)
            return notice

    def get(self, test_id: int) -> StoredTest:
        """One test by its row number; raises NothingThere."""
        found = load_tests(self, plain_tests.where(tests.c.id == test_id))
        if not found:
            raise NothingThere(f"no test {test_id}.", remedy="See `shm status`.")
        return found[0]

    def named(self, hanger: int, name: str) -> StoredTest:
        """The test in force of that name; raises NothingThere."""
        found = load_tests(self, plain_tests.where(shown_tests(hanger), tests.c.name == name))
        if not found:
            query = sa.select(tests.c.name).where(shown_tests(hanger))
            newest = self.scalars(
                query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(_LATEST)
            )
            latest = ", ".join(reversed(newest))
            raise NothingThere(
                f"no test {name} of hanger {hanger} is stored.",
                remedy=f"The latest: {latest or 'none'}.",
            )
        return found[0]

    def list_all(
        self, hanger: int | None = None, ids: Collection[int] | None = None
    ) -> tuple[StoredTest, ...]:
        """Return the tests of a hanger, those of some numbers, or all, by time; those refused are
        left out."""
        query = counted_tests(hanger)
        return load_tests(self, query if ids is None else query.where(tests.c.id.in_(ids)))


def _positions(connection: Connection, recording_id: int) -> set[int]:
    query = sa.select(tests.c.position).where(
        tests.c.recording_id == recording_id, is_current(tests)
    )
    return set(connection.scalars(query))


def _test_values(
    connection: Connection, item: IdentifiedTest, recording: Row[Any]
) -> dict[str, Any]:
    name = _free_name(connection, item, recording)
    return {
        "recording_id": recording.id,
        "position": item.position,
        "name": name,
        "time": item.test.time or recording.received_at,
        "stage": Stage.IDENTIFIED,
        **test_contents(item, name),
    }


def _free_name(connection: Connection, item: IdentifiedTest, recording: Row[Any]) -> str:
    """The test's own name or, where its hanger has one such, that name and its file's checksum.

    A test identified again keeps the one of these that it had.
    """
    own, plain = f"{item.test.id}-{recording.sha256[:8]}-{item.position}", item.test.id
    query = sa.select(tests.c.name).where(tests.c.hanger == item.test.hanger)
    here = (tests.c.recording_id == recording.id) & (tests.c.position == item.position)
    former = connection.scalar(query.where(here).order_by(tests.c.id.desc()).limit(1))
    taken = query.where(tests.c.name == plain, is_current(tests))
    free = former != own and connection.execute(taken).first() is None
    return plain if free else own


def shown_tests(hanger: int) -> sa.ColumnElement[bool]:
    return (tests.c.hanger == hanger) & is_current(tests) & is_counted(tests)
