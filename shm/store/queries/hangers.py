"""Read the model class, baseline, detections and diagnosis of each hanger."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

import sqlalchemy as sa

from shm.diagnosis_document import diagnosis_of
from shm.store.blobs import change_in
from shm.store.columns import Number, loads
from shm.store.database import Repository
from shm.store.files import is_current
from shm.store.mapping import value_in
from shm.store.rows import BaselineGlance, StoredAdoption, StoredDiagnosis, StoredWatch
from shm.store.selects import baselines_now, for_hangers, undone_selections
from shm.store.stored_watch import load_watches
from shm.store.tables import (
    adoptions,
    baselines,
    diagnoses,
    posterior_tests,
    selections,
    tests,
    watches,
)
from shm.store.trends import baselines_in_numbers
from shm.values import Change, Hanger

log = logging.getLogger(__name__)


def list_selected_models(store: Repository) -> dict[int, str]:
    """Return the selected or adopted class of each hanger that has one."""
    query = sa.select(selections.c.hanger, selections.c.model).order_by(selections.c.id)
    held = query.where(selections.c.id.not_in(undone_selections))
    return {row.hanger: row.model for row in store.rows(held)}


def find_latest_diagnosis(store: Repository, hanger: int) -> StoredDiagnosis | None:
    """Return the latest diagnosis of a hanger; None without one that this version reads."""
    query = sa.select(diagnoses).where(diagnoses.c.hanger == hanger)
    row = store.first(query.order_by(diagnoses.c.id.desc()).limit(1))
    if row is None:
        return None
    try:
        found = diagnosis_of(loads(row.document))
    except (KeyError, TypeError, ValueError):
        log.warning("the diagnosis of hanger %d is of a former version: make it again", hanger)
        return None
    return value_in(row, StoredDiagnosis, diagnosis=found)


def list_adoptions(
    store: Repository, hanger: int | None = None, *, undone: bool = False
) -> tuple[StoredAdoption, ...]:
    """List adoptions in force, of one hanger where named; with `undone` also the undone ones.

    They stand as they were made: the last one in force of a hanger is the one that counts.
    """
    query = sa.select(adoptions).order_by(adoptions.c.id)
    if hanger is not None:
        query = query.where(adoptions.c.hanger == hanger)
    if not undone:
        query = query.where(adoptions.c.undone_at.is_(None))
    return tuple(value_in(row, StoredAdoption) for row in store.rows(query))


def list_baselines_in_force(
    store: Repository, hangers: Iterable[Hanger]
) -> dict[int, BaselineGlance]:
    """Return the baseline in force of each hanger that has one, in numbers."""
    with store.reading() as connection:
        return baselines_in_numbers(connection, hangers)


def find_baseline_temperatures(store: Repository) -> dict[int, float]:
    """Return the mean temperature of the tests of each baseline in force; NaN where unknown."""
    mean_c = sa.func.avg(tests.c.temperature_c, type_=Number)
    query: sa.Select[Any] = (
        sa.select(baselines.c.hanger, mean_c.label("mean_c"))
        .join(posterior_tests, posterior_tests.c.posterior_id == baselines.c.posterior_id)
        .join(tests, tests.c.id == posterior_tests.c.test_id)
        .where(baselines.c.id.in_(baselines_now()))
        .group_by(baselines.c.hanger)
    )
    return {row.hanger: row.mean_c for row in store.rows(query)}


def find_latest_watches(
    store: Repository, hangers: Sequence[Hanger] | None = None
) -> dict[int, StoredWatch]:
    """Return the watch of the latest test of each hanger (or these) against its baseline."""
    held = baselines.alias()
    latest = (
        sa.select(watches.c.id)
        .where(
            watches.c.hanger == held.c.hanger,
            watches.c.baseline_id == held.c.id,
            is_current(watches),
        )
        .order_by(watches.c.time.desc(), watches.c.id.desc())
        .limit(1)
        .scalar_subquery()
    )
    ids = (
        sa.select(latest)
        .select_from(held)
        .where(held.c.id.in_(baselines_now()), for_hangers(held.c.hanger, hangers))
    )
    found = [id_ for id_ in store.scalars(ids) if id_ is not None]
    return {each.hanger: each for each in load_watches(store, found)}


def list_detected_changes(
    store: Repository, hangers: Sequence[Hanger] | None = None
) -> dict[int, tuple[Change, ...]]:
    """List the changes of each (or these) hanger from its baseline in force, by time."""
    query = sa.select(watches).where(*_called(), for_hangers(watches.c.hanger, hangers))
    found = defaultdict[int, list[Change]](list)
    for row in store.rows(query.order_by(watches.c.time, watches.c.id)):
        found[row.hanger].append(change_in(row.document))
    return {hanger: tuple(changes) for hanger, changes in found.items()}


def list_detections(store: Repository, hanger: int, baseline_id: int) -> tuple[StoredWatch, ...]:
    """Return the watches that detected a change from a baseline, and the latest of it, by
    time."""
    against = sa.select(watches.c.id).where(
        watches.c.hanger == hanger, watches.c.baseline_id == baseline_id, is_current(watches)
    )
    latest = against.order_by(watches.c.time.desc(), watches.c.id.desc()).limit(1)
    with store.reading() as connection:
        ids = {*connection.scalars(against.where(watches.c.called)), connection.scalar(latest)}
    return load_watches(store, [id_ for id_ in ids if id_ is not None])


def _called(hanger: int | None = None) -> tuple[sa.ColumnElement[bool], ...]:
    """Select watches that detected a change from the baseline in force, of all hangers or one."""
    against = watches.c.baseline_id.in_(baselines_now(hanger))
    return watches.c.called, against, is_current(watches)
