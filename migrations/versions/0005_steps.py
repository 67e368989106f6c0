"""Each stage a test reached, what was superseded, tokens, what the watch keeps between tests."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

_TIME = sa.DateTime(timezone=True)


def upgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        _make_tests_anew()
    else:
        op.drop_constraint("uq_tests_hanger_name", "tests", type_="unique")
        op.add_column("tests", sa.Column("superseded_at", _TIME, nullable=True))
    _unique_where("superseded_at", "tests", "hanger", "name")
    op.add_column("posteriors", sa.Column("superseded_at", _TIME, nullable=True))
    _supersede("drifts", "test_id", "baseline_id", "quantity")
    _supersede("watches", "test_id", "baseline_id")
    _watch_states()
    _steps()
    _archive_copies()
    _tokens()


def _supersede(table: str, *unique: str) -> None:
    with op.batch_alter_table(table) as batch:
        batch.drop_constraint(f"uq_{table}_{'_'.join(unique)}", type_="unique")
        batch.add_column(sa.Column("superseded_at", _TIME, nullable=True))
    _unique_where("superseded_at", table, *unique)


def _unique_where(condition: str, table: str, *columns: str) -> None:
    where = sa.text(f"{condition} IS NULL")
    op.create_index(
        op.f(f"uq_{table}_{'_'.join(columns)}"),
        table,
        list(columns),
        unique=True,
        sqlite_where=where,
        postgresql_where=where,
    )


def _make_tests_anew() -> None:
    """SQLite can drop the constraint only with its table, to which others refer.

    They are checked when all is done; a table that is renamed into its place would not count.
    """
    kept = [column.name for column in _tests()]
    names = ", ".join(f'"{name}"' for name in kept)
    op.execute("PRAGMA defer_foreign_keys = ON")
    op.execute("CREATE TEMPORARY TABLE tests_before AS SELECT * FROM tests")
    op.drop_table("tests")
    op.create_table(
        "tests",
        *_tests(),
        sa.Column("superseded_at", _TIME, nullable=True),
        sa.ForeignKeyConstraint(
            ["recording_id"], ["recordings.id"], name=op.f("fk_tests_recording_id")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_tests")),
    )
    op.create_index(op.f("ix_tests_recording_id"), "tests", ["recording_id"], unique=False)
    op.create_index(op.f("ix_tests_stage"), "tests", ["stage"], unique=False)
    op.execute(f"INSERT INTO tests ({names}) SELECT {names} FROM tests_before")  # noqa: S608
    op.execute("DROP TABLE tests_before")


def _tests() -> list[sa.Column[object]]:
    return [
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("recording_id", sa.Integer(), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("time", _TIME, nullable=False),
        sa.Column("stage", sa.String(length=16), nullable=False),
        sa.Column("document", sa.Text(), nullable=False),
        sa.Column("frequency_response", sa.LargeBinary(), nullable=True),
        sa.Column("notes", sa.Text(), nullable=False),
        sa.Column("quality", sa.Text(), nullable=True),
        sa.Column("set_aside", sa.Text(), nullable=True),
        sa.Column("input_sha256", sa.String(length=64), nullable=False),
        sa.Column("settings_sha256", sa.String(length=64), nullable=False),
        sa.Column("version", sa.String(length=32), nullable=False),
        sa.Column("identified_at", _TIME, nullable=False),
    ]


def _watch_states() -> None:
    op.create_table(
        "watch_states",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("hanger", sa.Integer(), nullable=False),
        sa.Column("baseline_id", sa.Integer(), nullable=False),
        sa.Column("key", sa.Text(), nullable=False),
        sa.Column("last_test_time", _TIME, nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["baseline_id"], ["baselines.id"], name=op.f("fk_watch_states_baseline_id")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_watch_states")),
        sa.UniqueConstraint("baseline_id", name=op.f("uq_watch_states_baseline_id")),
    )
    op.create_index(op.f("ix_watch_states_hanger"), "watch_states", ["hanger"], unique=False)


def _steps() -> None:
    """Create the table, and fill in the earlier stages that are still known."""
    op.create_table(
        "steps",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("recording_id", sa.Integer(), nullable=False),
        sa.Column("test_id", sa.Integer(), nullable=True),
        sa.Column("stage", sa.String(length=16), nullable=False),
        sa.Column("at", _TIME, nullable=False),
        sa.Column("version", sa.String(length=32), nullable=True),
        sa.ForeignKeyConstraint(
            ["recording_id"], ["recordings.id"], name=op.f("fk_steps_recording_id")
        ),
        sa.ForeignKeyConstraint(["test_id"], ["tests.id"], name=op.f("fk_steps_test_id")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_steps")),
    )
    op.create_index(op.f("ix_steps_recording_id"), "steps", ["recording_id"], unique=False)
    op.create_index(op.f("ix_steps_test_id"), "steps", ["test_id"], unique=False)
    op.execute(
        "INSERT INTO steps (recording_id, stage, at) "
        "SELECT id, 'received', received_at FROM recordings ORDER BY id"
    )
    op.execute(
        "INSERT INTO steps (recording_id, test_id, stage, at, version) "
        "SELECT recording_id, id, 'identified', identified_at, version FROM tests ORDER BY id"
    )


def _archive_copies() -> None:
    op.create_table(
        "archive_copies",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("recording_id", sa.Integer(), nullable=False),
        sa.Column("folder", sa.Text(), nullable=False),
        sa.Column("at", _TIME, nullable=False),
        sa.ForeignKeyConstraint(
            ["recording_id"], ["recordings.id"], name=op.f("fk_archive_copies_recording_id")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_archive_copies")),
        sa.UniqueConstraint(
            "recording_id", "folder", name=op.f("uq_archive_copies_recording_id_folder")
        ),
    )


def _tokens() -> None:
    op.create_table(
        "tokens",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(length=255), nullable=False),
        sa.Column("token_sha256", sa.String(length=64), nullable=False),
        sa.Column("scopes", sa.String(length=64), nullable=False),
        sa.Column("created_at", _TIME, nullable=False),
        sa.Column("revoked_at", _TIME, nullable=True),
        sa.Column("last_used_at", _TIME, nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_tokens")),
        sa.UniqueConstraint("token_sha256", name=op.f("uq_tokens_token_sha256")),
    )
    _unique_where("revoked_at", "tokens", "name")
