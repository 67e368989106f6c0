"""A checksum of every row, so that a damaged one is found before it is used.

The checksums themselves are computed after the migration, in the same transaction
(`shm.store.schema`): this gives them their place.
"""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Of every table that is there, those that came with a migration between too."""
    op.add_column("tests", sa.Column("frequency_response_checksum", sa.BigInteger(), nullable=True))
    where = sa.text("checksum IS NULL")
    for table in sa.inspect(op.get_bind()).get_table_names():
        if table == "alembic_version":
            continue
        op.add_column(table, sa.Column("checksum", sa.BigInteger(), nullable=True))
        op.create_index(
            op.f(f"ix_{table}_unsealed"),
            table,
            ["checksum"],
            sqlite_where=where,
            postgresql_where=where,
        )
