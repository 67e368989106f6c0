"""Permanent sensors: windows, readings, events; alerts that no test raised."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

_TIME = sa.DateTime(timezone=True)
_ALERTS = (
    "id", "key", "hanger", "test_id", "baseline_id", "time", "raised_at", "message", "document",
    "checksum",
)  # fmt: skip


def upgrade() -> None:
    _windows()
    _pooled()
    _events()
    _states()
    if op.get_bind().dialect.name == "sqlite":
        _make_alerts_anew()
    else:
        op.alter_column("alerts", "test_id", nullable=True)


def _windows() -> None:
    op.create_table(
        "stream_windows",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("stream", sa.String(length=64), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("start", _TIME, nullable=False),
        sa.Column("has_modes", sa.Boolean(), nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_stream_windows")),
        sa.UniqueConstraint("stream", "start", name=op.f("uq_stream_windows_stream_start")),
    )
    _index("stream_windows", "hanger", "start")
    _unsealed("stream_windows")


def _pooled() -> None:
    op.create_table(
        "pooled_readings",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("stream", sa.String(length=64), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("period", sa.String(length=16), nullable=False),
        sa.Column("start", _TIME, nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_pooled_readings")),
        sa.UniqueConstraint(
            "stream", "period", "start", name=op.f("uq_pooled_readings_stream_period_start")
        ),
    )
    _index("pooled_readings", "hanger", "period", "start")
    _unsealed("pooled_readings")


def _events() -> None:
    op.create_table(
        "stream_events",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("stream", sa.String(length=64), nullable=False),
        sa.Column("kind", sa.String(length=32), nullable=False),
        sa.Column("start", _TIME, nullable=False),
        sa.Column("end", _TIME, nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.Column("channel", sa.String(length=64), nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_stream_events")),
    )
    _index("stream_events", "start")
    _unsealed("stream_events")


def _states() -> None:
    op.create_table(
        "stream_watch",
        sa.Column("hanger", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("reading_time", _TIME, nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("hanger", name=op.f("pk_stream_watch")),
    )
    op.create_table(
        "stream_progress",
        sa.Column("stream", sa.String(length=64), nullable=False),
        sa.Column("done_until", _TIME, nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("stream", name=op.f("pk_stream_progress")),
    )
    _unsealed("stream_watch")
    _unsealed("stream_progress")


def _make_alerts_anew() -> None:
    """SQLite can let a column be empty only with a new table; see `0007_held`."""
    names = ", ".join(f'"{name}"' for name in _ALERTS)
    op.execute("PRAGMA defer_foreign_keys = ON")
    op.execute("CREATE TEMPORARY TABLE alerts_before AS SELECT * FROM alerts")
    op.drop_table("alerts")
    op.create_table(
        "alerts",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("key", sa.String(length=255), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("test_id", sa.Integer(), nullable=True),
        sa.Column("baseline_id", sa.Integer(), nullable=True),
        sa.Column("time", _TIME, nullable=False),
        sa.Column("raised_at", _TIME, nullable=False),
        sa.Column("message", sa.Text(), nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.ForeignKeyConstraint(["test_id"], ["tests.id"], name=op.f("fk_alerts_test_id")),
        sa.ForeignKeyConstraint(
            ["baseline_id"], ["baselines.id"], name=op.f("fk_alerts_baseline_id")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_alerts")),
        sa.UniqueConstraint("key", name=op.f("uq_alerts_key")),
    )
    _index("alerts", "hanger")
    _unsealed("alerts")
    op.execute(f"INSERT INTO alerts ({names}) SELECT {names} FROM alerts_before")  # noqa: S608
    op.execute("DROP TABLE alerts_before")


def _index(table: str, *columns: str) -> None:
    op.create_index(op.f(f"ix_{table}_{'_'.join(columns)}"), table, list(columns))


def _unsealed(table: str) -> None:
    where = sa.text("checksum IS NULL")
    op.create_index(
        op.f(f"ix_{table}_unsealed"),
        table,
        ["checksum"],
        sqlite_where=where,
        postgresql_where=where,
    )
