"""What watches over the daemon answers whatever the rows say: `/metrics` and `/health`."""

from __future__ import annotations

import inspect
import sqlite3
from collections.abc import Iterator
from datetime import UTC
from enum import StrEnum
from itertools import zip_longest
from pathlib import Path

import httpx
import pytest
import sqlalchemy as sa
from prometheus_client.parser import text_string_to_metric_families

from shm.pipeline import utc_now
from shm.store import Workspace, rows
from shm.store.columns import Number, UtcTime
from shm.store.journal import STEPS
from shm.store.tables import metadata
from shm_daemon.heartbeat import beat
from tests.helpers.slow import few_of
from tests.helpers.web_servers import served
from tests.helpers.workspaces import make_workspace
from tests.store.make_released_database import fill

# Columns whose texts are names: of a stage, a state, a kind.
_SAYS_WHAT = frozenset({"stage", "state", "kind"})


def may_be_odd(column: sa.Column[object]) -> bool:
    is_number = isinstance(column.type, UtcTime | Number)
    return column.name in _SAYS_WHAT or is_number or bool(column.nullable)


_MAY_BE_ODD = [
    sorted(filter(may_be_odd, table.columns), key=lambda each: each.name not in _SAYS_WHAT)
    for table in metadata.sorted_tables
]
ROUNDS = [[each for each in one if each is not None] for one in zip_longest(*_MAY_BE_ODD)]
"""A column of each table at a time: a scrape reads them all."""
METRICS = {
    "shm_spool_files", "shm_quarantined_files", "shm_disk_free_bytes", "shm_daemon_seen_seconds",
    "shm_store_up", "shm_queue_length", "shm_queue_oldest_seconds", "shm_recordings", "shm_alerts",
    "shm_deliveries", "shm_stage_seconds", "shm_stage_reached", "shm_scrape_errors",
}  # fmt: skip


def names() -> set[str]:
    """Every name that a row may say: of all enumerations of the store, and one of the future."""
    kinds = {
        kind for _, kind in inspect.getmembers(rows, inspect.isclass) if issubclass(kind, StrEnum)
    }
    said = {str(member) for kind in kinds for member in kind}
    return said | STEPS | {"made by a newer version", "", 'a "quoted"\nname'}


def odd_values(column: sa.Column[object]) -> Iterator[object]:
    if column.name in _SAYS_WHAT:
        yield from sorted(names())
    if isinstance(column.type, UtcTime):
        yield from ("0001-01-01 00:00:00.000000", "9999-12-31 23:59:59.999999")
    if isinstance(column.type, Number):
        yield from (float("inf"), -1e300)
    if column.nullable:
        yield None


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """Return a store with a row in nearly every table; all its steps were made just now."""
    workspace = make_workspace(tmp_path_factory.mktemp("metrics") / "bridge")
    with workspace.store() as store:
        fill(store)
    with sqlite3.connect(workspace.database) as connection:
        now = utc_now().astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S.%f")
        connection.execute("UPDATE journal SET at = ?", (now,))
    connection.close()
    return workspace


def said(client: httpx.Client) -> dict[tuple[str, ...], float]:
    """Return the samples by name and labels' values, as Prometheus parses them."""
    answer = client.get("/metrics")
    assert answer.status_code == 200, answer.text
    found = {}
    for family in text_string_to_metric_families(answer.text):
        for sample in family.samples:
            key = (sample.name, *sample.labels.values())
            assert key not in found, f"{key} is told twice"
            found[key] = sample.value
    return found


def errors(client: httpx.Client) -> dict[str, float]:
    return {key[1]: value for key, value in said(client).items()
            if key[0] == "shm_scrape_errors_total"}  # fmt: skip


@pytest.mark.parametrize(
    "columns", few_of(ROUNDS, 3), ids=lambda columns: " ".join(map(str, columns))
)
def test_no_state_of_any_row_breaks_a_scrape(
    client: httpx.Client, bridge: Workspace, columns: list[sa.Column[object]]
) -> None:
    """Each name, time, number and gap that any column may hold, in all its rows at once."""
    odd = [list(odd_values(column)) for column in columns]
    before = errors(client)
    with sqlite3.connect(bridge.database, isolation_level=None) as connection:
        connection.execute("PRAGMA foreign_keys = OFF")
        (recordings,) = connection.execute("SELECT count(*) FROM recordings").fetchone()
        kept = [
            connection.execute(f"SELECT {each.name}, rowid FROM {each.table.name}").fetchall()
            for each in columns
        ]
        try:
            for number in range(max(map(len, odd))):
                for column, values in zip(columns, odd, strict=True):
                    connection.execute(
                        f"UPDATE OR IGNORE {column.table.name} SET {column.name} = ?",
                        (values[number % len(values)],),
                    )
                beat(bridge)
                seen = said(client)
                counted = sum(n for key, n in seen.items() if key[0] == "shm_recordings")
                assert counted == recordings
                assert {key[0] for key in seen} >= METRICS - {"shm_scrape_errors"} - (
                    {"shm_stage_seconds", "shm_stage_reached"}
                    if "journal" in {each.table.name for each in columns}
                    else set()
                )
                health = client.get("/health")
                reasons = health.json()["reasons"]
                assert not [each for each in reasons if "the log says more" in each], number
                damaged = [each for each in reasons if "damaged" in each]
                assert health.status_code == (503 if damaged else 200), reasons
        finally:
            for column, values in zip(columns, kept, strict=True):
                connection.executemany(
                    f"UPDATE {column.table.name} SET {column.name} = ? WHERE rowid = ?", values
                )
    connection.close()
    assert errors(client) == before


@pytest.mark.parametrize(
    ("table", "column", "metric"),
    [("recordings", "stage", "shm_recordings"), ("deliveries", "state", "shm_deliveries")],
)
def test_a_row_in_an_unknown_state_is_counted_as_other(
    client: httpx.Client, bridge: Workspace, table: str, column: str, metric: str
) -> None:
    with sqlite3.connect(bridge.database, isolation_level=None) as connection:
        kept = connection.execute(f"SELECT {column}, id FROM {table}").fetchall()
        connection.execute(f"UPDATE {table} SET {column} = 'of the future'")
        seen = said(client)
        connection.executemany(f"UPDATE {table} SET {column} = ? WHERE id = ?", kept)
    connection.close()
    assert seen[metric, rows.OTHER] == len(kept)


@pytest.mark.parametrize(
    ("table", "part", "lost"),
    [
        ("journal", "stages", "shm_stage_seconds"),
        ("recordings", "recordings", "shm_recordings"),
        ("deliveries", "deliveries", "shm_deliveries"),
    ],
)
def test_a_part_that_fails_is_absent_and_counted_and_the_others_answer(
    client: httpx.Client, bridge: Workspace, table: str, part: str, lost: str
) -> None:
    before = errors(client)[part]
    with sqlite3.connect(bridge.database) as connection:
        connection.execute(f"ALTER TABLE {table} RENAME TO gone_for_a_while")
        connection.commit()
        try:
            seen = said(client)
            beat(bridge)
            health = client.get("/health")
        finally:
            connection.execute(f"ALTER TABLE gone_for_a_while RENAME TO {table}")
            connection.commit()
    connection.close()
    assert not [key for key in seen if key[0] == lost]
    assert seen["shm_scrape_errors_total", part] == before + 1
    assert seen["shm_store_up",] == 1
    assert {("shm_spool_files",), ("shm_disk_free_bytes",), ("shm_alerts", "open")} <= set(seen)
    assert health.status_code == 200
    assert errors(client)[part] == before + 1


def test_a_spool_that_is_away_takes_nothing_else_with_it(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    with served(workspace) as site, site.client() as client:
        workspace.spool.rmdir()
        seen = said(client)
        health = client.get("/health")
    assert seen["shm_store_up",] == 1
    assert ("shm_alerts", "open") in seen
    assert health.status_code == 503
    assert "The spool cannot be written." in health.json()["reasons"]
