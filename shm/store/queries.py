"""Questions about tests, posteriors, selections and baselines."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.store.blobs import (
    foreign_from,
    posterior_from,
    quality_from,
    test_from_document,
    unpack_response,
)
from shm.store.checksums import content_checksum, damaged, decoding, loads
from shm.store.database import Database
from shm.store.files import counts, in_force
from shm.store.rows import (
    DESCRIBED,
    Baseline,
    Lineage,
    Stage,
    StoredPosterior,
    StoredSelection,
    StoredTest,
)
from shm.store.tables import (
    adoptions,
    baselines,
    posterior_tests,
    posteriors,
    recordings,
    selection_entries,
    selections,
    tests,
)
from shm.values import FrequencyResponse, Posterior, Selection

# All but the frequency response, which may be as large as all else together a hundredfold.
_columns = (column for column in tests.columns if column is not tests.c.frequency_response)
plain_tests = sa.select(*_columns, recordings.c.sha256).join(recordings)
_undone = adoptions.c.undone_at.is_not(None)
_undone_selections = sa.select(adoptions.c.selection_id).where(_undone)
_undone_baselines = sa.select(adoptions.c.baseline_id).where(_undone)
WEIGHED = sa.type_coerce(tests.c.document, sa.Text).contains('"tension_read_n"')
# Posteriors of the baseline's tests in a class that is not in force: it lost a selection that
# holds, or it was adopted and that was undone. And those of baselines set anew: their tests have
# a posterior each, which must still show what moved between them.
hidden = sa.union(
    sa.select(selection_entries.c.posterior_id).where(
        (selection_entries.c.rank > 0) != selection_entries.c.selection_id.in_(_undone_selections)
    ),
    sa.select(baselines.c.posterior_id).where(baselines.c.since.is_not(None)),
)


@dataclass(frozen=True)
class WaitingTest:
    """A test on its way, without its contents."""

    id: int
    recording_id: int
    hanger: int
    stage: Stage
    name: str


@dataclass(frozen=True)
class WatchedName:
    """A watched test, without its contents."""

    id: int
    name: str
    time: datetime


class Queries(Database):
    """The part of the store that answers."""

    def waiting_tests(
        self, limit: int | None = None, excluding: Collection[int] = ()
    ) -> tuple[WaitingTest, ...]:
        """Tests identified or updated, not yet watched: by hanger, then by time.

        With a `limit` no more than the first so many of each hanger and stage; those of the
        recordings `excluding` are left out.
        """
        names = ("id", "recording_id", "hanger", "stage", "name", "time")
        groups, by_time = (tests.c.hanger, tests.c.stage), (tests.c.time, tests.c.id)
        place = sa.func.row_number().over(partition_by=groups, order_by=by_time).label("place")
        on_the_way = tests.c.stage.in_([Stage.IDENTIFIED, Stage.UPDATED])
        query = sa.select(*(tests.c[name] for name in names)).add_columns(place)
        query = query.where(on_the_way, in_force(tests), tests.c.recording_id.not_in(excluding))
        found = query.subquery()
        chosen = sa.select(found).order_by(found.c.hanger, found.c.time, found.c.id)
        if limit is not None:
            chosen = chosen.where(found.c.place <= limit)
        with self.reading() as connection:
            rows = connection.execute(chosen).all()
        return tuple(
            WaitingTest(r.id, r.recording_id, r.hanger, Stage(r.stage), r.name) for r in rows
        )

    def watched_since(
        self, baseline: Baseline, before: StoredTest | None = None
    ) -> tuple[WatchedName, ...]:
        """The tests that were watched since a baseline, or those of them `before` a test, by time.

        Tests that were watched against an earlier baseline count, but for those before a day since
        which the hanger is compared anew.
        """
        query = sa.select(tests.c.id, tests.c.name, tests.c.time).where(*compared_with(baseline))
        if before is not None:
            at_once = (tests.c.time == before.time) & (tests.c.id < before.id)
            query = query.where((tests.c.time < before.time) | at_once)
        with self.reading() as connection:
            rows = connection.execute(query.order_by(tests.c.time, tests.c.id)).all()
        return tuple(WatchedName(row.id, row.name, row.time) for row in rows)

    def test(self, test_id: int) -> StoredTest:
        """One test by its row number; raises NothingThere."""
        found = self._tests(plain_tests.where(tests.c.id == test_id))
        if not found:
            raise NothingThere(f"no test {test_id}.", remedy="See `shm status`.")
        return found[0]

    def tests(self, hanger: int | None = None) -> tuple[StoredTest, ...]:
        """The tests of a hanger, or of all, by time; those refused are left out."""
        query = plain_tests.where(counts(tests), in_force(tests))
        if hanger is not None:
            query = query.where(tests.c.hanger == hanger)
        return self._tests(query.order_by(tests.c.time, tests.c.id))

    def weighed_test(self, hangers: Collection[int], before: datetime) -> StoredTest | None:
        """The latest test of these hangers before then whose tension was read, too."""
        query = plain_tests.where(
            tests.c.hanger.in_(hangers),
            tests.c.time < before,
            counts(tests),
            in_force(tests),
            WEIGHED,
        )
        found = self._tests(query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(1))
        return found[0] if found else None

    def weighed_among(self, ids: Collection[int]) -> frozenset[int]:
        """Which of these tests are of a tension that was read, too."""
        query = sa.select(tests.c.id).where(tests.c.id.in_(ids), WEIGHED)
        with self.reading() as connection:
            return frozenset(connection.scalars(query))

    def tests_of(self, baseline: Baseline) -> tuple[StoredTest, ...]:
        """The tests from which a baseline was made, as they were then, by time."""
        made = (
            sa.select(posterior_tests.c.test_id)
            .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
            .where(baselines.c.id == baseline.id)
        )
        return self._tests(
            plain_tests.where(tests.c.id.in_(made)).order_by(tests.c.time, tests.c.id)
        )

    def frequency_response(self, test: StoredTest) -> FrequencyResponse | None:
        """What the modes of a test were identified from; None where a file gave the modes."""
        query = (
            sa.select(
                tests.c.id,
                tests.c.frequency_response,
                tests.c.frequency_response_checksum,
                recordings.c.file_name,
            )
            .join(recordings)
            .where(tests.c.id == test.id)
        )
        with self.reading() as connection:
            row = connection.execute(query).one()
        blob, stored = row.frequency_response, row.frequency_response_checksum
        with decoding(tests, row, test.hanger):
            if stored != content_checksum(blob):
                raise damaged(tests, row.id, test.hanger)
            return None if blob is None else unpack_response(blob, row.file_name, test.test)

    def posteriors(self, hanger: int) -> tuple[StoredPosterior, ...]:
        """The posteriors of a hanger in its selected class, by time."""
        query = _shown(hanger)
        with self.reading() as connection:
            rows = connection.execute(query.order_by(posteriors.c.time, posteriors.c.id)).all()
        return tuple(_stored_posterior(row) for row in rows)

    def posterior(self, hanger: int, test: str | None = None) -> Posterior:
        """The latest posterior of a hanger, or that of one test; raises NothingThere."""
        query = _shown(hanger)
        if test is not None:
            query = query.where(posteriors.c.id.in_(_of_test(hanger, test)))
        # First which one, then its samples: else those of all would be sorted.
        named = query.with_only_columns(posteriors.c.id)
        latest = named.order_by(posteriors.c.time.desc(), posteriors.c.id.desc()).limit(1)
        chosen = sa.select(posteriors).where(posteriors.c.id == latest.scalar_subquery())
        with self.reading() as connection:
            row = connection.execute(chosen).one_or_none()
        if row is None:
            what = f"hanger {hanger}" + (f", test {test}" if test else "")
            raise NothingThere(f"no posterior of {what} yet.", remedy="Ingest a test of it.")
        return posterior_of_row(row)

    def posterior_of(self, test: StoredTest) -> Posterior:
        """The posterior of a test known by its row; raises NothingThere."""
        return self.posterior(test.hanger, test.test.id)

    def history(self, hanger: int) -> tuple[tuple[StoredTest, Posterior], ...]:
        """Each test of a hanger that has a posterior, with it, by time."""
        newest = (
            sa.select(posterior_tests.c.test_id, sa.func.max(posterior_tests.c.posterior_id))
            .join(posteriors)
            .where(posteriors.c.id.in_(_shown(hanger).with_only_columns(posteriors.c.id)))
            .group_by(posterior_tests.c.test_id)
        )
        stored = {row.id: row.posterior for row in self.posteriors(hanger)}
        with self.reading() as connection:
            newest_of = {row[0]: row[1] for row in connection.execute(newest)}
        return tuple(
            (test, stored[newest_of[test.id]])
            for test in self.tests(hanger)
            if newest_of.get(test.id) in stored
        )

    def selection(self, hanger: int) -> StoredSelection | None:
        """The selection in force."""
        with self.reading() as connection:
            return selection_of(connection, hanger)

    def selected_models(self) -> dict[int, str]:
        """The name of the selected or adopted class of each hanger that has one."""
        query = sa.select(selections.c.hanger, selections.c.model).order_by(selections.c.id)
        in_force = query.where(selections.c.id.not_in(_undone_selections))
        with self.reading() as connection:
            return {row.hanger: row.model for row in connection.execute(in_force)}

    def baseline(
        self, hanger: int, model: str | None = None, time: datetime | None = None
    ) -> Baseline | None:
        """The baseline in force, or the last that was in force of one class, with its posterior.

        With `time` it is that for a test of then: a baseline set anew is none for earlier tests.
        """
        query = (
            sa.select(posteriors, *(baselines.c[name].label(f"b_{name}") for name in _BASELINE))
            .join(baselines)
            .where(baselines.c.hanger == hanger)
            .order_by(baselines.c.id.desc())
            .limit(1)
        )
        query = query.where(_in_force(hanger) if model is None else posteriors.c.model == model)
        if time is not None:
            query = query.where(baselines.c.since.is_(None) | (baselines.c.since <= time))
        with self.reading() as connection:
            row = connection.execute(query).one_or_none()
        return None if row is None else _baseline(row, hanger)

    def _tests(self, query: sa.Select[Any]) -> tuple[StoredTest, ...]:
        with self.reading() as connection:
            return tuple(_test(row) for row in connection.execute(query))


def compared_with(baseline: Baseline) -> list[sa.ColumnElement[bool]]:
    """Tests watched since a baseline."""
    own = tests.c.hanger == baseline.hanger, tests.c.stage == Stage.WATCHED, in_force(tests)
    found = [*own, tests.c.name.not_in(baseline.posterior.tests)]
    return found if baseline.since is None else [*found, tests.c.time >= baseline.since]


_BASELINE = ("id", "set_at", "who", "why", "since")


def _baseline(row: Row[Any], hanger: int) -> Baseline:
    values = {name: getattr(row, f"b_{name}") for name in _BASELINE}
    posterior = posterior_of_row(row)
    described = loads(row.document).get(DESCRIBED)
    return Baseline(hanger=hanger, posterior=posterior, described=described, **values)


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
    query = query.where(selections.c.id.not_in(_undone_selections)).group_by(selections.c.hanger)
    return {row.hanger: row.id for row in connection.execute(query)}


def selection_in_force(hanger: int) -> sa.Select[Any]:
    """The newest selection of a hanger that did not come with an adoption since undone."""
    query = sa.select(selections).where(
        selections.c.hanger == hanger, selections.c.id.not_in(_undone_selections)
    )
    return query.order_by(selections.c.id.desc()).limit(1)


def _in_force(hanger: int) -> sa.ColumnElement[bool]:
    """Which baselines count: those of the class in force, unless their adoption was undone."""
    model = sa.select(selection_in_force(hanger).subquery().c.model).scalar_subquery()
    return baselines.c.id.not_in(_undone_baselines) & (posteriors.c.model == model)


def baselines_now(hanger: int | None = None) -> sa.Select[Any]:
    """The numbers of the newest baselines of all hangers or of one, each in its class in force."""
    newest = sa.select(sa.func.max(selections.c.id)).group_by(selections.c.hanger)
    held = newest.where(selections.c.id.not_in(_undone_selections))
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


def _shown(hanger: int) -> sa.Select[Any]:
    refused = (tests.c.hanger == hanger) & (tests.c.stage == Stage.REFUSED) & in_force(tests)
    of_refused = sa.select(posterior_tests.c.posterior_id).join(tests).where(refused)
    return sa.select(posteriors).where(
        posteriors.c.hanger == hanger,
        posteriors.c.id.not_in(hidden),
        posteriors.c.id.not_in(of_refused),
        in_force(posteriors),
    )


def _of_test(hanger: int, name: str) -> sa.Select[Any]:
    joined = posterior_tests.join(tests)
    query = sa.select(posterior_tests.c.posterior_id).select_from(joined)
    return query.where(tests.c.hanger == hanger, tests.c.name == name, in_force(tests))


def lineage_from(row: Row[Any]) -> Lineage:
    return Lineage(row.input_sha256, row.settings_sha256, row.version)


def _test(row: Row[Any]) -> StoredTest:
    with decoding(tests, row, row.hanger):
        return StoredTest(
            id=row.id,
            recording_id=row.recording_id,
            key=f"{row.sha256}/{row.position}",
            hanger=row.hanger,
            time=row.time,
            stage=Stage(row.stage),
            test=test_from_document(loads(row.document), row.hanger),
            notes=tuple(loads(row.notes)),
            lineage=lineage_from(row),
            quality=tuple(quality_from(entry) for entry in loads(row.quality) or ()),
            set_aside=tuple(foreign_from(entry) for entry in loads(row.set_aside) or ()),
        )


def posterior_of_row(row: Row[Any]) -> Posterior:
    """The posterior of a whole row; raises DamagedRow."""
    with decoding(posteriors, row, row.hanger):
        return posterior_from(loads(row.document), row.samples)


def _stored_posterior(row: Row[Any]) -> StoredPosterior:
    return StoredPosterior(row.id, posterior_of_row(row), row.time, lineage_from(row))
