"""Posteriors, the classes they compete in, why a model missed, and what was adopted of that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.diagnosis_document import diagnosis_document
from shm.errors import NothingThere, StoreBusy, UsageError
from shm.store.database import insert
from shm.store.files import all_at, is_current, move
from shm.store.journal import note
from shm.store.mapping import row_of, value_in
from shm.store.rows import (
    Adoption,
    Lineage,
    Stage,
    StoredAdoption,
    StoredDiagnosis,
    StoredSelection,
    StoredTest,
)
from shm.store.selects import (
    hidden,
    insert_baseline,
    insert_posterior,
    insert_selection,
    posterior_of_row,
    selection_in_force,
    selection_of,
)
from shm.store.tables import (
    adoptions,
    diagnoses,
    posterior_tests,
    posteriors,
    selection_entries,
    selections,
    tests,
)
from shm.store.trends import Trends
from shm.values import Diagnosis, Posterior, Selection

_in_force = adoptions.c.undone_at.is_(None)


class Posteriors(Trends):
    """Posteriors, selections, diagnoses and adoptions."""

    def save(
        self,
        test: StoredTest,
        posterior: Posterior,
        lineage: Lineage,
        at: datetime,
        *,
        to_watch: bool = True,
    ) -> None:
        """Keeps the posterior of one test; does nothing where another process was first.

        `to_watch` is false of a test from which the baseline itself was made.
        """
        with self.writing() as connection:
            if all_at(connection, [test], Stage.IDENTIFIED):
                insert_posterior(connection, test.hanger, posterior, [test], lineage, at)
                move(connection, [test], Stage.UPDATED if to_watch else Stage.WATCHED, at)

    def save_selection(
        self,
        hanger: int,
        chosen: Sequence[StoredTest],
        selection: Selection,
        lineage: Lineage,
        at: datetime,
    ) -> None:
        """Keeps the competing posteriors; the most probable is the hanger's baseline."""
        with self.writing() as connection:
            if not all_at(connection, chosen, Stage.IDENTIFIED) or _has(connection, hanger):
                return
            ids = [
                insert_posterior(connection, hanger, posterior, chosen, lineage, at)
                for posterior in selection.posteriors
            ]
            probable = list(zip(ids, selection.probabilities, strict=True))
            insert_selection(connection, hanger, selection.selected.model, probable, at)
            why = "the first test" if len(chosen) == 1 else f"the first {len(chosen)} tests"
            insert_baseline(connection, hanger, ids[0], "shm", why, at)
            move(connection, chosen, Stage.WATCHED, at)

    def get(self, hanger: int, test: str | None = None) -> Posterior:
        """The latest posterior of a hanger, or that of one test; raises NothingThere."""
        query = posteriors_of(hanger)
        if test is not None:
            query = query.where(posteriors.c.id.in_(_of_test(hanger, test)))
        # First which one, then its samples: else those of all would be sorted.
        named = query.with_only_columns(posteriors.c.id)
        latest = named.order_by(posteriors.c.time.desc(), posteriors.c.id.desc()).limit(1)
        chosen = sa.select(posteriors).where(posteriors.c.id == latest.scalar_subquery())
        row = self.first(chosen)
        if row is None:
            what = f"hanger {hanger}" + (f", test {test}" if test else "")
            raise NothingThere(f"no posterior of {what} yet.", remedy="Ingest a test of it.")
        return posterior_of_row(row)

    def selection(self, hanger: int) -> StoredSelection | None:
        """The selection in force."""
        with self.reading() as connection:
            return selection_of(connection, hanger)

    def save_diagnosis(
        self, hanger: int, diagnosis: Diagnosis, lineage: Lineage, at: datetime
    ) -> StoredDiagnosis:
        """Keeps a diagnosis, which is the hanger's latest from now on."""
        values = {
            **lineage.columns,
            "hanger": hanger,
            "diagnosed_at": at,
            "tests": list(diagnosis.tests),
            "document": diagnosis_document(diagnosis),
        }
        with self.writing() as connection:
            id_ = insert(connection, diagnoses, values)
        return StoredDiagnosis(id_, hanger, diagnosis, at, lineage)

    def adopt(
        self,
        adoption: Adoption,
        posterior: Posterior,
        probabilities: Mapping[str, float],
        basis: tuple[StoredSelection, Sequence[StoredTest]],
        lineage: Lineage,
        at: datetime,
    ) -> StoredAdoption:
        """Puts an adopted class in force: its posterior of the baseline's tests is the baseline.

        `basis` is the selection in force and the tests it was made from; `probabilities` are those
        of its classes and of the adopted one. Raises UsageError where the class is adopted already,
        StoreBusy where another selection is in force by now.
        """
        before, chosen = basis
        with self.writing() as connection:
            _refuse_late(connection, adoption, before)
            ids = _entries(connection, before.id)
            hanger, model = adoption.hanger, adoption.model
            ids[model] = insert_posterior(connection, hanger, posterior, chosen, lineage, at)
            ranked = sorted(ids, key=lambda name: (name != model, -probabilities[name]))
            probable = [(ids[name], probabilities[name]) for name in ranked]
            why = f"adopted {model}: {adoption.why}"
            kept = {
                "selection_id": insert_selection(connection, hanger, model, probable, at),
                "baseline_id": insert_baseline(
                    connection, hanger, ids[model], adoption.who, why, at
                ),
                "adopted_at": at,
            }
            id_ = insert(connection, adoptions, row_of(adoption, adoptions) | kept)
            subject, who = f"hanger {hanger}, {model}", adoption.who
            note(connection, at, "class adopted", subject, adoption.why, who)
        return StoredAdoption(id_, adoption, at)

    def drop_adoption(self, adoption_id: int, why: str, who: str, at: datetime) -> StoredAdoption:
        """Undoes an adoption: selection and baseline before it are in force again.

        Raises NothingThere where there is none of that number, UsageError where it is undone.
        """
        by_id = sa.select(adoptions).where(adoptions.c.id == adoption_id)
        undoing = {"undone_at": at, "undone_why": why, "undone_who": who}
        with self.writing() as connection:
            row = connection.execute(by_id).one_or_none()
            if row is None:
                raise NothingThere(f"no adoption {adoption_id}.", remedy="See `shm gap adopted`.")
            if row.undone_at is not None:
                raise UsageError(
                    f"adoption {adoption_id} is undone already.", remedy="See `shm gap adopted`."
                )
            changed = sa.update(adoptions).where(adoptions.c.id == adoption_id)
            connection.execute(changed.values(**undoing))
            subject = f"hanger {row.hanger}, {row.model}"
            note(connection, at, "adoption dropped", subject, why, who)
            return value_in(connection.execute(by_id).one(), StoredAdoption)


def _has(connection: Connection, hanger: int) -> bool:
    query = sa.select(selections.c.id).where(selections.c.hanger == hanger)
    return connection.execute(query).first() is not None


def posteriors_of(hanger: int) -> sa.Select[Any]:
    refused = (tests.c.hanger == hanger) & (tests.c.stage == Stage.REFUSED) & is_current(tests)
    of_refused = sa.select(posterior_tests.c.posterior_id).join(tests).where(refused)
    return sa.select(posteriors).where(
        posteriors.c.hanger == hanger,
        posteriors.c.id.not_in(hidden),
        posteriors.c.id.not_in(of_refused),
        is_current(posteriors),
    )


def _of_test(hanger: int, name: str) -> sa.Select[Any]:
    joined = posterior_tests.join(tests)
    query = sa.select(posterior_tests.c.posterior_id).select_from(joined)
    return query.where(tests.c.hanger == hanger, tests.c.name == name, is_current(tests))


def _refuse_late(connection: Connection, adoption: Adoption, before: StoredSelection) -> None:
    now = connection.execute(selection_in_force(adoption.hanger)).one_or_none()
    if now is None or now.id != before.id:
        raise StoreBusy(
            f"hanger {adoption.hanger} has another model class in force by now.",
            remedy="Try again.",
            retry_after_s=0.0,
        )
    same = sa.select(adoptions.c.id).where(
        _in_force, adoptions.c.hanger == adoption.hanger, adoptions.c.model == adoption.model
    )
    if connection.execute(same).first() is not None:
        raise UsageError(
            f"hanger {adoption.hanger} has adopted {adoption.model} already.",
            remedy="See `shm gap adopted`.",
        )


def _entries(connection: Connection, selection_id: int) -> dict[str, int]:
    """The number of each competing class's posterior."""
    query = sa.select(posteriors.c.model, posteriors.c.id).join(selection_entries)
    rows = connection.execute(query.where(selection_entries.c.selection_id == selection_id))
    return {row.model: row.id for row in rows}
