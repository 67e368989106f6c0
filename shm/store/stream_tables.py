"""The tables of permanent sensors; `tables` completes them and holds the rules for changes."""

from __future__ import annotations

import sqlalchemy as sa

from shm.store.columns import UtcTime, identity, metadata

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
