"""Verbs on diagnoses and adoptions: an adoption and all that comes with it are one transaction."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import fields
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.diagnosis_document import diagnosis_document, diagnosis_of
from shm.errors import NothingThere, StoreBusy, UsageError
from shm.store.checksums import decoding, loads
from shm.store.database import Database, insert
from shm.store.queries import selection_in_force
from shm.store.results import insert_baseline, insert_posterior, insert_selection
from shm.store.rows import (
    Adoption,
    Lineage,
    StoredAdoption,
    StoredDiagnosis,
    StoredSelection,
    StoredTest,
)
from shm.store.tables import adoptions, diagnoses, posteriors, selection_entries
from shm.values import Diagnosis, Posterior

log = logging.getLogger(__name__)

_ADOPTION = tuple(field.name for field in fields(Adoption))
_in_force = adoptions.c.undone_at.is_(None)


class Adopting(Database):
    """The part of the store that keeps why a model missed, and what was made of it."""

    def add_diagnosis(
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

    def latest_diagnosis(self, hanger: int) -> StoredDiagnosis | None:
        """The latest diagnosis of a hanger; None where there is none that this version reads."""
        query = sa.select(diagnoses).where(diagnoses.c.hanger == hanger)
        with self.reading() as connection:
            row = connection.execute(query.order_by(diagnoses.c.id.desc()).limit(1)).one_or_none()
        if row is None:
            return None
        with decoding(diagnoses, row, hanger):
            document = loads(row.document)
        try:
            return _diagnosis(row, diagnosis_of(document))
        except (KeyError, TypeError, ValueError):
            log.warning("the diagnosis of hanger %d is of a former version: make it again", hanger)
            return None

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
            id_ = insert(connection, adoptions, {**vars(adoption), **kept})
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
            return _adoption(connection.execute(by_id).one())

    def adoptions(
        self, hanger: int | None = None, *, undone: bool = False
    ) -> tuple[StoredAdoption, ...]:
        """Adoptions in force, of one hanger where named; with `undone` also those that were undone.

        They stand as they were made: the last one in force of a hanger is the one that counts.
        """
        query = sa.select(adoptions).order_by(adoptions.c.id)
        if hanger is not None:
            query = query.where(adoptions.c.hanger == hanger)
        if not undone:
            query = query.where(_in_force)
        with self.reading() as connection:
            return tuple(_adoption(row) for row in connection.execute(query))


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


def _adoption(row: Row[Any]) -> StoredAdoption:
    with decoding(adoptions, row, row.hanger):
        return StoredAdoption(
            id=row.id,
            adoption=Adoption(**{name: getattr(row, name) for name in _ADOPTION}),
            adopted_at=row.adopted_at,
            undone_at=row.undone_at,
            undone_why=row.undone_why or "",
            undone_who=row.undone_who or "",
        )


def _diagnosis(row: Row[Any], diagnosis: Diagnosis) -> StoredDiagnosis:
    return StoredDiagnosis(
        id=row.id,
        hanger=row.hanger,
        diagnosis=diagnosis,
        diagnosed_at=row.diagnosed_at,
        lineage=Lineage(row.input_sha256, row.settings_sha256, row.version),
    )
