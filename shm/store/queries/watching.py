"""Read the tests that the watch compares, and the state it goes on from."""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from shm.store.database import Repository
from shm.store.files import is_counted, is_current
from shm.store.mapping import value_in
from shm.store.rows import Baseline, Stage, StoredTest, TestRow, WatchCheckpoint
from shm.store.selects import (
    WEIGHED,
    load_tests,
    plain_tests,
    select_since_baseline,
    test_columns,
    test_row,
)
from shm.store.tables import tests, watch_states, watches


def list_tests_by_time(
    store: Repository, baseline: Baseline, test: StoredTest, limit: int
) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
    """List so many tests since a baseline before and after a test by time, the nearest first.

    Those passed over for planned works are among them.
    """
    compared = select_since_baseline(baseline, include_maintenance=True)
    query = plain_tests.where(*compared, tests.c.id != test.id)
    order = sa.tuple_(tests.c.time, tests.c.id)
    return _around(store, query, order, (test.time, test.id), limit)


def list_tests_by_receipt(
    store: Repository, baseline: Baseline, test: StoredTest, limit: int, held: Collection[int] = ()
) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
    """List the same by receipt, with those held of the recordings `held`."""
    is_held = (tests.c.hanger == baseline.hanger) & (tests.c.stage == Stage.HELD)
    is_held &= tests.c.recording_id.in_(held) & is_current(tests)
    counted = sa.and_(*select_since_baseline(baseline, include_maintenance=True))
    query = plain_tests.where(counted | is_held, tests.c.id != test.id)
    order = sa.tuple_(tests.c.recording_id, tests.c.id)
    return _around(store, query, order, (test.recording_id, test.id), limit)


def find_latest_weighed(
    store: Repository, hangers: Collection[int], before: datetime
) -> StoredTest | None:
    """Return the latest test of these hangers before then whose tension was read, too."""
    query = plain_tests.where(
        tests.c.hanger.in_(hangers),
        tests.c.time < before,
        is_counted(tests),
        is_current(tests),
        WEIGHED,
    )
    found = load_tests(store, query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(1))
    return found[0] if found else None


def list_weighed(store: Repository, ids: Collection[int]) -> frozenset[int]:
    """Return those of these tests whose tension was read, too."""
    query = sa.select(tests.c.id).where(tests.c.id.in_(ids), WEIGHED)
    return frozenset(store.scalars(query))


def is_watched_again(store: Repository, test: StoredTest, baseline: Baseline) -> bool:
    """Return True where a test has been compared with a baseline before."""
    own = (watches.c.test_id == test.id) & (watches.c.baseline_id == baseline.id)
    return store.first(sa.select(watches.c.id).where(own)) is not None


def is_caught_up(store: Repository, test: StoredTest, baseline: Baseline) -> bool:
    """Return True where no other test waits to be compared with a baseline once more."""
    waiting = tests.c.stage.in_([Stage.IDENTIFIED, Stage.UPDATED]) & is_current(tests)
    query = sa.select(tests.c.id).join(watches).where(watches.c.baseline_id == baseline.id)
    return store.first(query.where(waiting, tests.c.id != test.id)) is None


def find_watch_state(store: Repository, baseline: Baseline) -> WatchCheckpoint | None:
    """Return what the watch goes on from at the next test compared with a baseline."""
    query = sa.select(watch_states).where(watch_states.c.baseline_id == baseline.id)
    row = store.first(query)
    return None if row is None else value_in(row, WatchCheckpoint)


def list_watched_tests(
    store: Repository, baseline: Baseline, before: StoredTest | None = None
) -> tuple[TestRow, ...]:
    """List the tests watched since a baseline, or those `before` a test, by time.

    Tests that were watched against an earlier baseline count, but for those before a day since
    which the hanger is compared anew.
    """
    query = sa.select(*test_columns).where(*select_since_baseline(baseline))
    if before is not None:
        at_once = (tests.c.time == before.time) & (tests.c.id < before.id)
        query = query.where((tests.c.time < before.time) | at_once)
    return tuple(map(test_row, store.rows(query.order_by(tests.c.time, tests.c.id))))


def _around(
    store: Repository, query: sa.Select[Any], order: sa.Tuple, here: tuple[object, int], limit: int
) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
    down, up = ([getattr(each, way)() for each in order.clauses] for way in ("desc", "asc"))
    before = load_tests(store, query.where(order < here).order_by(*down).limit(limit))
    return before, load_tests(store, query.where(order > here).order_by(*up).limit(limit))
