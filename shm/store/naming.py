"""What a person calls a recording: its number, a test of it, any name that its file ever had."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.errors import NothingThere, UsageError
from shm.store.archive import suffix_of
from shm.store.database import Database
from shm.store.files import in_force
from shm.store.tables import events, metadata, posterior_tests, recordings, tests

_OF_TEST = ("tests", "watches", "drifts", "posteriors")
"""Tables of which a row, as `watches/12`, is one test's or was made from tests."""


class Naming(Database):
    """The part of the store that knows what is meant."""

    def recording_named(self, which: str) -> tuple[int, str | None]:
        """The recording that is meant: by its number, by the name of a test of it, by a name that
        its file, with or without suffix, came under, or by a row of the store, as `posteriors/12`.

        Also the test's name, where it was that. Raises NothingThere, and UsageError where several
        recordings are called so.
        """
        with self.reading() as connection:
            if which.isdecimal():
                by_number = sa.select(recordings.c.id).where(recordings.c.id == int(which))
                if connection.scalar(by_number) is not None:
                    return int(which), None
            by_name = sa.select(tests.c.recording_id).where(tests.c.name == which, in_force(tests))
            found = connection.scalars(by_name.order_by(tests.c.recording_id)).all()
            if found:
                return _single(found, f"{len(found)} hangers have a test {which!r}."), which
            former = _by_row(connection, which) or _by_former_names(connection, which)
        if not former:
            raise NothingThere(f"no recording and no test {which!r}.", remedy="See `shm status`.")
        return _single(former, f"{len(former)} recordings were called {which!r}."), None

    def names_of(self, recording_id: int) -> tuple[str, ...]:
        """Every name that the file of a recording came under: the present one, then the others."""
        own = sa.select(recordings.c.file_name).where(recordings.c.id == recording_id)
        other = sa.select(events.c.file_name).where(events.c.recording_id == recording_id)
        with self.reading() as connection:
            present = connection.scalars(own).all()
            return tuple(
                dict.fromkeys([*present, *connection.scalars(other.order_by(events.c.id))])
            )


def _single(found: Sequence[int], several: str) -> int:
    if len(found) > 1:
        numbers = ", ".join(map(str, found))
        raise UsageError(several, remedy=f"Give its recording's number: {numbers}.")
    return found[0]


def _by_row(connection: Connection, which: str) -> list[int]:
    """The recording of a row, as a message on its damage names it: `watches/12`."""
    table, _, id_ = which.partition("/")
    if table not in _OF_TEST or not id_.isdecimal():
        return []
    query = sa.select(sa.func.min(tests.c.recording_id))
    if table == "tests":
        query = query.where(tests.c.id == int(id_))
    elif table == "posteriors":
        query = query.join(posterior_tests).where(posterior_tests.c.posterior_id == int(id_))
    else:
        row = metadata.tables[table]
        query = query.join(row, row.c.test_id == tests.c.id).where(row.c.id == int(id_))
    found = connection.scalar(query)
    return [] if found is None else [found]


def _by_former_names(connection: Connection, which: str) -> list[int]:
    """Recordings with a test that was called so once, or a file that came under that name."""
    superseded = sa.select(tests.c.recording_id).where(tests.c.name == which)
    found = set(connection.scalars(superseded))
    files = sa.select(recordings.c.id, recordings.c.file_name).union(
        sa.select(events.c.recording_id, events.c.file_name).where(
            events.c.recording_id.is_not(None)
        )
    )
    rows = files.subquery()
    alike = sa.select(rows).where(rows.c.file_name.contains(which, autoescape=True))
    found |= {id_ for id_, name in connection.execute(alike) if which in _called(name)}
    return sorted(found)


def _called(file_name: str) -> set[str]:
    """A file's name with its folder and suffix, and without either."""
    whole, last = file_name, PurePath(file_name).name
    return {name[: len(name) - cut] for name in (whole, last) for cut in (0, len(suffix_of(name)))}
