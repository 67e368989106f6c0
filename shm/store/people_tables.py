"""The tables of people and of what they change; `tables` completes them and holds the rules."""

from __future__ import annotations

import sqlalchemy as sa

from shm.store.columns import Document, UtcTime, identity, metadata, reference, unique_where

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

# Who changed what. `via` is the way it came: page, API, command line.
audit = sa.Table(
    "audit",
    metadata,
    identity(),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("via", sa.String(16), nullable=False),
    sa.Column("action", sa.String(64), nullable=False),
    sa.Column("subject", sa.Text, nullable=False),
    sa.Column("detail", sa.Text, nullable=False),
)

# What the settings page says beside `bridge.toml`. The newest row of a key holds; one without a
# document gives the key back to `bridge.toml`.
changed_settings = sa.Table(
    "changed_settings",
    metadata,
    identity(),
    sa.Column("key", sa.String(255), nullable=False),
    sa.Column("document", Document),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Index(None, "key"),
)

# What people saw or did at a hanger, at the bridge where `hanger` is empty, and when (`at`).
notes = sa.Table(
    "notes",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer),
    sa.Column("at", UtcTime, nullable=False),
    sa.Column("kind", sa.String(16), nullable=False),
    sa.Column("text", sa.Text, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("written_at", UtcTime, nullable=False),
    sa.Column("photo", sa.LargeBinary),
    sa.Column("photo_checksum", sa.BigInteger),
)
