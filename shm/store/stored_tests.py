"""Tests: kept with what was judged of them, listed, found by name, time or samples."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.store.blobs import unpack_response
from shm.store.database import Repository, insert
from shm.store.files import advance_recordings, counts, in_force, test_contents
from shm.store.holding import Judged, fingerprint_from, keep_judgement
from shm.store.journal import write
from shm.store.list_rows import LatestTest, TestRow
from shm.store.queries import (
    WEIGHED,
    baselines_now,
    compared_with,
    counted_tests,
    lineage_from,
    plain_tests,
    read_tests,
    test_columns,
    test_row,
)
from shm.store.rows import (
    Baseline,
    FormerPosterior,
    FormerTest,
    IdentifiedTest,
    Lineage,
    Stage,
    StoredAlert,
    StoredTest,
)
from shm.store.tables import baselines, fingerprints, posterior_tests, posteriors, recordings, tests
from shm.values import Fingerprint, FrequencyResponse, KnownSamples

# Recordings of a hanger: some 20 MB, at most 110; older ones are found by their digest.
_MOST_COMPARED = 1000
_LATEST = 3
_WITHOUT_SAMPLES = ("id", "model", "updated_at", "superseded_at")
_LINEAGE = ("input_sha256", "settings_sha256", "version")


class Tests(Repository):
    """Identified tests."""

    __test__ = False  # no test, though named so

    def save(
        self,
        recording_id: int,
        found: Sequence[IdentifiedTest],
        lineage: Lineage,
        at: datetime,
        judged: Judged | None = None,
    ) -> StoredAlert | None:
        """Keeps the tests of a recording; does nothing where another process was first.

        Nor where it has another sidecar by now than it was `judged` with: it waits to be done with
        that. The notice where tests of it are held.
        """
        with self.writing() as connection:
            query = sa.select(recordings).where(recordings.c.id == recording_id)
            recording = connection.execute(query).one()
            if recording.stage != Stage.RECEIVED:
                return None
            if judged is not None and judged.sidecar_as != recording.sidecar_as:
                return None
            kept = _positions(connection, recording_id)
            for item in (item for item in found if item.position not in kept):
                values = {**_test_values(connection, item, recording), **lineage.columns}
                test_id = insert(connection, tests, {**values, "identified_at": at})
                write(connection, at, Stage.IDENTIFIED, recording_id, test_id)
            hanger = found[0].test.hanger
            by_id = recordings.c.id == recording_id
            connection.execute(sa.update(recordings).where(by_id).values(hanger=hanger))
            notice = keep_judgement(connection, recording, judged, at) if judged else None
            advance_recordings(connection, [recording_id], at)
            return notice

    def get(self, test_id: int) -> StoredTest:
        """One test by its row number; raises NothingThere."""
        found = self._tests(plain_tests.where(tests.c.id == test_id))
        if not found:
            raise NothingThere(f"no test {test_id}.", remedy="See `shm status`.")
        return found[0]

    def named(self, hanger: int, name: str) -> StoredTest:
        """The test in force of that name; raises NothingThere."""
        found = self._tests(plain_tests.where(_shown(hanger), tests.c.name == name))
        if not found:
            latest = ", ".join(row.name for row in reversed(self.list_rows(hanger, _LATEST)))
            raise NothingThere(
                f"no test {name} of hanger {hanger} is stored.",
                remedy=f"The latest: {latest or 'none'}.",
            )
        return found[0]

    def list_all(
        self, hanger: int | None = None, ids: Collection[int] | None = None
    ) -> tuple[StoredTest, ...]:
        """Return the tests of a hanger, those of some numbers, or all, by time; those refused are
        left out."""
        query = counted_tests(hanger)
        return self._tests(query if ids is None else query.where(tests.c.id.in_(ids)))

    def list_rows(
        self, hanger: int, limit: int = 50, before: int | None = None
    ) -> tuple[TestRow, ...]:
        """Tests of a hanger by name, the newest first; `before` is the test to go on after."""
        query = sa.select(*test_columns).where(_shown(hanger))
        if before is not None:
            query = query.where(_is_before(before))
        newest = query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(limit)
        return tuple(map(test_row, self.rows(newest)))

    def list_waiting(
        self, limit: int | None = None, excluding: Collection[int] = ()
    ) -> tuple[TestRow, ...]:
        """Tests identified or updated, not yet watched: by hanger, then by time.

        With a `limit` no more than the first so many of each hanger and stage; those of the
        recordings `excluding` are left out.
        """
        groups, by_time = (tests.c.hanger, tests.c.stage), (tests.c.time, tests.c.id)
        place = sa.func.row_number().over(partition_by=groups, order_by=by_time).label("place")
        on_the_way = tests.c.stage.in_([Stage.IDENTIFIED, Stage.UPDATED])
        query = sa.select(*test_columns).add_columns(place)
        query = query.where(on_the_way, in_force(tests), tests.c.recording_id.not_in(excluding))
        found = query.subquery()
        chosen = sa.select(found).order_by(found.c.hanger, found.c.time, found.c.id)
        if limit is not None:
            chosen = chosen.where(found.c.place <= limit)
        return tuple(map(test_row, self.rows(chosen)))

    def list_former(self, recording_id: int) -> tuple[FormerTest, ...]:
        """Every identification of a recording's tests and what was made of it, oldest first."""
        found = sa.select(tests).where(tests.c.recording_id == recording_id).order_by(tests.c.id)
        columns = [posteriors.c[name] for name in (*_WITHOUT_SAMPLES, *_LINEAGE)]
        made: sa.Select[Any] = (
            sa.select(posterior_tests.c.test_id, *columns)
            .select_from(posterior_tests.join(posteriors).join(tests))
            .where(tests.c.recording_id == recording_id)
            .order_by(posteriors.c.id)
        )
        with self.reading() as connection:
            rows = connection.execute(found).all()
            by_test: defaultdict[int, list[FormerPosterior]] = defaultdict(list)
            for row in connection.execute(made):
                by_test[row.test_id].append(_former_posterior(row))
        return tuple(_former_test(row, by_test[row.id]) for row in rows)

    def of_baseline(self, baseline: Baseline) -> tuple[StoredTest, ...]:
        """The tests from which a baseline was made, as they were then, by time."""
        made = (
            sa.select(posterior_tests.c.test_id)
            .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
            .where(baselines.c.id == baseline.id)
        )
        return self._tests(
            plain_tests.where(tests.c.id.in_(made)).order_by(tests.c.time, tests.c.id)
        )

    def refused_of_baselines(self) -> tuple[tuple[int, str, int], ...]:
        """Return hanger, name and recording of each refused test of a baseline in force."""
        made = (
            sa.select(posterior_tests.c.test_id)
            .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
            .where(baselines.c.id.in_(baselines_now()))
        )
        query = sa.select(tests.c.hanger, tests.c.name, tests.c.recording_id)
        refused = tests.c.id.in_(made), tests.c.stage == Stage.REFUSED
        rows = self.rows(query.where(*refused).order_by(tests.c.time, tests.c.id))
        return tuple((row.hanger, row.name, row.recording_id) for row in rows)

    def taken_at(self, hanger: int, time: datetime, recording_id: int) -> tuple[StoredTest, ...]:
        """Tests of a hanger with the very same time, in other recordings."""
        others = _before(tests.c.recording_id, tests.c.stage, recording_id)
        same = (tests.c.hanger == hanger) & (tests.c.taken_at == time) & in_force(tests)
        return self._tests(plain_tests.where(same, others).order_by(tests.c.id))

    def latest(self) -> dict[int, LatestTest]:
        """How many tests in force each hanger has, and when the latest was taken."""
        shown = counts(tests) & in_force(tests)
        counted = (tests.c.hanger, sa.func.count().label("tests"), sa.func.max(tests.c.time))
        rows = self.rows(sa.select(*counted).where(shown).group_by(tests.c.hanger))
        return {row[0]: LatestTest(int(row[1]), row[2]) for row in rows}

    def names_without_time(self) -> dict[int, tuple[str, ...]]:
        """Return the names of the tests that are dated by their receipt, by hanger."""
        undated = counts(tests) & in_force(tests) & tests.c.taken_at.is_(None)
        query = sa.select(tests.c.hanger, tests.c.name).where(undated).order_by(tests.c.id)
        found: dict[int, tuple[str, ...]] = {}
        for hanger, name in self.rows(query):
            found[hanger] = (*found.get(hanger, ()), name)
        return found

    def list_latest(
        self, hanger: int, recording_id: int, limit: int, *, as_received: bool = False
    ) -> tuple[StoredTest, ...]:
        """Return the latest tests of a hanger that count, but for those of one recording, by time
        or, `as_received`, as they came in."""
        order = tests.c.recording_id if as_received else tests.c.time
        mine = (tests.c.hanger == hanger) & (tests.c.recording_id != recording_id)
        query = plain_tests.where(mine, counts(tests), in_force(tests))
        latest = query.order_by(order.desc(), tests.c.id.desc()).limit(limit)
        return self._tests(latest)[::-1]

    def dated_beside(
        self, baseline: Baseline, test: StoredTest, limit: int
    ) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
        """So many tests since a baseline before a test and after it, by time, the nearest first:
        those that were watched, and those that were passed over for planned works."""
        compared = compared_with(baseline, or_of_works=True)
        query = plain_tests.where(*compared, tests.c.id != test.id)
        order = sa.tuple_(tests.c.time, tests.c.id)
        return self._around(query, order, (test.time, test.id), limit)

    def received_beside(
        self, baseline: Baseline, test: StoredTest, limit: int, held: Collection[int] = ()
    ) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
        """The same as they came in, those among them that are held of the recordings `held`."""
        is_held = (tests.c.hanger == baseline.hanger) & (tests.c.stage == Stage.HELD)
        is_held &= tests.c.recording_id.in_(held) & in_force(tests)
        counted = sa.and_(*compared_with(baseline, or_of_works=True))
        query = plain_tests.where(counted | is_held, tests.c.id != test.id)
        order = sa.tuple_(tests.c.recording_id, tests.c.id)
        return self._around(query, order, (test.recording_id, test.id), limit)

    def latest_weighed(self, hangers: Collection[int], before: datetime) -> StoredTest | None:
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
        return frozenset(self.scalars(query))

    def beside(self, test: StoredTest) -> tuple[str | None, str | None]:
        """The names of the tests of the same hanger before and after one, by time."""
        names = sa.select(tests.c.name).where(_shown(test.hanger)).limit(1)
        place = sa.tuple_(tests.c.time, tests.c.id)
        here = sa.tuple_(sa.literal(test.time, tests.c.time.type), sa.literal(test.id))
        former = names.where(place < here).order_by(tests.c.time.desc(), tests.c.id.desc())
        later = names.where(place > here).order_by(tests.c.time, tests.c.id)
        with self.reading() as connection:
            return connection.scalar(former), connection.scalar(later)

    def frequency_response(self, test: StoredTest) -> FrequencyResponse | None:
        """What the modes of a test were identified from; None where a file gave the modes."""
        query = sa.select(tests.c.frequency_response, recordings.c.file_name).join(recordings)
        blob, file_name = self.first(query.where(tests.c.id == test.id))
        return None if blob is None else unpack_response(blob, file_name, test.test)

    def known_samples(
        self, recording_id: int, hanger: int, fingerprint: Fingerprint
    ) -> tuple[KnownSamples, ...]:
        """Recordings that may hold the same samples: those of the hanger, and the same numbers of
        any other; the earliest first, as the others may be copies of it."""
        same_numbers = fingerprints.c.digest == fingerprint.digest
        query = (
            sa.select(fingerprints, *(recordings.c[n] for n in ("file_name", "hanger", "stage")))
            .join(recordings)
            .where(
                (recordings.c.hanger == hanger) | same_numbers,
                _before(recordings.c.id, recordings.c.stage, recording_id),
            )
            .order_by(same_numbers.desc(), recordings.c.id.desc())
            .limit(_MOST_COMPARED)
        )
        rows = self.rows(query)
        return tuple(
            KnownSamples(
                f"{row.file_name} (recording {row.recording_id})",
                row.hanger,
                fingerprint_from(row),
                row.recording_id,
                row.stage != Stage.HELD,
            )
            for row in sorted(rows, key=lambda row: int(row.recording_id))
        )

    def _around(
        self, query: sa.Select[Any], order: sa.Tuple, here: tuple[object, int], limit: int
    ) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
        down, up = ([getattr(each, way)() for each in order.clauses] for way in ("desc", "asc"))
        before = self._tests(query.where(order < here).order_by(*down).limit(limit))
        return before, self._tests(query.where(order > here).order_by(*up).limit(limit))

    def _tests(self, query: sa.Select[Any]) -> tuple[StoredTest, ...]:
        with self.reading() as connection:
            return read_tests(connection, query)


def _positions(connection: Connection, recording_id: int) -> set[int]:
    query = sa.select(tests.c.position).where(tests.c.recording_id == recording_id, in_force(tests))
    return set(connection.scalars(query))


def _test_values(
    connection: Connection, item: IdentifiedTest, recording: Row[Any]
) -> dict[str, Any]:
    name = _free_name(connection, item, recording)
    return {
        "recording_id": recording.id,
        "position": item.position,
        "name": name,
        "time": item.test.time or recording.received_at,
        "stage": Stage.IDENTIFIED,
        **test_contents(item, name),
    }


def _free_name(connection: Connection, item: IdentifiedTest, recording: Row[Any]) -> str:
    """The test's own name or, where its hanger has one such, that name and its file's checksum.

    A test identified again keeps the one of these that it had.
    """
    own, plain = f"{item.test.id}-{recording.sha256[:8]}-{item.position}", item.test.id
    query = sa.select(tests.c.name).where(tests.c.hanger == item.test.hanger)
    here = (tests.c.recording_id == recording.id) & (tests.c.position == item.position)
    former = connection.scalar(query.where(here).order_by(tests.c.id.desc()).limit(1))
    taken = query.where(tests.c.name == plain, in_force(tests))
    free = former != own and connection.execute(taken).first() is None
    return plain if free else own


def _shown(hanger: int) -> sa.ColumnElement[bool]:
    return (tests.c.hanger == hanger) & in_force(tests) & counts(tests)


def _is_before(test_id: int) -> sa.ColumnElement[bool]:
    other = tests.alias()
    time = sa.select(other.c.time).where(other.c.id == test_id).scalar_subquery()
    return (tests.c.time < time) | ((tests.c.time == time) & (tests.c.id < test_id))


def _before(
    id_: sa.Column[int], stage: sa.Column[str], recording_id: int
) -> sa.ColumnElement[bool]:
    """Other rows that count or, of those received before, are held: never a copy made later."""
    held_before = (stage == Stage.HELD) & (id_ < recording_id)
    return (id_ != recording_id) & (stage.not_in([Stage.REFUSED, Stage.HELD]) | held_before)


def _former_posterior(row: Row[Any]) -> FormerPosterior:
    return FormerPosterior(row.id, row.model, row.updated_at, row.superseded_at, lineage_from(row))


def _former_test(row: Row[Any], made: Sequence[FormerPosterior]) -> FormerTest:
    return FormerTest(
        id=row.id,
        recording_id=row.recording_id,
        name=row.name,
        stage=Stage(row.stage),
        identified_at=row.identified_at,
        superseded_at=row.superseded_at,
        lineage=lineage_from(row),
        posteriors=tuple(made),
    )
