"""The tables of people and of permanent sensors; `tables` completes them and holds the rules."""

from __future__ import annotations

import sqlalchemy as sa

from shm.store.columns import Document, UtcTime, identity, metadata, reference, unique_where

# Who may sign in by name. Of a password only its salted, slow hash is kept; it is
# empty for who comes by single sign-on alone.
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
)


# What a window of a stream said: a `WindowReading` as compact JSON, some hundred thousand of them.
stream_windows = sa.Table(
    "stream_windows",
    metadata,
    identity(),
    sa.Column("stream", sa.String(64), nullable=False),
    sa.Column("hanger", sa.Integer, nullable=False),
    sa.Column("start", UtcTime, nullable=False),
    sa.Column("has_modes", sa.Boolean, nullable=False),
    sa.Column("document", sa.Text, nullable=False),
    sa.UniqueConstraint("stream", "start"),
    sa.Index(None, "hanger", "start"),
)

# Windows of an hour, six hours or a day as one.
pooled_readings = sa.Table(
    "pooled_readings",
    metadata,
    identity(),
    sa.Column("stream", sa.String(64), nullable=False),
    sa.Column("hanger", sa.Integer, nullable=False),
    sa.Column("period", sa.String(16), nullable=False),
    sa.Column("start", UtcTime, nullable=False),
    sa.Column("document", sa.Text, nullable=False),
    sa.UniqueConstraint("stream", "period", "start"),
    sa.Index(None, "hanger", "period", "start"),
)

# What was noticed of a stream, its clock or a sensor.
stream_events = sa.Table(
    "stream_events",
    metadata,
    identity(),
    sa.Column("stream", sa.String(64), nullable=False),
    sa.Column("kind", sa.String(32), nullable=False),
    sa.Column("start", UtcTime, nullable=False),
    sa.Column("end", UtcTime, nullable=False),
    sa.Column("detail", sa.Text, nullable=False),
    sa.Column("channel", sa.String(64), nullable=False),
    sa.Index(None, "start"),
)

# What the watch on the readings of a hanger goes on from; it may be thrown away at will.
stream_watch = sa.Table(
    "stream_watch",
    metadata,
    sa.Column("hanger", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("reading_time", UtcTime, nullable=False),
    sa.Column("content", sa.LargeBinary, nullable=False),
)

# The same as it was about a day apart, for hours that come late.
stream_watch_days = sa.Table(
    "stream_watch_days",
    metadata,
    sa.Column("hanger", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("reading_time", UtcTime, primary_key=True),
    sa.Column("content", sa.LargeBinary, nullable=False),
)

# Up to when the windows of a stream are done.
stream_progress = sa.Table(
    "stream_progress",
    metadata,
    sa.Column("stream", sa.String(64), primary_key=True),
    sa.Column("done_until", UtcTime, nullable=False),
)
