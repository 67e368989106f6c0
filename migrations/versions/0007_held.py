"""What is held until a person has looked, and what the samples of a recording look like."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None

_TIME = sa.DateTime(timezone=True)
_ALERTS = (
    "id",
    "key",
    "hanger",
    "test_id",
    "baseline_id",
    "time",
    "raised_at",
    "message",
    "document",
)


def upgrade() -> None:
    op.add_column("recordings", sa.Column("modified_at", _TIME, nullable=True))
    op.create_table(
        "fingerprints",
        sa.Column("recording_id", sa.Integer(), nullable=False),
        sa.Column("digest", sa.String(length=64), nullable=False),
        sa.Column("shapes", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["recording_id"], ["recordings.id"], name=op.f("fk_fingerprints_recording_id")
        ),
        sa.PrimaryKeyConstraint("recording_id", name=op.f("pk_fingerprints")),
    )
    op.create_index(op.f("ix_fingerprints_digest"), "fingerprints", ["digest"], unique=False)
    op.create_table(
        "holds",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("recording_id", sa.Integer(), nullable=False),
        sa.Column("held_at", _TIME, nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("decision", sa.String(length=16), nullable=True),
        sa.Column("decided_at", _TIME, nullable=True),
        sa.Column("who", sa.Text(), nullable=True),
        sa.Column("why", sa.Text(), nullable=True),
        sa.Column("time", _TIME, nullable=True),
        sa.ForeignKeyConstraint(
            ["recording_id"], ["recordings.id"], name=op.f("fk_holds_recording_id")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_holds")),
    )
    op.create_index(op.f("ix_holds_recording_id"), "holds", ["recording_id"], unique=False)
    if op.get_bind().dialect.name == "sqlite":
        _make_alerts_anew()
    else:
        op.alter_column("alerts", "baseline_id", nullable=True)


def _make_alerts_anew() -> None:
    """SQLite can let a column be empty only with a new table; see `0005_steps`."""
    names = ", ".join(f'"{name}"' for name in _ALERTS)
    op.execute("PRAGMA defer_foreign_keys = ON")
    op.execute("CREATE TEMPORARY TABLE alerts_before AS SELECT * FROM alerts")
    op.drop_table("alerts")
    op.create_table(
        "alerts",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("key", sa.String(length=255), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("test_id", sa.Integer(), nullable=False),
        sa.Column("baseline_id", sa.Integer(), nullable=True),
        sa.Column("time", _TIME, nullable=False),
        sa.Column("raised_at", _TIME, nullable=False),
        sa.Column("message", sa.Text(), nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["test_id"], ["tests.id"], name=op.f("fk_alerts_test_id")),
        sa.ForeignKeyConstraint(
            ["baseline_id"], ["baselines.id"], name=op.f("fk_alerts_baseline_id")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_alerts")),
        sa.UniqueConstraint("key", name=op.f("uq_alerts_key")),
    )
    op.create_index(op.f("ix_alerts_hanger"), "alerts", ["hanger"], unique=False)
    op.execute(f"INSERT INTO alerts ({names}) SELECT {names} FROM alerts_before")  # noqa: S608
    op.execute("DROP TABLE alerts_before")
