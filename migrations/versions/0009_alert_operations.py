"""Silences, resolutions, and deliveries that tell several alerts, or that one is resolved."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

_TIME = sa.DateTime(timezone=True)
_KEPT = (
    "id",
    "alert_id",
    "hook",
    "state",
    "attempts",
    "next_attempt_at",
    "last_error",
    "ended_at",
)


def upgrade() -> None:
    """Keep the key of deliveries that were tried or have ended."""
    _resolutions()
    _silences()
    names = ", ".join(_KEPT)
    op.execute(f"CREATE TEMPORARY TABLE deliveries_before AS SELECT {names} FROM deliveries")  # noqa: S608
    op.drop_table("deliveries")
    _deliveries()
    op.execute(
        f"INSERT INTO deliveries ({names}, news, message_id) SELECT {names}, 'raised', "  # noqa: S608
        "CASE WHEN attempts > 0 OR state <> 'waiting' THEN id END FROM deliveries_before"
    )
    op.execute("DROP TABLE deliveries_before")
    if op.get_bind().dialect.name == "postgresql":
        op.execute(
            "SELECT setval(pg_get_serial_sequence('deliveries', 'id'), max(id)) FROM deliveries"
        )


def _resolutions() -> None:
    op.create_table(
        "resolutions",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("alert_id", sa.Integer(), nullable=False),
        sa.Column("at", _TIME, nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("why", sa.Text(), nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.ForeignKeyConstraint(["alert_id"], ["alerts.id"], name=op.f("fk_resolutions_alert_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_resolutions")),
        sa.UniqueConstraint("alert_id", name=op.f("uq_resolutions_alert_id")),
    )
    _unsealed("resolutions")


def _silences() -> None:
    op.create_table(
        "silences",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=True),
        sa.Column("starts_at", _TIME, nullable=False),
        sa.Column("ends_at", _TIME, nullable=False),
        sa.Column("is_maintenance", sa.Boolean(), nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("why", sa.Text(), nullable=False),
        sa.Column("made_at", _TIME, nullable=False),
        sa.Column("ended_at", _TIME, nullable=True),
        sa.Column("ended_who", sa.Text(), nullable=True),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_silences")),
    )
    _unsealed("silences")


def _deliveries() -> None:
    op.create_table(
        "deliveries",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("alert_id", sa.Integer(), nullable=False),
        sa.Column("hook", sa.String(length=255), nullable=False),
        sa.Column("news", sa.String(length=16), nullable=False),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("next_attempt_at", _TIME, nullable=False),
        sa.Column("last_error", sa.Text(), nullable=False),
        sa.Column("ended_at", _TIME, nullable=True),
        sa.Column("message_id", sa.Integer(), nullable=True),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.ForeignKeyConstraint(["alert_id"], ["alerts.id"], name=op.f("fk_deliveries_alert_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_deliveries")),
        sa.UniqueConstraint(
            "alert_id", "hook", "news", name=op.f("uq_deliveries_alert_id_hook_news")
        ),
    )
    op.create_index(
        op.f("ix_deliveries_state_next_attempt_at"), "deliveries", ["state", "next_attempt_at"]
    )
    op.create_index(op.f("ix_deliveries_message_id"), "deliveries", ["message_id"])
    _unsealed("deliveries")


def _unsealed(table: str) -> None:
    where = sa.text("checksum IS NULL")
    op.create_index(
        op.f(f"ix_{table}_unsealed"),
        table,
        ["checksum"],
        sqlite_where=where,
        postgresql_where=where,
    )
