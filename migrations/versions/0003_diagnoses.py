"""Diagnoses of the gap and adoptions of effects, whose classes have longer names."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "diagnoses",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("diagnosed_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("tests", sa.Text(), nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("input_sha256", sa.String(length=64), nullable=False),
        sa.Column("settings_sha256", sa.String(length=64), nullable=False),
        sa.Column("version", sa.String(length=32), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_diagnoses")),
    )
    op.create_index(op.f("ix_diagnoses_hanger"), "diagnoses", ["hanger"], unique=False)
    op.create_table(
        "adoptions",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("model", sa.String(length=512), nullable=False),
        sa.Column("baseline_model", sa.String(length=64), nullable=False),
        sa.Column("effect", sa.Text(), nullable=False),
        sa.Column("at", sa.Text(), nullable=False),
        sa.Column("why", sa.Text(), nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("gap_before_percent", sa.Double(), nullable=True),
        sa.Column("gap_percent", sa.Double(), nullable=True),
        sa.Column("adopted_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("diagnosis_id", sa.Integer(), nullable=True),
        sa.Column("selection_id", sa.Integer(), nullable=False),
        sa.Column("baseline_id", sa.Integer(), nullable=False),
        sa.Column("undone_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("undone_why", sa.Text(), nullable=True),
        sa.Column("undone_who", sa.Text(), nullable=True),
        sa.ForeignKeyConstraint(
            ["diagnosis_id"], ["diagnoses.id"], name=op.f("fk_adoptions_diagnosis_id")
        ),
        sa.ForeignKeyConstraint(
            ["selection_id"], ["selections.id"], name=op.f("fk_adoptions_selection_id")
        ),
        sa.ForeignKeyConstraint(
            ["baseline_id"], ["baselines.id"], name=op.f("fk_adoptions_baseline_id")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_adoptions")),
    )
    op.create_index(op.f("ix_adoptions_hanger"), "adoptions", ["hanger"], unique=False)
    for table in ("posteriors", "selections"):
        _widen_model(table)


def _widen_model(table: str) -> None:
    """Room for longer names; a new column, because SQLite cannot alter one that rows refer to."""
    if op.get_bind().dialect.name != "sqlite":
        op.alter_column(table, "model", type_=sa.String(length=512))
        return
    op.execute(f"ALTER TABLE {table} RENAME COLUMN model TO short_model")
    op.add_column(table, sa.Column("model", sa.String(512), nullable=False, server_default=""))
    op.execute(f"UPDATE {table} SET model = short_model")  # noqa: S608
    op.drop_column(table, "short_model")
