"""Read earlier tests and decisions, by which a new recording is judged."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime

import sqlalchemy as sa

from shm.store.database import Repository
from shm.store.disposition import decided_with
from shm.store.files import is_counted, is_current
from shm.store.holding import fingerprint_from
from shm.store.rows import Hold, Stage, StoredTest
from shm.store.selects import load_tests, plain_tests
from shm.store.tables import fingerprints, recordings, tests
from shm.values import Fingerprint, KnownSamples

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
