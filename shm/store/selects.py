"""Posteriors, selections, baselines and tests: kept as rows, read back, which are in force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import posterior_document
from shm.store.blobs import pack_samples, posterior_from, test_from_document
from shm.store.columns import loads, value_in
from shm.store.database import Repository, insert
from shm.store.files import is_counted, is_current
from shm.store.rows import DESCRIBED, Baseline, Lineage, Stage, StoredSelection, StoredTest, TestRow
from shm.store.tables import (
    adoptions,
    baselines,
    posterior_tests,
    posteriors,
    recordings,
    selection_entries,
    selections,
    silences,
    tests,
    watches,
)
from shm.values import Hanger, Posterior, Selection

# All but the frequency response, which may be as large as all else together a hundredfold.
_columns = (column for column in tests.columns if column is not tests.c.frequency_response)
plain_tests = sa.select(*_columns, recordings.c.sha256).join(recordings)
_undone = adoptions.c.undone_at.is_not(None)
undone_selections = sa.select(adoptions.c.selection_id).where(_undone)
_undone_baselines = sa.select(adoptions.c.baseline_id).where(_undone)
WEIGHED = sa.type_coerce(tests.c.document, sa.Text).contains('"tension_read_n"')
# Posteriors of the baseline's tests in a class that is not in force: it lost a selection that
# holds, or it was adopted and that was undone. And those of baselines set anew: their tests have
# a posterior each, which must still show what moved between them.
hidden = sa.union(
    sa.select(selection_entries.c.posterior_id).where(
        (selection_entries.c.rank > 0) != selection_entries.c.selection_id.in_(undone_selections)
    ),
    sa.select(baselines.c.posterior_id).where(baselines.c.since.is_not(None)),
)


# Tests that were passed over within a maintenance window: they were compared with nothing.
_OF_WORKS = (
    sa.exists()
    .where(
        silences.c.is_maintenance,
        sa.or_(silences.c.hanger.is_(None), silences.c.hanger == tests.c.hanger),
        silences.c.starts_at <= tests.c.time,
        tests.c.time < sa.func.coalesce(silences.c.ended_at, silences.c.ends_at),
    )
    .correlate(tests)
) & ~sa.exists().where(watches.c.test_id == tests.c.id, is_current(watches)).correlate(tests)


test_columns = tuple(tests.c[field.name] for field in fields(TestRow))


def counted_tests(hanger: int | None = None) -> sa.Select[Any]:
    """The tests of a hanger, or of all, that are neither refused nor held, by time."""
    query = plain_tests.where(is_counted(tests), is_current(tests))
    if hanger is not None:
        query = query.where(tests.c.hanger == hanger)
    return query.order_by(tests.c.time, tests.c.id)


def select_since_baseline(
    baseline: Baseline, *, include_maintenance: bool = False
) -> list[sa.ColumnElement[bool]]:
    """Select tests watched since a baseline, with `include_maintenance` those passed over."""
    found = [
        tests.c.hanger == baseline.hanger,
        tests.c.stage == Stage.WATCHED,
        tests.c.name.not_in(baseline.posterior.tests),
        is_current(tests),
    ]
    if not include_maintenance:
        found.append(~_OF_WORKS)
    return found if baseline.since is None else [*found, tests.c.time >= baseline.since]


def load_tests(store: Repository, query: sa.Select[Any]) -> tuple[StoredTest, ...]:
    """Read the tests of a query on `plain_tests`."""
    return tuple(map(_test, store.rows(query)))


def _test(row: Row[Any]) -> StoredTest:
    test = test_from_document(loads(row.document), row.hanger)
    return value_in(row, StoredTest, key=f"{row.sha256}/{row.position}", test=test)


def posterior_of_row(row: Row[Any]) -> Posterior:
    """The posterior of a whole row."""
    return posterior_from(loads(row.document), row.samples)


def read_baseline(
    connection: Connection,
    hanger: int,
    model: str | None = None,
    time: datetime | None = None,
    number: int | None = None,
) -> Baseline | None:
    """The baseline in force, the last of one class or that of a `number`, with its posterior; for a
    test of `time`."""
    query = (
        sa.select(baselines, posteriors.c.document, posteriors.c.samples)
        .select_from(baselines.join(posteriors))
        .where(baselines.c.hanger == hanger)
        .order_by(baselines.c.id.desc())
        .limit(1)
    )
    if number is not None:
        query = query.where(baselines.c.id == number)
    else:
        query = query.where(_in_force(hanger) if model is None else posteriors.c.model == model)
    if time is not None:
        query = query.where(baselines.c.since.is_(None) | (baselines.c.since <= time))
    row = connection.execute(query).one_or_none()
    if row is None:
        return None
    described = loads(row.document).get(DESCRIBED)
    return value_in(row, Baseline, posterior=posterior_of_row(row), described=described)


def selection_of(connection: Connection, hanger: int) -> StoredSelection | None:
    """The selection in force, complete with samples."""
    row = connection.execute(selection_in_force(hanger)).one_or_none()
    if row is None:
        return None
    entries = (
        sa.select(posteriors, selection_entries.c.probability)
        .join(selection_entries)
        .where(selection_entries.c.selection_id == row.id)
        .order_by(selection_entries.c.probability.desc().nulls_last(), selection_entries.c.rank)
    )
    ranked = connection.execute(entries).all()
    selection = Selection(
        tuple(posterior_of_row(entry) for entry in ranked),
        tuple(entry.probability for entry in ranked),
    )
    return StoredSelection(row.id, selection, row.selected_at, row.model)


def selection_numbers(connection: Connection) -> dict[int, int]:
    """The number of the selection in force of each hanger that has one."""
    query = sa.select(selections.c.hanger, sa.func.max(selections.c.id).label("id"))
    query = query.where(selections.c.id.not_in(undone_selections)).group_by(selections.c.hanger)
    return {row.hanger: row.id for row in connection.execute(query)}


def selection_in_force(hanger: int) -> sa.Select[Any]:
    """The newest selection of a hanger that did not come with an adoption since undone."""
    query = sa.select(selections).where(
        selections.c.hanger == hanger, selections.c.id.not_in(undone_selections)
    )
    return query.order_by(selections.c.id.desc()).limit(1)


def _in_force(hanger: int) -> sa.ColumnElement[bool]:
    """Select the baselines of the class in force, unless their adoption was undone."""
    model = sa.select(selection_in_force(hanger).subquery().c.model).scalar_subquery()
    return baselines.c.id.not_in(_undone_baselines) & (posteriors.c.model == model)


def baselines_now(hanger: int | None = None) -> sa.Select[Any]:
    """The numbers of the newest baselines of all hangers or of one, each in its class in force."""
    newest = sa.select(sa.func.max(selections.c.id)).group_by(selections.c.hanger)
    held = newest.where(selections.c.id.not_in(undone_selections))
    found = (
        sa.select(sa.func.max(baselines.c.id))
        .join(posteriors, posteriors.c.id == baselines.c.posterior_id)
        .join(
            selections,
            (selections.c.hanger == baselines.c.hanger)
            & (selections.c.model == posteriors.c.model),
        )
        .where(selections.c.id.in_(held), baselines.c.id.not_in(_undone_baselines))
        .group_by(baselines.c.hanger)
    )
    return found if hanger is None else found.where(baselines.c.hanger == hanger)


def baseline_in_force(hanger: int) -> sa.Select[Any]:
    """The number of the newest baseline of a hanger in the class in force."""
    query = sa.select(baselines.c.id).join(posteriors).where(baselines.c.hanger == hanger)
    return query.where(_in_force(hanger)).order_by(baselines.c.id.desc()).limit(1)


def for_hangers(
    hanger: sa.ColumnElement[int], hangers: Sequence[Hanger] | None
) -> sa.ColumnElement[bool]:
    """Return the condition that a row is of one of `hangers`, or of any where None."""
    return sa.true() if hangers is None else hanger.in_([each.id for each in hangers])


def insert_posterior(
    connection: Connection,
    hanger: int,
    posterior: Posterior,
    chosen: Sequence[StoredTest],
    lineage: Lineage,
    at: datetime,
) -> int:
    """Keeps a posterior of tests; its number."""
    document = posterior_document(posterior)
    if lineage.described is not None:
        document[DESCRIBED] = dict(lineage.described)
    values = {
        **lineage.columns,
        "hanger": hanger,
        "model": posterior.model,
        "time": max(test.time for test in chosen),
        "document": document,
        "samples": pack_samples(posterior),
        "log_evidence": posterior.log_evidence,
        "log_evidence_sd": posterior.log_evidence_sd,
        "seed": posterior.seed,
        "updated_at": at,
    }
    posterior_id = insert(connection, posteriors, values)
    pairs = [{"posterior_id": posterior_id, "test_id": test.id} for test in chosen]
    connection.execute(sa.insert(posterior_tests), pairs)
    return posterior_id


def insert_selection(
    connection: Connection,
    hanger: int,
    model: str,
    probable: Sequence[tuple[int, float]],
    at: datetime,
) -> int:
    """Keeps which class is in force and, that one first, what competed; its number.

    `probable` holds the numbers of the posteriors with their probabilities.
    """
    row = {"hanger": hanger, "model": model, "selected_at": at}
    selection_id = insert(connection, selections, row)
    entries = [
        {"selection_id": selection_id, "posterior_id": id_, "rank": rank, "probability": p}
        for rank, (id_, p) in enumerate(probable)
    ]
    connection.execute(sa.insert(selection_entries), entries)
    return selection_id


def insert_baseline(
    connection: Connection,
    hanger: int,
    posterior_id: int,
    who: str,
    why: str,
    at: datetime,
    since: datetime | None = None,
) -> int:
    """Keeps what later tests are compared with; its number."""
    row = {"hanger": hanger, "posterior_id": posterior_id, "who": who, "why": why}
    return insert(connection, baselines, {**row, "set_at": at, "since": since})
