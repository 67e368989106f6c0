"""Damaged rows: those that stopped a hanger, and how they are made whole again.

What can be computed anew is written over the damaged row, whose number others refer to; what the
next test makes anyway is thrown away.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.errors import DamagedRow
from shm.store.checking import damaged_among
from shm.store.checksums import healed, plain_table
from shm.store.database import Database, insert
from shm.store.numbering import forget
from shm.store.results import posterior_values, test_contents
from shm.store.rows import IdentifiedTest, Lineage, StoredTest
from shm.store.tables import (
    drifts,
    events,
    metadata,
    posterior_tests,
    posteriors,
    summaries,
    tests,
    watch_states,
    watches,
)
from shm.values import Posterior

_KIND = "damaged"


@dataclass(frozen=True)
class DamagedPosterior:
    """A posterior that must be made again: of which class, and of which tests, by their rows."""

    id: int
    model: str
    tests: tuple[int, ...]


class Damage(Database):
    """The part of the store that knows of damaged rows and heals them."""

    def note_damage(self, error: DamagedRow, at: datetime) -> bool:
        """Notes a damaged row that stopped a hanger; whether it was not noted before."""
        place = f"{error.table}/{error.id}"
        same = sa.select(events.c.id).where(events.c.kind == _KIND, events.c.file_name == place)
        with self.writing() as connection:
            if connection.execute(same).first() is not None:
                return False
            values = {"at": at, "kind": _KIND, "file_name": place, "message": str(error)}
            insert(connection, events, values)
        return True

    def known_damage(self) -> tuple[DamagedRow, ...]:
        """The rows that were noted and are damaged still; each is looked at once more."""
        query = sa.select(events.c.file_name).where(events.c.kind == _KIND).distinct()
        with self.reading() as connection:
            places = [place.partition("/") for place in connection.scalars(query)]
            return tuple(
                row
                for table, _, id_ in places
                if table in metadata.tables and id_.isdecimal()
                for row in _damaged(connection, metadata.tables[table], [int(id_)])
            )

    def damaged_tests(self, recording_id: int) -> tuple[int, ...]:
        """The rows of a recording's tests, former ones too, that are damaged."""
        of_recording = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
        with self.reading() as connection:
            ids = connection.scalars(of_recording).all()
            return tuple(_damaged_ids(connection, tests, ids))

    def damaged_posteriors(self, recording_id: int) -> tuple[DamagedPosterior, ...]:
        """The posteriors made from tests of a recording, former ones too, that are damaged."""
        made = sa.select(posterior_tests.c.posterior_id).join(tests)
        made = made.where(tests.c.recording_id == recording_id).distinct()
        with self.reading() as connection:
            ids = connection.scalars(made).all()
            return tuple(
                DamagedPosterior(id_, *_origin(connection, id_))
                for id_ in _damaged_ids(connection, posteriors, ids)
            )

    def heal_tests(
        self, ids: Sequence[int], found: Sequence[IdentifiedTest], lineage: Lineage
    ) -> None:
        """Writes what was identified anew over damaged rows, each by its place in its file."""
        at_position = {item.position: item for item in found}
        chosen = sa.select(tests.c.id, tests.c.position, tests.c.name).where(tests.c.id.in_(ids))
        with self.writing() as connection:
            for row in connection.execute(chosen).all():
                item = at_position.get(row.position)
                if item is not None:
                    values = {**test_contents(item, row.name), **lineage.columns}
                    _overwrite(connection, tests, row.id, values)

    def heal_posterior(
        self,
        id_: int,
        posterior: Posterior,
        chosen: Sequence[StoredTest],
        lineage: Lineage,
        at: datetime,
    ) -> None:
        """Writes a posterior made anew over a damaged one; its summary is made anew too."""
        with self.writing() as connection:
            hanger = chosen[0].hanger
            values = posterior_values(hanger, posterior, chosen, lineage, at)
            _overwrite(connection, posteriors, id_, values)
            stale = summaries.c.posterior_id == id_
            connection.execute(sa.delete(summaries).where(stale))

    def drop_damaged(self, recording_id: int | None = None) -> int:
        """Throws away damaged rows that are made again by themselves; how many there were.

        Those are summaries and what the watch keeps; of a recording that is done again also what
        the watch said of its tests.
        """
        own = sa.select(tests.c.id).where(tests.c.recording_id == recording_id)
        dropped = 0
        with self.writing() as connection:
            for table in (summaries, watch_states):
                dropped += _drop(connection, table, sa.select(next(iter(table.primary_key))))
            for table in (drifts, watches):
                of_recording = sa.select(table.c.id).where(table.c.test_id.in_(own))
                dropped += _drop(connection, table, of_recording)
        return dropped


def _damaged(connection: Connection, table: sa.Table, ids: Iterable[int]) -> list[DamagedRow]:
    plain, key = plain_table(table.name), next(iter(table.primary_key)).name
    found: list[DamagedRow] = []
    for id_ in ids:
        rows = connection.execute(sa.select(plain).where(plain.c[key] == id_)).mappings().all()
        found.extend(damaged_among(table, rows))
    return found


def _damaged_ids(connection: Connection, table: sa.Table, ids: Iterable[int]) -> list[int]:
    return [id_ for id_ in ids if _damaged(connection, table, [id_])]


def _drop(connection: Connection, table: sa.Table, chosen: sa.Select[Any]) -> int:
    key = next(iter(table.primary_key))
    ids = _damaged_ids(connection, table, connection.scalars(chosen).all())
    if ids:
        connection.execute(sa.delete(table).where(key.in_(ids)))
        forget(connection, table.name)
    return len(ids)


def _origin(connection: Connection, posterior_id: int) -> tuple[str, tuple[int, ...]]:
    model = connection.scalar(sa.select(posteriors.c.model).where(posteriors.c.id == posterior_id))
    of_it = posterior_tests.c.posterior_id == posterior_id
    query = sa.select(tests.c.id).join(posterior_tests).where(of_it)
    return str(model), tuple(connection.scalars(query.order_by(tests.c.time, tests.c.id)))


def _overwrite(
    connection: Connection, table: sa.Table, id_: int, values: Mapping[str, Any]
) -> None:
    connection.execute(sa.update(table).where(table.c.id == id_).values(**values))
    healed(connection, table, id_)
