"""What is shown of years of tests without their samples: summaries, called changes, indexes."""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

_ROWS_AT_ONCE = 500


def upgrade() -> None:
    """Summaries are filled afterwards: stiffness needs the hangers, which no table describes."""
    op.create_table(
        "summaries",
        sa.Column("posterior_id", sa.Integer(), nullable=False),
        sa.Column("key", sa.String(length=64), nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["posterior_id"], ["posteriors.id"], name=op.f("fk_summaries_posterior_id")
        ),
        sa.PrimaryKeyConstraint("posterior_id", name=op.f("pk_summaries")),
    )
    op.add_column("tests", sa.Column("taken_at", sa.DateTime(timezone=True), nullable=True))
    op.add_column("tests", sa.Column("temperature_c", sa.Double(), nullable=True))
    _note_conditions()
    op.add_column(
        "watches",
        sa.Column("called", sa.Boolean(), nullable=False, server_default=sa.false()),
    )
    _mark_called()
    _index_in_force("tests", "hanger", "time", "stage", "name", "taken_at", "temperature_c")
    _index_in_force("posteriors", "hanger", "time", "model")
    _index_in_force("watches", "hanger", "baseline_id", "time", "called")
    op.create_index(op.f("ix_steps_at"), "steps", ["at"], unique=False)


def _index_in_force(table: str, *columns: str) -> None:
    where = sa.text("superseded_at IS NULL")
    op.create_index(
        op.f(f"ix_{table}_in_force"),
        table,
        list(columns),
        sqlite_where=where,
        postgresql_where=where,
    )


def _note_conditions() -> None:
    """Of each test when it was taken and how warm it was, as its document says."""
    tests = sa.table("tests", *map(sa.column, ("id", "document", "temperature_c")), _taken_at())
    marked = sa.update(tests).where(tests.c.id == sa.bindparam("test"))
    marked = marked.values(taken_at=sa.bindparam("at"), temperature_c=sa.bindparam("warmth"))
    for rows in _documents(tests):
        found = [
            {"test": id_, "at": _time(told.get("time")), "warmth": told.get("temperature_c")}
            for id_, told in rows
        ]
        op.get_bind().execute(marked, found)


def _taken_at() -> sa.ColumnClause[Any]:
    return sa.column("taken_at", sa.DateTime(timezone=True))


def _time(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text).astimezone(UTC)


def _mark_called() -> None:
    """Of each watch whether its document says that a change was called."""
    watches = sa.table("watches", *map(sa.column, ("id", "document", "called")))
    for rows in _documents(watches):
        called = [id_ for id_, told in rows if _is_called(told["change"])]
        marked = sa.update(watches).where(watches.c.id.in_(called))
        op.get_bind().execute(marked.values(called=sa.true()))


def _documents(table: sa.TableClause) -> Iterator[list[tuple[int, dict[str, Any]]]]:
    """Yield some rows at a time with their documents, so that memory stays small."""
    query = sa.select(table.c.id, table.c.document).order_by(table.c.id).limit(_ROWS_AT_ONCE)
    last = 0
    while rows := op.get_bind().execute(query.where(table.c.id > last)).all():
        last = rows[-1].id
        yield [(row.id, json.loads(row.document)) for row in rows]


def _is_called(change: dict[str, Any]) -> bool:
    evidence_years, limit_years = change["evidence_years"], change["limit_years"]
    if evidence_years is None or limit_years is None:
        return False
    return bool(evidence_years > limit_years)
