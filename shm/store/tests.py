"""Identified tests: stored, read back, and which of them the watch and the checks compare."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.store.blobs import unpack_response
from shm.store.columns import value_in
from shm.store.database import Repository, insert
from shm.store.disposition import Judgement, decided_with, fingerprint_from, keep_judgement
from shm.store.files import advance_recordings, is_counted, is_current, test_contents
from shm.store.journal import write
from shm.store.rows import (
    Baseline,
    Hold,
    IdentifiedTest,
    LatestTest,
    Lineage,
    Stage,
    StoredAlert,
    StoredTest,
    TestRow,
    WatchCheckpoint,
)
from shm.store.selects import (
    WEIGHED,
    baselines_now,
    counted_tests,
    load_tests,
    plain_tests,
    select_since_baseline,
    test_columns,
)
from shm.store.tables import (
    baselines,
    fingerprints,
    posterior_tests,
    recordings,
    tests,
    watch_states,
    watches,
)
from shm.values import Fingerprint, FrequencyResponse, KnownSamples

_LATEST = 3


class Tests(Repository):
    """Identified tests."""

    __test__ = False  # no test, though named so

    def save(
        self,
        recording_id: int,
        found: Sequence[IdentifiedTest],
        lineage: Lineage,
        at: datetime,
        judged: Judgement | None = None,
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
            stored = _positions(connection, recording_id)
            for item in (item for item in found if item.position not in stored):
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
        found = load_tests(self, plain_tests.where(tests.c.id == test_id))
        if not found:
            raise NothingThere(f"no test {test_id}.", remedy="See `shm status`.")
        return found[0]

    def named(self, hanger: int, name: str) -> StoredTest:
        """The test in force of that name; raises NothingThere."""
        found = load_tests(self, plain_tests.where(shown_tests(hanger), tests.c.name == name))
        if not found:
            query = sa.select(tests.c.name).where(shown_tests(hanger))
            newest = self.scalars(
                query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(_LATEST)
            )
            latest = ", ".join(reversed(newest))
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
        return load_tests(self, query if ids is None else query.where(tests.c.id.in_(ids)))


def _positions(connection: Connection, recording_id: int) -> set[int]:
    query = sa.select(tests.c.position).where(
        tests.c.recording_id == recording_id, is_current(tests)
    )
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
    unique, plain = f"{item.test.id}-{recording.sha256[:8]}-{item.position}", item.test.id
    query = sa.select(tests.c.name).where(tests.c.hanger == item.test.hanger)
    here = (tests.c.recording_id == recording.id) & (tests.c.position == item.position)
    former = connection.scalar(query.where(here).order_by(tests.c.id.desc()).limit(1))
    taken = query.where(tests.c.name == plain, is_current(tests))
    free = former != unique and connection.execute(taken).first() is None
    return plain if free else unique


def shown_tests(hanger: int) -> sa.ColumnElement[bool]:
    return (tests.c.hanger == hanger) & is_current(tests) & is_counted(tests)


def list_test_rows(
    store: Repository, hanger: int, limit: int = 50, before: int | None = None
) -> tuple[TestRow, ...]:
    """List tests of a hanger, the newest first; `before` is the test to go on after."""
    query = sa.select(*test_columns).where(shown_tests(hanger))
    if before is not None:
        query = query.where(_is_before(before))
    newest = query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(limit)
    return tuple(value_in(row, TestRow) for row in store.rows(newest))


def list_waiting_tests(
    store: Repository, limit: int | None = None, excluding: Collection[int] = ()
) -> tuple[TestRow, ...]:
    """List tests identified or updated, not yet watched: by hanger, then by time.

    With a `limit` no more than the first so many of each hanger and stage; those of the
    recordings `excluding` are left out.
    """
    groups, by_time = (tests.c.hanger, tests.c.stage), (tests.c.time, tests.c.id)
    place = sa.func.row_number().over(partition_by=groups, order_by=by_time).label("place")
    on_the_way = tests.c.stage.in_([Stage.IDENTIFIED, Stage.UPDATED])
    query = sa.select(*test_columns).add_columns(place)
    query = query.where(on_the_way, is_current(tests), tests.c.recording_id.not_in(excluding))
    found = query.subquery()
    chosen = sa.select(found).order_by(found.c.hanger, found.c.time, found.c.id)
    if limit is not None:
        chosen = chosen.where(found.c.place <= limit)
    return tuple(value_in(row, TestRow) for row in store.rows(chosen))


def list_baseline_tests(store: Repository, baseline: Baseline) -> tuple[StoredTest, ...]:
    """List the tests from which a baseline was made, as they were then, by time."""
    made = (
        sa.select(posterior_tests.c.test_id)
        .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
        .where(baselines.c.id == baseline.id)
    )
    return load_tests(
        store, plain_tests.where(tests.c.id.in_(made)).order_by(tests.c.time, tests.c.id)
    )


def list_refused_of_baselines(store: Repository) -> tuple[tuple[int, str, int], ...]:
    """Return hanger, name and recording of each refused test of a baseline in force."""
    made = (
        sa.select(posterior_tests.c.test_id)
        .join(baselines, baselines.c.posterior_id == posterior_tests.c.posterior_id)
        .where(baselines.c.id.in_(baselines_now()))
    )
    query = sa.select(tests.c.hanger, tests.c.name, tests.c.recording_id)
    refused = tests.c.id.in_(made), tests.c.stage == Stage.REFUSED
    rows = store.rows(query.where(*refused).order_by(tests.c.time, tests.c.id))
    return tuple((row.hanger, row.name, row.recording_id) for row in rows)


def count_tests(store: Repository) -> dict[int, LatestTest]:
    """Count the tests in force of each hanger, with the time of the latest."""
    shown = is_counted(tests) & is_current(tests)
    counted = (tests.c.hanger, sa.func.count().label("tests"), sa.func.max(tests.c.time))
    rows = store.rows(sa.select(*counted).where(shown).group_by(tests.c.hanger))
    return {row[0]: LatestTest(int(row[1]), row[2]) for row in rows}


def list_undated_names(store: Repository) -> dict[int, tuple[str, ...]]:
    """Return the names of the tests that are dated by their receipt, by hanger."""
    undated = is_counted(tests) & is_current(tests) & tests.c.taken_at.is_(None)
    query = sa.select(tests.c.hanger, tests.c.name).where(undated).order_by(tests.c.id)
    found: dict[int, tuple[str, ...]] = {}
    for hanger, name in store.rows(query):
        found[hanger] = (*found.get(hanger, ()), name)
    return found


def find_neighbours(store: Repository, test: StoredTest) -> tuple[str | None, str | None]:
    """Return the names of the tests of the same hanger before and after one, by time."""
    names = sa.select(tests.c.name).where(shown_tests(test.hanger)).limit(1)
    place = sa.tuple_(tests.c.time, tests.c.id)
    here = sa.tuple_(sa.literal(test.time, tests.c.time.type), sa.literal(test.id))
    former = names.where(place < here).order_by(tests.c.time.desc(), tests.c.id.desc())
    later = names.where(place > here).order_by(tests.c.time, tests.c.id)
    with store.reading() as connection:
        return connection.scalar(former), connection.scalar(later)


def load_frequency_response(store: Repository, test: StoredTest) -> FrequencyResponse | None:
    """Load what the modes of a test were identified from; None where a file gave the modes."""
    query = sa.select(tests.c.frequency_response, recordings.c.file_name).join(recordings)
    blob, file_name = store.first(query.where(tests.c.id == test.id))
    return None if blob is None else unpack_response(blob, file_name, test.test)


def _is_before(test_id: int) -> sa.ColumnElement[bool]:
    other = tests.alias()
    time = sa.select(other.c.time).where(other.c.id == test_id).scalar_subquery()
    return (tests.c.time < time) | ((tests.c.time == time) & (tests.c.id < test_id))


# Recordings of a hanger: some 20 MB, at most 110; older ones are found by their digest.
_MOST_COMPARED = 1000


def list_decisions(
    store: Repository, recording_id: int, sidecar_as: str | None
) -> Mapping[int, Hold]:
    """Return the newest decision on each test of a recording with one sidecar, by its place."""
    with store.reading() as connection:
        return decided_with(connection, recording_id, sidecar_as)


def list_tests_taken_at(
    store: Repository, hanger: int, time: datetime, recording_id: int
) -> tuple[StoredTest, ...]:
    """List the tests of a hanger with the very same time, in other recordings."""
    others = _before(tests.c.recording_id, tests.c.stage, recording_id)
    same = (tests.c.hanger == hanger) & (tests.c.taken_at == time) & is_current(tests)
    return load_tests(store, plain_tests.where(same, others).order_by(tests.c.id))


def list_latest_tests(
    store: Repository, hanger: int, recording_id: int, limit: int, *, as_received: bool = False
) -> tuple[StoredTest, ...]:
    """Return the latest tests of a hanger that count, but for those of one recording, by time
    or, `as_received`, as they came in."""
    order = tests.c.recording_id if as_received else tests.c.time
    mine = (tests.c.hanger == hanger) & (tests.c.recording_id != recording_id)
    query = plain_tests.where(mine, is_counted(tests), is_current(tests))
    latest = query.order_by(order.desc(), tests.c.id.desc()).limit(limit)
    return load_tests(store, latest)[::-1]


def list_known_samples(
    store: Repository, recording_id: int, hanger: int, fingerprint: Fingerprint
) -> tuple[KnownSamples, ...]:
    """List recordings that may hold the same samples, the earliest first.

    Those of the hanger, and those of any other with the same digest.
    """
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
    rows = store.rows(query)
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


def _before(
    id_: sa.Column[int], stage: sa.Column[str], recording_id: int
) -> sa.ColumnElement[bool]:
    """Select other rows that count or, of those received before, are held."""
    held_before = (stage == Stage.HELD) & (id_ < recording_id)
    return (id_ != recording_id) & (stage.not_in([Stage.REFUSED, Stage.HELD]) | held_before)


def list_nearest_tests(
    store: Repository,
    baseline: Baseline,
    test: StoredTest,
    limit: int,
    *,
    as_received: bool = False,
    held: Collection[int] = (),
) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
    """List so many tests since a baseline before and after a test, the nearest first.

    By time or, `as_received`, as they came in. Those passed over for planned works are among them,
    and those that are held of the recordings `held`.
    """
    is_held = (tests.c.hanger == baseline.hanger) & (tests.c.stage == Stage.HELD)
    is_held &= tests.c.recording_id.in_(held) & is_current(tests)
    counted = sa.and_(*select_since_baseline(baseline, include_maintenance=True))
    query = plain_tests.where(counted | is_held, tests.c.id != test.id)
    first, here = (
        (tests.c.recording_id, test.recording_id) if as_received else (tests.c.time, test.time)
    )
    order, place = sa.tuple_(first, tests.c.id), (here, test.id)
    down, up = ([getattr(each, way)() for each in order.clauses] for way in ("desc", "asc"))
    before = load_tests(store, query.where(order < place).order_by(*down).limit(limit))
    return before, load_tests(store, query.where(order > place).order_by(*up).limit(limit))


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
    of_test = (watches.c.test_id == test.id) & (watches.c.baseline_id == baseline.id)
    return store.first(sa.select(watches.c.id).where(of_test)) is not None


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
    return tuple(
        value_in(row, TestRow) for row in store.rows(query.order_by(tests.c.time, tests.c.id))
    )
