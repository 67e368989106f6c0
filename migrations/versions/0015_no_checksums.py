"""Rows have no checksums any more."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for table in sa.inspect(op.get_bind()).get_table_names():
        if table != "alembic_version":
            op.drop_index(f"ix_{table}_unsealed", table)
            op.drop_column(table, "checksum")
    op.drop_column("tests", "frequency_response_checksum")
    op.drop_column("notes", "photo_checksum")
