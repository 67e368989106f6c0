"""A store as text without times, numbers of rows and durations: equal for equal work."""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from dataclasses import asdict, is_dataclass
from typing import Any

import sqlalchemy as sa

from shm.store import Store
from shm.store.journal import is_step
from shm.store.tables import (
    alerts,
    deliveries,
    drifts,
    journal,
    posterior_tests,
    posteriors,
    recordings,
    tests,
    watches,
)

_TIMES = {"time", "received_at", "identified_at", "updated_at", "raised_at", "ended_at", "at"}
_TIMES |= {"modified_at", "noted_at"}
_ROWS = {"id", "recording_id", "test_id", "baseline_id", "alert_id", "arrival", "seconds"}
_ROWS |= {"checksum"}  # of all else in the row, its times too


def canonical(store: Store) -> dict[str, list[str]]:
    """The rows of each table that hold work, sorted, each as one line."""
    named = sa.select(tests.c.name.label("of"))
    queries: dict[str, sa.Select[Any]] = {
        "recordings": sa.select(recordings),
        "tests": sa.select(tests),
        "posteriors": named.add_columns(*posteriors.c).select_from(
            posterior_tests.join(posteriors).join(tests)
        ),
        "drifts": named.add_columns(*drifts.c).select_from(drifts.join(tests)),
        "watches": named.add_columns(*watches.c).select_from(watches.join(tests)),
        "alerts": sa.select(alerts),
        "deliveries": sa.select(deliveries.c.hook, deliveries.c.state, alerts.c.key).join(alerts),
        "steps": sa.select(journal.c.kind, recordings.c.sha256, tests.c.name)
        .select_from(journal.join(recordings).outerjoin(tests, tests.c.id == journal.c.test_id))
        .where(is_step),
    }
    found: defaultdict[str, list[str]] = defaultdict(list)
    with store.reading() as connection:
        for name, query in queries.items():
            for row in connection.execute(query):
                found[name].append(json.dumps(_plain(dict(row._mapping)), sort_keys=True))
    return {name: sorted(lines) for name, lines in found.items()}


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items() if k not in _TIMES | _ROWS}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    if isinstance(value, str) and value[:1] in "{[" and value:
        return _plain(json.loads(value))  # a document
    return value if isinstance(value, float | int | str | None) else str(value)
