"""The tables. Every change here needs a migration in `migrations/versions` and a new `SCHEMA`.

The columns of a `mapped` table are the fields of its class in `shm.store.rows`; here are those
whose type does not follow from the field, and those of no field.
"""

from __future__ import annotations

from typing import Any

import sqlalchemy as sa

from shm.store.columns import (
    Blank,
    Document,
    Json,
    Name,
    Names,
    Number,
    UtcTime,
    identity,
    index_in_force,
    mapped,
    model,
    note_on_alert,
    reference,
    superseded_at,
    unique_where,
)
from shm.store.columns import metadata as metadata
from shm.store.rows import (
    ArchiveCopy,
    Baseline,
    ChangedSetting,
    Delivery,
    Entry,
    Hold,
    Scope,
    Silence,
    Stage,
    StoredAdoption,
    StoredDiagnosis,
    StoredPosterior,
    StoredRecording,
    StoredTest,
    StoredToken,
    StoredWatch,
    StreamWatchCheckpoint,
    User,
    WatchCheckpoint,
)
from shm.values import Alert, Drift, ForeignMode, QualityCheck
from shm.values.notes import Note
from shm.values.stream import StreamEvent

SCHEMA = "0017"

_OF_TESTS = ("hanger", "time", "stage", "name", "taken_at", "temperature_c")
_LINEAGE = {
    "input_sha256": sa.String(64),
    "settings_sha256": sa.String(64),
    "version": sa.String(32),
}


def _hanger(name: str | None = None) -> sa.Column[int]:
    return sa.Column(name, sa.Integer, nullable=False, index=True)


# A raw file that was received. `arrival` marks the spool entry it came as, so that a receipt cut
# short by a crash is not mistaken for the same file dropped twice.
recordings = mapped(
    "recordings",
    StoredRecording,
    sha256=sa.Column(sa.String(64), nullable=False, unique=True),
    size_bytes=sa.BigInteger,
    stage=sa.Column(Name(Stage), nullable=False, index=True),
    reason=Json(dict[str, Any]),
)

# What the samples of a recording look like, to know a copy of them by; see `Fingerprint`.
fingerprints = sa.Table(
    "fingerprints",
    metadata,
    sa.Column("recording_id", sa.ForeignKey("recordings.id"), primary_key=True),
    sa.Column("digest", sa.String(64), nullable=False, index=True),
    sa.Column("shapes", sa.LargeBinary, nullable=False),
)

# Why a recording is held until a person has looked, and what came of that: who decided, when and
# why, and the time that its test was given. The newest row of a recording holds.
holds = mapped(
    "holds",
    Hold,
    sa.Column("document", Document, nullable=False),
    sa.Index(None, "recording_id"),
    without=("file_name", "hanger", "message", "tests", "sidecar_as"),
    recording_id=reference("recordings"),
    who=Blank,
    why=Blank,
)

# One modal test. `time` is the test's own or, where it has none, the time of receipt. What is
# asked of all tests at once, `taken_at` and `temperature_c`, stands beside the long
# document that has it.
tests = mapped(
    "tests",
    StoredTest,
    sa.Column("position", sa.Integer, nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("document", Document, nullable=False),
    sa.Column("frequency_response", sa.LargeBinary),
    sa.Column("identified_at", UtcTime, nullable=False),
    superseded_at(),
    sa.Column("taken_at", UtcTime),
    sa.Column("temperature_c", Number),
    unique_where("superseded_at", "tests", "hanger", "name"),
    index_in_force("ix_tests_in_force", *_OF_TESTS),
    sa.Index(None, "recording_id"),
    without=("key", "test"),
    recording_id=reference("recordings"),
    stage=sa.Column(Name(Stage), nullable=False, index=True),
    notes=Json(tuple[str, ...]),
    quality=Json(tuple[QualityCheck, ...], absent=()),
    set_aside=Json(tuple[ForeignMode, ...], absent=()),
    **_LINEAGE,
)

# Parameters of one model class given one or several tests; `time` is that of the latest of them.
posteriors = mapped(
    "posteriors",
    StoredPosterior,
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    model(),
    sa.Column("document", Document, nullable=False),
    sa.Column("samples", sa.LargeBinary, nullable=False),
    sa.Column("log_evidence", Number),
    sa.Column("log_evidence_sd", Number),
    sa.Column("seed", sa.BigInteger, nullable=False),
    sa.Column("updated_at", UtcTime, nullable=False),
    superseded_at(),
    index_in_force("ix_posteriors_in_force", "hanger", "time", "model"),
    without=("posterior",),
    **_LINEAGE,
)

# A posterior in numbers, so that years of tests are shown without their samples. `key` tells which
# description of the hanger turned the samples into stiffness; a row may be thrown away at will.
summaries = sa.Table(
    "summaries",
    metadata,
    sa.Column("posterior_id", sa.ForeignKey("posteriors.id"), primary_key=True),
    sa.Column("key", sa.String(64), nullable=False),
    sa.Column("document", Document, nullable=False),
)

posterior_tests = sa.Table(
    "posterior_tests",
    metadata,
    sa.Column("posterior_id", sa.ForeignKey("posteriors.id"), primary_key=True),
    sa.Column("test_id", sa.ForeignKey("tests.id"), primary_key=True),
    sa.Index(None, "test_id"),
)

# The model classes that competed for a hanger; the newest row of a hanger holds, unless it came
# with an adoption that was undone. `model` has rank 0: the most probable, or the adopted one.
selections = sa.Table(
    "selections",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    model(),
    sa.Column("selected_at", UtcTime, nullable=False),
)

selection_entries = sa.Table(
    "selection_entries",
    metadata,
    sa.Column("selection_id", sa.ForeignKey("selections.id"), primary_key=True),
    sa.Column("posterior_id", sa.ForeignKey("posteriors.id"), primary_key=True),
    sa.Column("rank", sa.Integer, nullable=False),
    sa.Column("probability", Number),
)

# What later tests of a hanger are compared with; the newest row of a hanger in its class holds,
# unless it came with an adoption that was undone. `since` is the day from which on a person had the
# hanger compared with itself anew; empty of the first baseline, and of those that were adopted.
baselines = mapped(
    "baselines",
    Baseline,
    reference("posteriors"),
    without=("posterior", "described"),
    hanger=_hanger(),
)

# A quantity's name is at most log10_k and a number of two digits; four times that.
drifts = mapped(
    "drifts",
    Drift,
    identity(),
    reference("tests"),
    reference("baselines"),
    superseded_at(),
    unique_where("superseded_at", "drifts", "test_id", "baseline_id", "quantity"),
    without=("test",),
    hanger=_hanger(),
    quantity=sa.String(64),
)

# What the sequential test says after one test, and whether it has called a change; the shifts of
# the quantities stand in `drifts`.
watches = mapped(
    "watches",
    StoredWatch,
    reference("tests"),
    sa.Column("time", UtcTime, nullable=False),
    sa.Column("document", Document, nullable=False),
    sa.Column("called", sa.Boolean, nullable=False, server_default=sa.false()),
    superseded_at(),
    unique_where("superseded_at", "watches", "test_id", "baseline_id"),
    index_in_force("ix_watches_in_force", "hanger", "baseline_id", "time", "called"),
    without=("watched", "alert_probability", "called"),
    hanger=_hanger(),
    baseline_id=reference("baselines"),
)

# What the watch has made of all tests up to `last_test_time`, so that the next one is not compared
# with them all again. `key` tells with what it was made; a kept state may be thrown away at will.
watch_states = mapped(
    "watch_states",
    WatchCheckpoint,
    identity(),
    _hanger("hanger"),
    sa.Column("baseline_id", sa.ForeignKey("baselines.id"), nullable=False, unique=True),
)

# `baseline_id` is empty of the notice that a test is held: it was compared with nothing. `test_id`
# is empty of what the readings of a stream raised. `noted`: who has taken note of it, when, and
# what they say to it, once. `ended`: when its condition ended, and who found that, shm or a person.
alerts = sa.Table(
    "alerts",
    metadata,
    identity(),
    sa.Column("key", sa.String(255), nullable=False, unique=True),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    reference("tests", nullable=True),
    reference("baselines", nullable=True),
    sa.Column("time", UtcTime, nullable=False),
    sa.Column("raised_at", UtcTime, nullable=False),
    sa.Column("message", sa.Text, nullable=False),
    sa.Column("document", Json(Alert, cached=True), nullable=False),
    *note_on_alert("noted"),
    *note_on_alert("ended"),
    sa.Column("ended_kind", sa.String(16)),
)

# From when until when hooks are not told of a hanger, of all where `hanger` is empty. A maintenance
# window (`is_maintenance`) also keeps tests of then from the watch. `ended_at` is when a person
# ended it before its time. Never changed otherwise, never taken out.
silences = mapped("silences", Silence, ended_who=Blank)

# The outbox: what has yet to be told to which hook, and how that went. `news` is the change of
# state that it tells of, `raised` or `resolved`. `message_id` is empty until the first attempt is
# due; from then on it is the number of the first delivery of the same message, and never changes.
deliveries = mapped(
    "deliveries",
    Delivery,
    reference("alerts"),
    sa.UniqueConstraint("alert_id", "hook", "news"),
    sa.Index(None, "state", "next_attempt_at"),
    without=("stored",),
    hook=sa.String(255),
    message_id=sa.Column(sa.Integer, index=True),
)

# Why a hanger's frequencies differ from a model class's; the newest row of a hanger holds.
diagnoses = mapped(
    "diagnoses",
    StoredDiagnosis,
    sa.Column("tests", Document, nullable=False),
    sa.Column("document", Document, nullable=False),
    without=("diagnosis",),
    hanger=_hanger(),
    **_LINEAGE,
)

# A baseline with effects, made a model class of a hanger: who, when, why, and its undoing. The gaps
# are those of the class before and of this one, on the tests of the baseline that came with it.
adoptions = mapped(
    "adoptions",
    StoredAdoption,
    reference("selections"),
    reference("baselines"),
    hanger=_hanger(),
    model=model(),
    baseline_model=sa.String(64),
    diagnosis_id=sa.Column(sa.ForeignKey("diagnoses.id")),
    undone_why=Blank,
    undone_who=Blank,
)

# What happened to what, when, by whom, why and with which shm: each stage that a recording or a
# test has reached, what was noticed on the way, what people changed. Written in the same
# transaction as what it tells of, never changed. `who` is empty of what nobody asked for; `via` is
# the way that a change came: page, API, command line. `version` is empty where it is not known.
journal = mapped(
    "journal",
    Entry,
    sa.Index(None, "recording_id"),
    sa.Index(None, "test_id"),
    at=sa.Column(UtcTime, nullable=False, index=True),
    kind=sa.String(64),
    recording_id=reference("recordings", nullable=True),
    test_id=reference("tests", nullable=True),
    via=sa.String(16),
    version=sa.String(32),
)

# Where a second copy of a raw file lies: only such a one may be taken out of the archive.
archive_copies = mapped(
    "archive_copies",
    ArchiveCopy,
    identity(),
    sa.UniqueConstraint("recording_id", "folder"),
    recording_id=reference("recordings"),
)

# Who may read or write over the network. Only the checksum of a token is kept.
tokens = mapped(
    "tokens",
    StoredToken,
    sa.Column("token_sha256", sa.String(64), nullable=False, unique=True),
    unique_where("revoked_at", "tokens", "name"),
    name=sa.String(255),
    scopes=Names(Scope, 64),
)

# Who may sign in by name. Of a password only its salted, slow hash is kept; it is
# empty for who comes by single sign-on alone.
users = mapped(
    "users",
    User,
    sa.Column("password_hash", sa.Text, nullable=False),
    unique_where("removed_at", "users", "name"),
    without=("single_sign_on",),
    name=sa.String(255),
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
changed_settings = mapped(
    "changed_settings",
    ChangedSetting,
    sa.Column("document", Json(Any)),
    sa.Index(None, "key"),
    without=("value",),
    key=sa.String(255),
)

# What people saw or did at a hanger, at the bridge where `hanger` is empty, and when (`at`).
notes = mapped("notes", Note, sa.Column("photo", sa.LargeBinary), without=("has_photo",))


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
stream_events = mapped(
    "stream_events",
    StreamEvent,
    identity(),
    sa.Index(None, "start"),
    stream=sa.String(64),
    kind=sa.String(32),
    channel=sa.String(64),
)

# What the watch on the readings of a hanger goes on from; it may be thrown away at will.
stream_watch = mapped(
    "stream_watch",
    StreamWatchCheckpoint,
    sa.Column("hanger", sa.Integer, primary_key=True, autoincrement=False),
)

# The same as it was about a day apart, for hours that come late.
stream_watch_days = mapped(
    "stream_watch_days",
    StreamWatchCheckpoint,
    sa.Column("hanger", sa.Integer, primary_key=True, autoincrement=False),
    reading_time=sa.Column(UtcTime, primary_key=True),
)

# Up to when the windows of a stream are done.
stream_progress = sa.Table(
    "stream_progress",
    metadata,
    sa.Column("stream", sa.String(64), primary_key=True),
    sa.Column("done_until", UtcTime, nullable=False),
)
