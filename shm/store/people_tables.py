"""The tables of people; `tables` completes them and holds the rules for changes."""

from __future__ import annotations

import sqlalchemy as sa

from shm.store.columns import UtcTime, identity, metadata, reference, unique_where

# Who may sign in by name. Of a password only its salted, slow hash is kept.
users = sa.Table(
    "users",
    metadata,
    identity(),
    sa.Column("name", sa.String(255), nullable=False),
    sa.Column("role", sa.String(16), nullable=False),
    sa.Column("password_hash", sa.Text, nullable=False),
    sa.Column("made_at", UtcTime, nullable=False),
    sa.Column("removed_at", UtcTime),
    unique_where("removed_at", "users", "name"),
)

# A browser in which a person has signed in. Only the checksum of its secret is kept.
sessions = sa.Table(
    "sessions",
    metadata,
    identity(),
    reference("users"),
    sa.Column("secret_sha256", sa.String(64), nullable=False, unique=True),
    sa.Column("began_at", UtcTime, nullable=False),
    sa.Column("ended_at", UtcTime),
)
