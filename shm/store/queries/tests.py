"""List and count tests, and load what belongs to one."""

from __future__ import annotations

from collections.abc import Collection

import sqlalchemy as sa

from shm.store.blobs import unpack_response
from shm.store.database import Repository
from shm.store.files import is_counted, is_current
from shm.store.rows import Baseline, LatestTest, Stage, StoredTest, TestRow
from shm.store.selects import baselines_now, load_tests, plain_tests, test_columns, test_row
from shm.store.stored_tests import shown_tests
from shm.store.tables import baselines, posterior_tests, recordings, tests
from shm.values import FrequencyResponse


def list_test_rows(
    store: Repository, hanger: int, limit: int = 50, before: int | None = None
) -> tuple[TestRow, ...]:
    """List tests of a hanger, the newest first; `before` is the test to go on after."""
    query = sa.select(*test_columns).where(shown_tests(hanger))
    if before is not None:
        query = query.where(_is_before(before))
    newest = query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(limit)
    return tuple(map(test_row, store.rows(newest)))


def list_waiting_tests(
    store: Repository, limit: int | None = None, excluding: Collection[int] = ()
) -> tuple[TestRow, ...]:
    """List tests identified or updated, not yet watched: by hanger, then by time.

    With a `limit` no more than the first so many of each hanger and stage; those of the
    recordings `excluding` are left out.
    """
    groups, by_time = (tests.c.hanger, tests.c.stage), (tests.c.time, tests.c.id)
    place = sa.func.row_number().over(partition_by=groups, order_by=by_time).label("place")
    on_the_way = tests.c.stage.in_([Stage.IDENTIFIED, Stage.UPDATED])
    query = sa.select(*test_columns).add_columns(place)
    query = query.where(on_the_way, is_current(tests), tests.c.recording_id.not_in(excluding))
    found = query.subquery()
    chosen = sa.select(found).order_by(found.c.hanger, found.c.time, found.c.id)
    if limit is not None:
        chosen = chosen.where(found.c.place <= limit)
    return tuple(map(test_row, store.rows(chosen)))


def list_baseline_tests(store: Repository, baseline: Baseline) -> tuple[StoredTest, ...]:
    """List the tests from which a baseline was made, as they were then, by time."""
    made = (
        sa.select(posterior_tests.c.test_id)
        .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
        .where(baselines.c.id == baseline.id)
    )
    return load_tests(
        store, plain_tests.where(tests.c.id.in_(made)).order_by(tests.c.time, tests.c.id)
    )


def list_refused_of_baselines(store: Repository) -> tuple[tuple[int, str, int], ...]:
    """Return hanger, name and recording of each refused test of a baseline in force."""
    made = (
        sa.select(posterior_tests.c.test_id)
        .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
        .where(baselines.c.id.in_(baselines_now()))
    )
    query = sa.select(tests.c.hanger, tests.c.name, tests.c.recording_id)
    refused = tests.c.id.in_(made), tests.c.stage == Stage.REFUSED
    rows = store.rows(query.where(*refused).order_by(tests.c.time, tests.c.id))
    return tuple((row.hanger, row.name, row.recording_id) for row in rows)


def count_tests(store: Repository) -> dict[int, LatestTest]:
    """Count the tests in force of each hanger, with the time of the latest."""
    shown = is_counted(tests) & is_current(tests)
    counted = (tests.c.hanger, sa.func.count().label("tests"), sa.func.max(tests.c.time))
    rows = store.rows(sa.select(*counted).where(shown).group_by(tests.c.hanger))
    return {row[0]: LatestTest(int(row[1]), row[2]) for row in rows}


def list_undated_names(store: Repository) -> dict[int, tuple[str, ...]]:
    """Return the names of the tests that are dated by their receipt, by hanger."""
    undated = is_counted(tests) & is_current(tests) & tests.c.taken_at.is_(None)
    query = sa.select(tests.c.hanger, tests.c.name).where(undated).order_by(tests.c.id)
    found: dict[int, tuple[str, ...]] = {}
    for hanger, name in store.rows(query):
        found[hanger] = (*found.get(hanger, ()), name)
    return found


def find_neighbours(store: Repository, test: StoredTest) -> tuple[str | None, str | None]:
    """Return the names of the tests of the same hanger before and after one, by time."""
    names = sa.select(tests.c.name).where(shown_tests(test.hanger)).limit(1)
    place = sa.tuple_(tests.c.time, tests.c.id)
    here = sa.tuple_(sa.literal(test.time, tests.c.time.type), sa.literal(test.id))
    former = names.where(place < here).order_by(tests.c.time.desc(), tests.c.id.desc())
    later = names.where(place > here).order_by(tests.c.time, tests.c.id)
    with store.reading() as connection:
        return connection.scalar(former), connection.scalar(later)


def load_frequency_response(store: Repository, test: StoredTest) -> FrequencyResponse | None:
    """Load what the modes of a test were identified from; None where a file gave the modes."""
    query = sa.select(tests.c.frequency_response, recordings.c.file_name).join(recordings)
    blob, file_name = store.first(query.where(tests.c.id == test.id))
    return None if blob is None else unpack_response(blob, file_name, test.test)


def _is_before(test_id: int) -> sa.ColumnElement[bool]:
    other = tests.alias()
    time = sa.select(other.c.time).where(other.c.id == test_id).scalar_subquery()
    return (tests.c.time < time) | ((tests.c.time == time) & (tests.c.id < test_id))
