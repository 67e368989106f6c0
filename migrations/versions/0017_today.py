"""Any released schema becomes today's: each table is made as `shm.store.tables` says, and filled.

What a later schema changes is changed here, under a new number; a column that needs more than a
copy has a rule below.
"""

import json
from collections.abc import Collection, Iterator
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from alembic import op

from shm.store.tables import metadata

revision = "0017"
down_revision = "0001"
branch_labels = None
depends_on = None

_ROWS_AT_ONCE = 500
_RULES = {
    ("deliveries", "news"): "'raised'",
    # The key of a message that was tried or has ended stays as it is.
    ("deliveries", "message_id"): ("CASE WHEN attempts > 0 OR state <> 'waiting' THEN id END"),
}
"""Of columns that the first schema lacks and that are not empty."""
_ENTRY = "at, kind, recording_id, test_id, subject, detail, who, via, version"
# What was noticed; a step that came with it is one entry with it.
_EVENTS = (
    "SELECT at, 2 AS source, id, kind, recording_id, CAST(NULL AS INTEGER) AS test_id, "
    "file_name AS subject, message AS detail, CAST(NULL AS VARCHAR(64)) AS who, "
    "CAST(NULL AS VARCHAR(16)) AS via, {version} AS version FROM old_events"
)
_IN_STEP = "stage = kind AND s.recording_id = old_events.recording_id AND s.at = old_events.at"
_VERSION = f"(SELECT max(version) FROM old_steps AS s WHERE {_IN_STEP})"  # noqa: S608
_NO_VERSION = "CAST(NULL AS VARCHAR(32))"
_STEPS = (
    "SELECT at, 1, id, stage, recording_id, test_id, '', '', NULL, NULL, version "  # noqa: S608
    "FROM old_steps AS s WHERE test_id IS NOT NULL OR "
    f"NOT EXISTS (SELECT 1 FROM old_events WHERE {_IN_STEP})"
)
_CHANGES = "SELECT at, 3, id, action, NULL, NULL, subject, detail, who, via, NULL FROM old_audit"
# The first schema noted no steps: what is still known of them.
_FIRST_STEPS = (
    "SELECT received_at, 0, id, 'received', id, NULL, '', '', NULL, NULL, NULL "
    "FROM old_recordings UNION ALL SELECT identified_at, 1, id, 'identified', recording_id, id, "
    "'', '', NULL, NULL, version FROM old_tests"
)
# Before it was a kind it was said by the first words.
_ENDINGS = (
    "UPDATE alerts SET ended_kind = CASE "
    "WHEN ended_why LIKE 'judged again with the thresholds in force%' THEN 'judged again' "
    "WHEN ended_why LIKE 'test discarded by %' THEN 'test discarded' "
    "WHEN ended_who = 'shm' THEN 'over' ELSE 'by a person' END WHERE ended_at IS NOT NULL"
)


def upgrade() -> None:
    """Copy the rows, table by table; in a file the next one takes the pages of the one before."""
    connection = op.get_bind()
    former = sa.MetaData()
    former.reflect(connection)
    tables = [each for each in former.sorted_tables if each.name != "alembic_version"]
    is_server = connection.dialect.name == "postgresql"
    _rename_server(connection) if is_server else _rename_file(tables)
    for table in metadata.sorted_tables:
        _make(table)
    columns = {each.name: {column.name for column in each.columns} for each in tables}
    # A server wants what is referred to first. What refers to a table is dropped before it.
    first = metadata.sorted_tables if is_server else [metadata.tables["alerts"]]
    if not is_server:
        op.execute("PRAGMA defer_foreign_keys = ON")
    for table in first:
        if table.name in columns:
            _copy(table, columns[table.name])
    _fill_journal(columns)
    for prefix, former_table in (("noted", "acknowledgements"), ("ended", "resolutions")):
        if former_table in columns:
            _note_on_alerts(prefix, former_table)
    if "ended_kind" not in columns.get("alerts", ()):
        op.execute(_ENDINGS)
    for each in reversed(tables):
        if each.name in metadata.tables and metadata.tables[each.name] not in first:
            _copy(metadata.tables[each.name], columns[each.name])
        op.execute(f'DROP TABLE "old_{each.name}"')
    if "taken_at" not in columns["tests"]:
        _note_conditions()
    if is_server:
        _count_on()


def _rename_file(tables: Collection[sa.Table]) -> None:
    for table in tables:
        for index in table.indexes:
            op.drop_index(str(index.name), table.name)
    for table in tables:
        op.rename_table(table.name, f"old_{table.name}")


def _rename_server(connection: sa.Connection) -> None:
    """Rename tables, indexes and sequences, whose names are one set."""
    kinds = {"r": "TABLE", "i": "INDEX", "S": "SEQUENCE"}
    query = (
        "SELECT relname, relkind::text FROM pg_class JOIN pg_namespace n ON n.oid = relnamespace "
        "WHERE n.nspname = current_schema() AND relkind IN ('r', 'i', 'S') "
        "AND left(relname, 15) <> 'alembic_version'"
    )
    for name, kind in connection.exec_driver_sql(query).fetchall():
        op.execute(f'ALTER {kinds[kind]} "{name}" RENAME TO "old_{name}"')


def _make(table: sa.Table) -> None:
    op.execute(sa.schema.CreateTable(table))
    for index in sorted(table.indexes, key=lambda each: str(each.name)):
        where = index.dialect_options["sqlite"]["where"]
        op.create_index(
            index.name,
            table.name,
            [column.name for column in index.columns],
            unique=index.unique,
            sqlite_where=where,
            postgresql_where=where,
        )


def _copy(table: sa.Table, former: Collection[str]) -> None:
    source = {column.name: f'"{column.name}"' for column in table.c if column.name in former}
    for (name, column), rule in _RULES.items():
        if name == table.name and column not in former:
            source[column] = rule
    names = ", ".join(f'"{name}"' for name in source)
    found = ", ".join(source.values())
    op.execute(f'INSERT INTO "{table.name}" ({names}) SELECT {found} FROM "old_{table.name}"')  # noqa: S608


def _fill_journal(former: Collection[str]) -> None:
    if "journal" in former:
        return
    has_steps = "steps" in former
    parts = [_EVENTS.format(version=_VERSION if has_steps else _NO_VERSION)]
    parts += [_STEPS if has_steps else _FIRST_STEPS, *([_CHANGES] if "audit" in former else [])]
    entries = " UNION ALL ".join(parts)
    op.execute(
        f"INSERT INTO journal ({_ENTRY}) SELECT {_ENTRY} FROM ({entries}) AS found "  # noqa: S608
        "ORDER BY at, source, id"
    )


def _note_on_alerts(prefix: str, table: str) -> None:
    found = ", ".join(
        f"{prefix}_{name} = (SELECT {name} FROM old_{table} WHERE alert_id = alerts.id)"  # noqa: S608
        for name in ("at", "who", "why")
    )
    op.execute(f"UPDATE alerts SET {found}")  # noqa: S608


def _note_conditions() -> None:
    """Note of each test when it was taken and how warm it was, as its document says."""
    tests = metadata.tables["tests"]
    marked = sa.update(tests).where(tests.c.id == sa.bindparam("test"))
    marked = marked.values(taken_at=sa.bindparam("moment"), temperature_c=sa.bindparam("warmth"))
    for rows in _documents(tests):
        found = [
            {"test": id_, "moment": _time(told.get("time")), "warmth": told.get("temperature_c")}
            for id_, told in rows
        ]
        op.get_bind().execute(marked, found)


def _time(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text).astimezone(UTC)


def _documents(table: sa.Table) -> Iterator[list[tuple[int, dict[str, Any]]]]:
    """Yield some rows at a time with their documents, so that memory stays small."""
    query = sa.select(table.c.id, table.c.document).order_by(table.c.id).limit(_ROWS_AT_ONCE)
    last = 0
    while rows := op.get_bind().execute(query.where(table.c.id > last)).all():
        last = rows[-1].id
        yield [(row.id, json.loads(row.document)) for row in rows]


def _count_on() -> None:
    """Let a server number new rows after those that are there."""
    for table in metadata.sorted_tables:
        if "id" in table.c:
            op.execute(
                f"SELECT setval(pg_get_serial_sequence('{table.name}', 'id'), max(id)) "  # noqa: S608
                f"FROM {table.name} HAVING max(id) IS NOT NULL"
            )
