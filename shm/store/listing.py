"""Lists for those who look: tests page by page, watches of all hangers, what has happened."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping
from datetime import datetime
from typing import Any, TypeVar

import sqlalchemy as sa

from shm.errors import DamagedRow, NothingThere
from shm.store.blobs import change_from
from shm.store.checksums import decoding, loads, note_damage
from shm.store.files import counts, in_force
from shm.store.glances import EventKind, HangerEvent, TestRow
from shm.store.queries import Queries, baselines_now, compared_with, plain_tests
from shm.store.rows import Baseline, Stage, StoredTest, StoredWatch
from shm.store.tables import acknowledgements, adoptions, alerts, baselines, tests, watches
from shm.store.watching import Watching
from shm.values import Change

_ROW = tuple(tests.c[name] for name in ("id", "recording_id", "hanger", "name", "time", "stage"))
_LATEST = 3
_T = TypeVar("_T")


def of_readable(
    ask: Callable[[Collection[int]], Mapping[int, _T]], damaged: dict[int, DamagedRow]
) -> Mapping[int, _T]:
    """What `ask` says of all hangers but those with a damaged row, which are put into `damaged`."""
    while True:
        try:
            return ask(damaged)
        except DamagedRow as error:
            if error.hanger is None or error.hanger in damaged:
                raise
            note_damage(error)
            damaged[error.hanger] = error


class Listing(Queries, Watching):
    """The part of the store that lists."""

    def test_rows(
        self, hanger: int, limit: int = 50, before: int | None = None
    ) -> tuple[TestRow, ...]:
        """Tests of a hanger by name, the newest first; `before` is the test to go on after."""
        query = sa.select(*_ROW).where(_shown(hanger))
        if before is not None:
            query = query.where(_is_before(before))
        newest = query.order_by(tests.c.time.desc(), tests.c.id.desc()).limit(limit)
        with self.reading() as connection:
            rows = connection.execute(newest).all()
        return tuple(
            TestRow(row.id, row.recording_id, row.hanger, row.name, row.time, Stage(row.stage))
            for row in rows
        )

    def test_named(self, hanger: int, name: str) -> StoredTest:
        """The test in force of that name; raises NothingThere."""
        found = self._tests(plain_tests.where(_shown(hanger), tests.c.name == name))
        if not found:
            latest = ", ".join(row.name for row in reversed(self.test_rows(hanger, _LATEST)))
            raise NothingThere(
                f"no test {name} of hanger {hanger} is stored.",
                remedy=f"The latest: {latest or 'none'}.",
            )
        return found[0]

    def tests_dated_beside(
        self, baseline: Baseline, test: StoredTest, limit: int
    ) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
        """So many tests watched since a baseline before a test and after it, by time, the nearest
        first."""
        query = plain_tests.where(*compared_with(baseline), tests.c.id != test.id)
        order = sa.tuple_(tests.c.time, tests.c.id)
        return self._beside(query, order, (test.time, test.id), limit)

    def tests_that_came_beside(
        self, baseline: Baseline, test: StoredTest, limit: int, held: Collection[int] = ()
    ) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
        """The same as they came in, those among them that are held of the recordings `held`."""
        is_held = (tests.c.hanger == baseline.hanger) & (tests.c.stage == Stage.HELD)
        is_held &= tests.c.recording_id.in_(held) & in_force(tests)
        counted = sa.and_(*compared_with(baseline))
        query = plain_tests.where(counted | is_held, tests.c.id != test.id)
        order = sa.tuple_(tests.c.recording_id, tests.c.id)
        return self._beside(query, order, (test.recording_id, test.id), limit)

    def _beside(
        self, query: sa.Select[Any], order: sa.Tuple, here: tuple[object, int], limit: int
    ) -> tuple[tuple[StoredTest, ...], tuple[StoredTest, ...]]:
        down, up = ([getattr(each, way)() for each in order.clauses] for way in ("desc", "asc"))
        before = self._tests(query.where(order < here).order_by(*down).limit(limit))
        return before, self._tests(query.where(order > here).order_by(*up).limit(limit))

    def beside(self, test: StoredTest) -> tuple[str | None, str | None]:
        """The names of the tests of the same hanger before and after one, by time."""
        names = sa.select(tests.c.name).where(_shown(test.hanger)).limit(1)
        place = sa.tuple_(tests.c.time, tests.c.id)
        here = sa.tuple_(sa.literal(test.time, tests.c.time.type), sa.literal(test.id))
        former = names.where(place < here).order_by(tests.c.time.desc(), tests.c.id.desc())
        later = names.where(place > here).order_by(tests.c.time, tests.c.id)
        with self.reading() as connection:
            return connection.scalar(former), connection.scalar(later)

    def latest_watches(self, excluding: Collection[int] = ()) -> dict[int, StoredWatch]:
        """What the watch says of each hanger's latest test against its baseline in force.

        Raises DamagedRow, which names a hanger: ask again, `excluding` it.
        """
        held = baselines.alias()
        latest = (
            sa.select(watches.c.id)
            .where(
                watches.c.hanger == held.c.hanger,
                watches.c.baseline_id == held.c.id,
                in_force(watches),
            )
            .order_by(watches.c.time.desc(), watches.c.id.desc())
            .limit(1)
            .scalar_subquery()
        )
        wanted = held.c.id.in_(baselines_now()), held.c.hanger.not_in(excluding)
        ids = sa.select(latest).select_from(held).where(*wanted)
        with self.reading() as connection:
            found = [id_ for id_ in connection.scalars(ids) if id_ is not None]
        return {each.hanger: each for each in self.watches_of(found)}

    def called_watches(self, hanger: int) -> tuple[StoredWatch, ...]:
        """The watches of a hanger that call a change against its baseline in force, by time."""
        chosen = sa.select(watches.c.id).where(watches.c.hanger == hanger, *_called(hanger))
        return self.watches_of(chosen)

    def called_changes(self, excluding: Collection[int] = ()) -> dict[int, tuple[Change, ...]]:
        """The changes called of each hanger against its baseline in force, by time.

        Raises DamagedRow, which names a hanger: ask again, `excluding` it.
        """
        query = sa.select(watches).where(*_called(), watches.c.hanger.not_in(excluding))
        found = defaultdict[int, list[Change]](list)
        with self.reading() as connection:
            for row in connection.execute(query.order_by(watches.c.time, watches.c.id)):
                with decoding(watches, row, row.hanger):
                    found[row.hanger].append(change_from(loads(row.document)))
        return {hanger: tuple(changes) for hanger, changes in found.items()}

    def telling_watches(self, baseline: Baseline) -> tuple[StoredWatch, ...]:
        """The watches that call a change against a baseline, and the latest against it, by time."""
        against = sa.select(watches.c.id).where(
            watches.c.hanger == baseline.hanger,
            watches.c.baseline_id == baseline.id,
            in_force(watches),
        )
        latest = against.order_by(watches.c.time.desc(), watches.c.id.desc()).limit(1)
        with self.reading() as connection:
            ids = {*connection.scalars(against.where(watches.c.called)), connection.scalar(latest)}
        return self.watches_of([id_ for id_ in ids if id_ is not None])

    def open_alert_counts(self) -> dict[int, int]:
        """How many alerts of each hanger nobody has acknowledged; hangers without are left out."""
        query = sa.select(alerts.c.hanger, sa.func.count()).outerjoin(acknowledgements)
        is_open = acknowledgements.c.id.is_(None)
        with self.reading() as connection:
            rows = connection.execute(query.where(is_open).group_by(alerts.c.hanger))
            return {row[0]: int(row[1]) for row in rows}

    def hanger_events(self, hanger: int, since: datetime | None = None) -> tuple[HangerEvent, ...]:
        """What happened to a hanger beside its tests, by time."""
        with self.reading() as connection:
            found = [
                HangerEvent(row.at, kind, row.who or "", row.why or "", row.id)
                for kind, query in _events(hanger).items()
                for row in connection.execute(query)
            ]
        late = (event for event in found if since is None or event.at >= since)
        return tuple(sorted(late, key=lambda event: event.at))


def _shown(hanger: int) -> sa.ColumnElement[bool]:
    return (tests.c.hanger == hanger) & in_force(tests) & counts(tests)


def _called(hanger: int | None = None) -> tuple[sa.ColumnElement[bool], ...]:
    """Which watches call a change against the baseline in force, of all hangers or of one."""
    against = watches.c.baseline_id.in_(baselines_now(hanger))
    return watches.c.called, against, in_force(watches)


def _is_before(test_id: int) -> sa.ColumnElement[bool]:
    other = tests.alias()
    time = sa.select(other.c.time).where(other.c.id == test_id).scalar_subquery()
    return (tests.c.time < time) | ((tests.c.time == time) & (tests.c.id < test_id))


def _events(hanger: int) -> dict[EventKind, sa.Select[Any]]:
    noted = sa.select(acknowledgements).join(alerts).where(alerts.c.hanger == hanger)
    undone = _named(adoptions, "undone_at", "undone_who", "undone_why")
    raised = sa.select(
        alerts.c.id,
        alerts.c.time.label("at"),
        sa.null().label("who"),
        alerts.c.message.label("why"),
    )
    return {
        EventKind.BASELINE: _of(hanger, baselines, _named(baselines, "set_at", "who", "why")),
        EventKind.ADOPTED: _of(hanger, adoptions, _named(adoptions, "adopted_at", "who", "why")),
        EventKind.UNDONE: _of(hanger, adoptions, undone.where(adoptions.c.undone_at.is_not(None))),
        EventKind.ALERT: _of(hanger, alerts, raised),
        EventKind.ACKNOWLEDGED: noted,
    }


def _of(hanger: int, table: sa.Table, query: sa.Select[Any]) -> sa.Select[Any]:
    return query.where(table.c.hanger == hanger).order_by(table.c.id)


def _named(table: sa.Table, at: str, who: str, why: str) -> sa.Select[Any]:
    named = {"at": at, "who": who, "why": why}
    return sa.select(table.c.id, *(table.c[name].label(label) for label, name in named.items()))
