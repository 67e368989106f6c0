"""Read the posteriors of a hanger by time, complete or in numbers."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from shm.store.database import Repository
from shm.store.files import is_counted, is_current
from shm.store.mapping import value_in
from shm.store.rows import StoredPosterior, StoredTest, TrendPoint
from shm.store.selects import counted_tests, load_tests, posterior_of_row
from shm.store.stored_posteriors import posteriors_of
from shm.store.tables import posterior_tests, posteriors, tests
from shm.store.trends import load_points, shown_posteriors
from shm.values import Hanger, Posterior


def list_posteriors(store: Repository, hanger: int) -> tuple[StoredPosterior, ...]:
    """Return the posteriors of a hanger in its selected class, by time."""
    query = posteriors_of(hanger)
    return tuple(
        value_in(row, StoredPosterior, posterior=posterior_of_row(row))
        for row in store.rows(query.order_by(posteriors.c.time, posteriors.c.id))
    )


def list_history(store: Repository, hanger: int) -> tuple[tuple[StoredTest, Posterior], ...]:
    """List each test of a hanger that has a posterior, with it, by time."""
    newest = (
        sa.select(posterior_tests.c.test_id, sa.func.max(posterior_tests.c.posterior_id))
        .join(posteriors)
        .where(posteriors.c.id.in_(posteriors_of(hanger).with_only_columns(posteriors.c.id)))
        .group_by(posterior_tests.c.test_id)
    )
    stored = {row.id: row.posterior for row in list_posteriors(store, hanger)}
    with store.reading() as connection:
        newest_of = {row[0]: row[1] for row in connection.execute(newest)}
    known = load_tests(store, counted_tests(hanger))
    return tuple(
        (test, stored[newest_of[test.id]]) for test in known if newest_of.get(test.id) in stored
    )


def list_trend(
    store: Repository, hanger: Hanger, since: datetime | None = None
) -> tuple[TrendPoint, ...]:
    """List each test of a hanger that has a posterior, in numbers, by time."""
    chosen = _shown_tests().where(tests.c.hanger == hanger.id)
    if since is not None:
        chosen = chosen.where(tests.c.time >= since)
    return load_points(store, chosen, [hanger])


def find_latest_trends(store: Repository, hangers: Iterable[Hanger]) -> dict[int, TrendPoint]:
    """Return the latest point of the trend of each hanger that has one."""
    known = list(hangers)
    one = [tests.c.hanger == each.id for each in known] if len(known) == 1 else []
    of_hangers = sa.select(tests.c.hanger).where(is_current(tests), *one).distinct().subquery()
    latest = (
        _shown_tests()
        .where(tests.c.hanger == of_hangers.c.hanger, tests.c.id.in_(_of_shown(tests.c.id)))
        .order_by(tests.c.time.desc(), tests.c.id.desc())
        .limit(1)
        .correlate(of_hangers)
    )
    query = sa.select(latest.scalar_subquery()).select_from(of_hangers)
    ids = [id_ for id_ in store.scalars(query) if id_ is not None]
    return {point.hanger: point for point in load_points(store, ids, known)}


def _of_shown(test_id: sa.ColumnElement[int]) -> sa.Select[Any]:
    """Select a test where it has a posterior that is shown."""
    query = sa.select(posterior_tests.c.test_id).join(posteriors)
    return query.where(posterior_tests.c.test_id == test_id, *shown_posteriors())


def _shown_tests() -> sa.Select[Any]:
    return sa.select(tests.c.id).where(is_current(tests), is_counted(tests))
