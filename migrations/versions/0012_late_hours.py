"""The watch of a stream as it was on each of the last days, to go back to for late hours."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "stream_watch_days",
        sa.Column("hanger", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("reading_time", sa.DateTime(timezone=True), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("checksum", sa.BigInteger(), nullable=True),
        sa.PrimaryKeyConstraint("hanger", "reading_time", name=op.f("pk_stream_watch_days")),
    )
    where = sa.text("checksum IS NULL")
    op.create_index(
        op.f("ix_stream_watch_days_unsealed"),
        "stream_watch_days",
        ["checksum"],
        sqlite_where=where,
        postgresql_where=where,
    )
