"""Posteriors, the classes they compete in, why a model missed, and what was adopted of that.

A summary in numbers is kept beside each posterior. Where there is none yet, or where the hanger is
described otherwise by now, it is made from the samples anew: the answer is the same, only later.
"""

from __future__ import annotations

import hashlib
import logging
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import lru_cache
from statistics import fmean
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.diagnosis_document import diagnosis_document
from shm.errors import NothingThere, StoreBusy, UsageError
from shm.store.columns import row_of, value_from, value_in
from shm.store.database import Repository, insert
from shm.store.files import all_at, is_counted, is_current, move
from shm.store.journal import note
from shm.store.rows import (
    Adoption,
    BaselineGlance,
    Lineage,
    Numbers,
    Stage,
    StoredAdoption,
    StoredDiagnosis,
    StoredPosterior,
    StoredSelection,
    StoredTest,
    TrendPoint,
)
from shm.store.selects import (
    baselines_now,
    counted_tests,
    hidden,
    insert_baseline,
    insert_posterior,
    insert_selection,
    load_tests,
    posterior_of_row,
    selection_in_force,
    selection_numbers,
    selection_of,
)
from shm.store.tables import (
    adoptions,
    baselines,
    diagnoses,
    posterior_tests,
    posteriors,
    selection_entries,
    selections,
    summaries,
    tests,
)
from shm.values import (
    NAN,
    BaselineCheck,
    Diagnosis,
    Hanger,
    Posterior,
    Selection,
    Summary,
)
from shm.values.stated_tension import averaged_now

log = logging.getLogger(__name__)
_AT_ONCE = 50  # technical: posteriors of some 100 kB each
_HANGERS_KNOWN = 4096  # technical: more than any bridge has
_OF_TEST = ("id", "name", "hanger", "time", "taken_at", "temperature_c")
_SUMMARY = summaries.c.key, summaries.c.document.label("summary")


def load_points(
    store: Repository, chosen: sa.Select[Any] | Sequence[int], hangers: Iterable[Hanger]
) -> tuple[TrendPoint, ...]:
    """Of tests that are `chosen` by their numbers, by time."""
    newest = (
        sa.select(
            posterior_tests.c.test_id,
            sa.func.max(posterior_tests.c.posterior_id).label("posterior_id"),
        )
        .join(posteriors)
        .where(posterior_tests.c.test_id.in_(chosen), *shown_posteriors())
        .group_by(posterior_tests.c.test_id)
        .subquery()
    )
    of_test = (tests.c[name] for name in _OF_TEST)
    query: sa.Select[Any] = (
        sa.select(*of_test, newest.c.posterior_id, posteriors.c.model, *_SUMMARY)
        .select_from(newest)
        .join(tests, tests.c.id == newest.c.test_id)
        .join(posteriors, posteriors.c.id == newest.c.posterior_id)
        .outerjoin(summaries, summaries.c.posterior_id == posteriors.c.id)
        .order_by(tests.c.time, tests.c.id)
    )
    known = {hanger.id: hanger for hanger in hangers}
    with store.reading() as connection:
        rows = [row for row in connection.execute(query) if row.hanger in known]
        numbers = _numbers(connection, rows, known)
    return tuple(
        value_in(row, TrendPoint, test_id=row.id, test=row.name, **vars(numbers[row.posterior_id]))
        for row in rows
    )


def list_baselines_in_force(
    store: Repository, hangers: Iterable[Hanger]
) -> dict[int, BaselineGlance]:
    """Return the baseline in force of each hanger that has one, in numbers."""
    known = {hanger.id: hanger for hanger in hangers}
    now = baselines_now(next(iter(known)) if len(known) == 1 else None)
    query = (
        sa.select(baselines, posteriors.c.model, posteriors.c.document, *_SUMMARY)
        .join(posteriors, posteriors.c.id == baselines.c.posterior_id)
        .outerjoin(summaries, summaries.c.posterior_id == posteriors.c.id)
        .where(baselines.c.id.in_(now))
        .order_by(baselines.c.hanger)
    )
    with store.reading() as connection:
        rows = [row for row in connection.execute(query) if row.hanger in known]
        numbers = _numbers(connection, rows, known)
        made_of = _made_of(connection, [row.posterior_id for row in rows])
    return {
        row.hanger: _baseline(row, made_of[row.posterior_id], numbers[row.posterior_id])
        for row in rows
    }


def shown_posteriors() -> tuple[sa.ColumnElement[bool], ...]:
    return posteriors.c.id.not_in(hidden), is_current(posteriors)


def _numbers(
    connection: Connection, rows: Sequence[Row[Any]], hangers: Mapping[int, Hanger]
) -> dict[int, Numbers]:
    """Of each row's posterior: as they are kept, or made from its samples."""
    selected = selection_numbers(connection)
    keys = {id_: key_of(hanger, selected.get(id_)) for id_, hanger in hangers.items()}
    numbers = {
        row.posterior_id: value_from(Numbers, row.summary)
        for row in rows
        if row.key == keys[row.hanger]
    }
    missing = [row.posterior_id for row in rows if row.posterior_id not in numbers]
    for begin in range(0, len(missing), _AT_ONCE):
        numbers |= _made(connection, missing[begin : begin + _AT_ONCE], hangers)
    return numbers


def _made(
    connection: Connection, ids: Sequence[int], hangers: Mapping[int, Hanger]
) -> dict[int, Numbers]:
    query = sa.select(posteriors).where(posteriors.c.id.in_(ids))
    compared: dict[int, Selection | None] = {}
    made = {}
    for row in connection.execute(query).all():
        if row.hanger not in compared:
            found = selection_of(connection, row.hanger)
            compared[row.hanger] = None if found is None else found.selection
        posterior = posterior_of_row(row)
        made[row.id] = summarised(posterior, hangers[row.hanger], compared[row.hanger])
    return made


def summarised(posterior: Posterior, hanger: Hanger, selection: Selection | None) -> Numbers:
    """A posterior of `hanger` in numbers, its tension also over the classes of a `selection`."""
    # Imported here because who only asks what is kept needs no model.
    from shm.models import end_stiffness

    try:
        stiffness = end_stiffness(posterior, hanger)
    except UsageError as reason:  # its effect may have left the catalogue, or it is of before
        log.warning("no end stiffness of hanger %d: %s", hanger.id, reason)
        stiffness = {}
    most_probable = posterior.most_probable[posterior.names.index("theta_F")]
    return Numbers(
        tension_n=Summary.of(posterior.tension_n),
        most_probable_tension_n=float(most_probable * posterior.nominal_tension_n),
        stiffness={name: Summary.of(samples) for name, samples in stiffness.items()},
        parameters={name: Summary.of(posterior.parameter(name)) for name in posterior.names},
        averaged=averaged_now(posterior, selection, hanger.limits),
    )


@lru_cache(_HANGERS_KNOWN)
def key_of(hanger: Hanger, selection_id: int | None) -> str:
    """Tells one description of a hanger, and one choice among its classes, from another."""
    text = repr(("fields by name", hanger, selection_id))  # 1.0.0 stored lists
    return hashlib.sha256(text.encode()).hexdigest()


def _made_of(connection: Connection, ids: Sequence[int]) -> defaultdict[int, list[Row[Any]]]:
    """The names, times and temperatures of the tests of each posterior, by time."""
    of_test = tests.c.name, tests.c.time, tests.c.temperature_c
    columns = (posterior_tests.c.posterior_id, *of_test)
    query: sa.Select[Any] = sa.select(*columns).join(tests)
    query = query.where(posterior_tests.c.posterior_id.in_(ids))
    found = defaultdict[int, list[Row[Any]]](list)
    for row in connection.execute(query.order_by(tests.c.time, tests.c.id)):
        found[row.posterior_id].append(row)
    return found


def _baseline(row: Row[Any], made_of: Sequence[Row[Any]], numbers: Numbers) -> BaselineGlance:
    temperatures_c = [each.temperature_c for each in made_of if math.isfinite(each.temperature_c)]
    document = value_from(_OfBaseline, row.document)
    return value_in(
        row,
        BaselineGlance,
        tests=tuple(each.name for each in made_of),
        temperature_c=fmean(temperatures_c) if temperatures_c else NAN,
        check=document.baseline_check,
        begins_at=min((each.time for each in made_of), default=None),
        described=document.described,
        **vars(numbers),
    )


@dataclass(frozen=True)
class _OfBaseline:
    """The part of a posterior's document that the pages show of a baseline."""

    baseline_check: BaselineCheck | None = None
    described: dict[str, Any] | None = None


_in_force = adoptions.c.undone_at.is_(None)


class Posteriors(Repository):
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
            references = {
                "selection_id": insert_selection(connection, hanger, model, probable, at),
                "baseline_id": insert_baseline(
                    connection, hanger, ids[model], adoption.who, why, at
                ),
                "adopted_at": at,
            }
            id_ = insert(connection, adoptions, row_of(adoption, adoptions) | references)
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

    def save_summaries(self, hanger: Hanger) -> int:
        """Keeps the summaries of a hanger that are not kept yet; how many there were.

        Some at a time, each time a transaction: it may be killed and begun again.
        """
        with self.reading() as connection:
            key = key_of(hanger, selection_numbers(connection).get(hanger.id))
        missing = self._missing(hanger, key)
        for begin in range(0, len(missing), _AT_ONCE):
            some = missing[begin : begin + _AT_ONCE]
            with self.reading() as connection:
                made = _made(connection, some, {hanger.id: hanger})
            rows = [
                {"posterior_id": id_, "key": key, "document": asdict(numbers)}
                for id_, numbers in made.items()
            ]
            with self.writing() as connection:
                former = summaries.c.posterior_id.in_(some)
                connection.execute(sa.delete(summaries).where(former))
                if rows:
                    connection.execute(sa.insert(summaries), rows)
        return len(missing)

    def _missing(self, hanger: Hanger, key: str) -> list[int]:
        """Return what is shown of a hanger and has no summary under its present description."""
        up_to_date = sa.exists().where(
            summaries.c.posterior_id == posteriors.c.id, summaries.c.key == key
        )
        of_baselines = sa.select(baselines.c.posterior_id).where(
            baselines.c.id.in_(baselines_now(hanger.id))
        )
        looked_at = posteriors.c.id.not_in(hidden) | posteriors.c.id.in_(of_baselines)
        query = sa.select(posteriors.c.id).where(
            posteriors.c.hanger == hanger.id, is_current(posteriors), looked_at, ~up_to_date
        )
        return list(self.scalars(query.order_by(posteriors.c.id)))


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
