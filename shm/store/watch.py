"""The watch: what it said after each test, against which baseline, and the state of each hanger."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.diagnosis_document import diagnosis_of
from shm.documents import alert_document
from shm.errors import StoreBusy
from shm.store.alerts import acknowledge, resolve, settle
from shm.store.blobs import change_in, watch_document, watch_in
from shm.store.columns import loads, row_of, value_in
from shm.store.database import Repository, insert
from shm.store.disposition import rerun_watched
from shm.store.files import all_at, is_current, move
from shm.store.journal import note
from shm.store.rows import (
    Baseline,
    Lineage,
    Reconciled,
    Stage,
    StoredAdoption,
    StoredAlert,
    StoredDiagnosis,
    StoredTest,
    StoredWatch,
    WatchCheckpoint,
)
from shm.store.selects import (
    baseline_in_force,
    baselines_now,
    for_hangers,
    insert_baseline,
    insert_posterior,
    read_baseline,
    undone_selections,
)
from shm.store.tables import (
    adoptions,
    alerts,
    baselines,
    diagnoses,
    drifts,
    selections,
    tests,
    watch_states,
    watches,
)
from shm.values import NAN, Alert, Change, Drift, Hanger, Posterior, WatchedTest


class Watch(Repository):
    """Results of the watch, and the baselines it compares with."""

    def save(
        self,
        test: StoredTest,
        baseline: Baseline,
        found: WatchedTest,
        alert: Alert | None,
        hooks: Sequence[str],
        at: datetime,
        state: WatchCheckpoint | None = None,
        changes: Reconciled | None = None,
        level: float = NAN,
    ) -> tuple[StoredAlert, ...]:
        """Store what the watch made of a test; return the alerts that are new.

        `alert` is what the test calls for; `changes` are the alerts that it opens and closes, by
        default it opens that one. `state` is what the watch goes on from at the next test; from
        `level` on an alert was wanted.
        """
        if changes is None:
            changes = Reconciled(() if alert is None else (alert,))
        with self.writing() as connection:
            if not all_at(connection, [test], Stage.UPDATED):
                return ()
            against = {"test_id": test.id, "baseline_id": baseline.id}
            for drift in found.drifts:
                insert(connection, drifts, row_of(drift, drifts) | against)
            insert(connection, watches, _watch_values(found, test, baseline, alert, level))
            raised = settle(connection, changes, hooks, at, test, baseline.id)
            if state is not None:
                _keep_state(connection, baseline, state)
            move(connection, [test], Stage.WATCHED, at)
            return raised

    def pass_over(self, test: StoredTest, at: datetime) -> None:
        """Compare a test within a maintenance window with nothing."""
        with self.writing() as connection:
            if all_at(connection, [test], Stage.UPDATED):
                move(connection, [test], Stage.WATCHED, at)

    def rerun(self, hanger: int, baseline_id: int, why: str, at: datetime) -> int:
        """Send back what was compared with a baseline, to be judged anew; return how many tests."""
        with self.writing() as connection:
            which = watches.c.baseline_id == baseline_id
            count = rerun_watched(connection, hanger, which, Stage.WATCHED, at)
            if count:
                note(connection, at, "tests judged again", f"hanger {hanger}", why, "shm")
            return count

    def forget_state(self, baseline: Baseline) -> None:
        """Drops what the watch would go on from: it then begins anew at the next test."""
        with self.writing() as connection:
            _drop_state(connection, baseline)

    def baseline(
        self,
        hanger: int,
        model: str | None = None,
        time: datetime | None = None,
        number: int | None = None,
    ) -> Baseline | None:
        """The baseline in force, the last that was in force of one class, or that of a `number`,
        with its posterior.

        With `time` it is that for a test of then: a baseline set anew is none for earlier tests.
        """
        with self.reading() as connection:
            return read_baseline(connection, hanger, model, time, number)

    def rebaseline(
        self,
        before: Baseline,
        posterior: Posterior,
        chosen: Sequence[StoredTest],
        record: tuple[str, str, datetime],
        lineage: Lineage,
        at: datetime,
        explained: Collection[int] | None = None,
    ) -> Baseline:
        """Has later tests compared with `posterior`, of the tests `chosen`, from now on.

        `record` is who, why, and the time since which those tests were taken. What was compared
        with the baseline `before` stays, its alerts are resolved: all, or those of the numbers
        `explained`, which nobody need take note of any more. Raises StoreBusy where that one is no
        longer in force.
        """
        (who, why, since), hanger = record, before.hanger
        with self.writing() as connection:
            _refuse_late(connection, before)
            number = insert_posterior(connection, hanger, posterior, chosen, lineage, at)
            id_ = insert_baseline(connection, hanger, number, who, why, at, since)
            open_alerts = sa.select(alerts.c.id).where(
                alerts.c.hanger == hanger,
                sa.or_(
                    alerts.c.baseline_id == before.id,
                    alerts.c.baseline_id.is_not(None) & alerts.c.noted_at.is_(None),
                ),
                alerts.c.ended_at.is_(None),
            )
            for alert_id in connection.scalars(open_alerts.order_by(alerts.c.id)).all():
                if explained is not None and alert_id not in explained:
                    continue
                resolve(connection, alert_id, who, f"new baseline: {why}", at)
                if explained is not None:
                    acknowledge(connection, alert_id, who, f"explained by: {why}", at)
            note(connection, at, "baseline set", f"hanger {hanger}", why, who)
        return Baseline(id_, hanger, posterior, at, who, why, since)

    def list_drifts(self, hanger: int | None = None) -> tuple[Drift, ...]:
        """Shifts from the baseline, by time; of one hanger where named."""
        query = sa.select(drifts, tests.c.name.label("test")).join(tests).where(is_current(drifts))
        if hanger is not None:
            query = query.where(drifts.c.hanger == hanger)
        return tuple(
            value_in(row, Drift) for row in self.rows(query.order_by(drifts.c.time, drifts.c.id))
        )

    def list_all(
        self, hanger: int | None = None, baseline_id: int | None = None, *, last: int | None = None
    ) -> tuple[StoredWatch, ...]:
        """Return what the watch said after each test, or after the `last` so many, by time; of one
        hanger or baseline where named."""
        query = sa.select(watches.c.id).where(is_current(watches))
        if hanger is not None:
            query = query.where(watches.c.hanger == hanger)
        if baseline_id is not None:
            query = query.where(watches.c.baseline_id == baseline_id)
        if last is None:
            return load_watches(self, query)
        latest = query.order_by(watches.c.time.desc(), watches.c.id.desc()).limit(last)
        return load_watches(self, self.scalars(latest))


def load_watches(
    store: Repository, chosen: sa.Select[Any] | Sequence[int]
) -> tuple[StoredWatch, ...]:
    """Watches that are `chosen` by their numbers, with their shifts, by time."""
    name = tests.c.name.label("test")
    query: sa.Select[Any] = sa.select(watches, name).select_from(watches).join(tests)
    query = query.where(watches.c.id.in_(chosen))
    same_test = watches.c.test_id == drifts.c.test_id
    together = same_test & (watches.c.baseline_id == drifts.c.baseline_id)
    shifts: sa.Select[Any] = (
        sa.select(drifts, name)
        .select_from(drifts.join(tests).join(watches, together))
        .where(watches.c.id.in_(chosen), is_current(drifts))
        .order_by(drifts.c.id)
    )
    with store.reading() as connection:
        rows = connection.execute(query.order_by(watches.c.time, watches.c.id)).all()
        found: defaultdict[tuple[int, int], list[Drift]] = defaultdict(list)
        for row in connection.execute(shifts):
            found[row.test_id, row.baseline_id].append(value_in(row, Drift))
    return tuple(_stored_watch(row, found[row.test_id, row.baseline_id]) for row in rows)


def _refuse_late(connection: Connection, before: Baseline) -> None:
    """An adoption, its undoing or another baseline may have come in between."""
    if connection.scalar(baseline_in_force(before.hanger)) != before.id:
        raise StoreBusy(
            f"hanger {before.hanger} has another baseline by now.",
            remedy="Try again.",
            retry_after_s=0.0,
        )


def _keep_state(connection: Connection, baseline: Baseline, state: WatchCheckpoint) -> None:
    _drop_state(connection, baseline)
    keys = {"hanger": baseline.hanger, "baseline_id": baseline.id}
    insert(connection, watch_states, row_of(state, watch_states) | keys)


def _drop_state(connection: Connection, baseline: Baseline) -> None:
    former = watch_states.c.baseline_id == baseline.id
    connection.execute(sa.delete(watch_states).where(former))


def _watch_values(
    found: WatchedTest, test: StoredTest, baseline: Baseline, alert: Alert | None, level: float
) -> dict[str, Any]:
    called = {"alert_probability": level, "calls_for": alert and alert_document(alert)}
    return {
        "test_id": test.id,
        "baseline_id": baseline.id,
        "hanger": test.hanger,
        "time": found.time,
        "document": {**watch_document(found), **called},
        "called": found.change.called,
    }


def _stored_watch(row: Row[Any], shifts: Sequence[Drift]) -> StoredWatch:
    found, level, called = watch_in(row.document)
    found = replace(found, test=row.test, time=row.time, drifts=tuple(shifts))
    return StoredWatch(row.id, row.hanger, row.baseline_id, found, level, called)


log = logging.getLogger(__name__)


def list_selected_models(store: Repository) -> dict[int, str]:
    """Return the selected or adopted class of each hanger that has one."""
    query = sa.select(selections.c.hanger, selections.c.model).order_by(selections.c.id)
    held = query.where(selections.c.id.not_in(undone_selections))
    return {row.hanger: row.model for row in store.rows(held)}


def list_diagnosed_hangers(store: Repository) -> frozenset[int]:
    """List the hangers of which a diagnosis is stored."""
    return frozenset(store.scalars(sa.select(diagnoses.c.hanger).distinct()))


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
