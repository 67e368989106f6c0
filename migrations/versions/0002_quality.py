"""What a test's quality is, and what rang in it without being a mode of the hanger."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("tests", sa.Column("quality", sa.Text(), nullable=True))
    op.add_column("tests", sa.Column("set_aside", sa.Text(), nullable=True))
