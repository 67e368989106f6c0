"""The tables. Every change here needs a migration in `migrations/versions` and a new `SCHEMA`."""

from __future__ import annotations

import sqlalchemy as sa

from shm.store.columns import (
    Document,
    Number,
    UtcTime,
    identity,
    index_in_force,
    lineage,
    model,
    note_on_alert,
    reference,
    superseded_at,
    unique_where,
)
from shm.store.columns import metadata as metadata
from shm.store.people_and_stream_tables import users as _of_people  # noqa: F401 - all are there

SCHEMA = "0016"

_OF_TESTS = ("hanger", "time", "stage", "name", "taken_at", "temperature_c")


# A raw file that was received. `arrival` marks the spool entry it came as, so that a receipt cut
# short by a crash is not mistaken for the same file dropped twice.
recordings = sa.Table(
    "recordings",
    metadata,
    identity(),
    sa.Column("sha256", sa.String(64), nullable=False, unique=True),
    sa.Column("file_name", sa.Text, nullable=False),
    sa.Column("size_bytes", sa.BigInteger, nullable=False),
    sa.Column("archived_as", sa.Text),
    sa.Column("sidecar_as", sa.Text),
    sa.Column("arrival", sa.Text, nullable=False),
    sa.Column("received_at", UtcTime, nullable=False),
    sa.Column("hanger", sa.Integer),
    sa.Column("stage", sa.String(16), nullable=False, index=True),
    sa.Column("reason", Document),
    sa.Column("modified_at", UtcTime),
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
holds = sa.Table(
    "holds",
    metadata,
    identity(),
    reference("recordings"),
    sa.Column("held_at", UtcTime, nullable=False),
    sa.Column("document", Document, nullable=False),
    sa.Column("decision", sa.String(16)),
    sa.Column("decided_at", UtcTime),
    sa.Column("who", sa.Text),
    sa.Column("why", sa.Text),
    sa.Column("time", UtcTime),
    sa.Index(None, "recording_id"),
)

# One modal test. `time` is the test's own or, where it has none, the time of receipt. What is
# asked of all tests at once, `taken_at` and `temperature_c`, stands beside the long
# document that has it.
tests = sa.Table(
    "tests",
    metadata,
    identity(),
    reference("recordings"),
    sa.Column("position", sa.Integer, nullable=False),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("hanger", sa.Integer, nullable=False),
    sa.Column("time", UtcTime, nullable=False),
    sa.Column("stage", sa.String(16), nullable=False, index=True),
    sa.Column("document", Document, nullable=False),
    sa.Column("frequency_response", sa.LargeBinary),
    sa.Column("notes", Document, nullable=False),
    sa.Column("quality", Document),
    sa.Column("set_aside", Document),
    *lineage(),
    sa.Column("identified_at", UtcTime, nullable=False),
    superseded_at(),
    sa.Column("taken_at", UtcTime),
    sa.Column("temperature_c", Number),
    unique_where("superseded_at", "tests", "hanger", "name"),
    index_in_force("ix_tests_in_force", *_OF_TESTS),
    sa.Index(None, "recording_id"),
)

# Parameters of one model class given one or several tests; `time` is that of the latest of them.
posteriors = sa.Table(
    "posteriors",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    model(),
    sa.Column("time", UtcTime, nullable=False),
    sa.Column("document", Document, nullable=False),
    sa.Column("samples", sa.LargeBinary, nullable=False),
    sa.Column("log_evidence", Number),
    sa.Column("log_evidence_sd", Number),
    sa.Column("seed", sa.BigInteger, nullable=False),
    *lineage(),
    sa.Column("updated_at", UtcTime, nullable=False),
    superseded_at(),
    index_in_force("ix_posteriors_in_force", "hanger", "time", "model"),
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
baselines = sa.Table(
    "baselines",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    reference("posteriors"),
    sa.Column("set_at", UtcTime, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("why", sa.Text, nullable=False),
    sa.Column("since", UtcTime),
)

# A quantity's name is at most log10_k and a number of two digits; four times that.
drifts = sa.Table(
    "drifts",
    metadata,
    identity(),
    reference("tests"),
    reference("baselines"),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    sa.Column("time", UtcTime, nullable=False),
    sa.Column("quantity", sa.String(64), nullable=False),
    *(
        sa.Column(name, Number)
        for name in ("baseline", "value", "shift_mean", "shift_sd", "threshold", "probability")
    ),
    superseded_at(),
    unique_where("superseded_at", "drifts", "test_id", "baseline_id", "quantity"),
)

# What the sequential test says after one test, and whether it has called a change; the shifts of
# the quantities stand in `drifts`.
watches = sa.Table(
    "watches",
    metadata,
    identity(),
    reference("tests"),
    reference("baselines"),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    sa.Column("time", UtcTime, nullable=False),
    sa.Column("document", Document, nullable=False),
    sa.Column("called", sa.Boolean, nullable=False, server_default=sa.false()),
    superseded_at(),
    unique_where("superseded_at", "watches", "test_id", "baseline_id"),
    index_in_force("ix_watches_in_force", "hanger", "baseline_id", "time", "called"),
)

# What the watch has made of all tests up to `last_test_time`, so that the next one is not compared
# with them all again. `key` tells with what it was made; a kept state may be thrown away at will.
watch_states = sa.Table(
    "watch_states",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    sa.Column("baseline_id", sa.ForeignKey("baselines.id"), nullable=False, unique=True),
    sa.Column("key", sa.Text, nullable=False),
    sa.Column("last_test_time", UtcTime, nullable=False),
    sa.Column("content", sa.LargeBinary, nullable=False),
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
    sa.Column("document", Document, nullable=False),
    *note_on_alert("noted"),
    *note_on_alert("ended"),
)

# From when until when hooks are not told of a hanger, of all where `hanger` is empty. A maintenance
# window (`is_maintenance`) also keeps tests of then from the watch. `ended_at` is when a person
# ended it before its time. Never changed otherwise, never taken out.
silences = sa.Table(
    "silences",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer),
    sa.Column("starts_at", UtcTime, nullable=False),
    sa.Column("ends_at", UtcTime, nullable=False),
    sa.Column("is_maintenance", sa.Boolean, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("why", sa.Text, nullable=False),
    sa.Column("made_at", UtcTime, nullable=False),
    sa.Column("ended_at", UtcTime),
    sa.Column("ended_who", sa.Text),
)

# The outbox: what has yet to be told to which hook, and how that went. `news` is the change of
# state that it tells of, `raised` or `resolved`. `message_id` is empty until the first attempt is
# due; from then on it is the number of the first delivery of the same message, and never changes.
deliveries = sa.Table(
    "deliveries",
    metadata,
    identity(),
    reference("alerts"),
    sa.Column("hook", sa.String(255), nullable=False),
    sa.Column("news", sa.String(16), nullable=False),
    sa.Column("state", sa.String(16), nullable=False),
    sa.Column("attempts", sa.Integer, nullable=False),
    sa.Column("next_attempt_at", UtcTime, nullable=False),
    sa.Column("last_error", sa.Text, nullable=False),
    sa.Column("ended_at", UtcTime),
    sa.Column("message_id", sa.Integer, index=True),
    sa.UniqueConstraint("alert_id", "hook", "news"),
    sa.Index(None, "state", "next_attempt_at"),
)

# Why a hanger's frequencies differ from a model class's; the newest row of a hanger holds.
diagnoses = sa.Table(
    "diagnoses",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    sa.Column("diagnosed_at", UtcTime, nullable=False),
    sa.Column("tests", Document, nullable=False),
    sa.Column("document", Document, nullable=False),
    *lineage(),
)

# A baseline with effects, made a model class of a hanger: who, when, why, and its undoing. The gaps
# are those of the class before and of this one, on the tests of the baseline that came with it.
adoptions = sa.Table(
    "adoptions",
    metadata,
    identity(),
    sa.Column("hanger", sa.Integer, nullable=False, index=True),
    model(),
    sa.Column("baseline_model", sa.String(64), nullable=False),
    sa.Column("effect", sa.Text, nullable=False),
    sa.Column("at", sa.Text, nullable=False),
    sa.Column("why", sa.Text, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("gap_before_percent", Number),
    sa.Column("gap_percent", Number),
    sa.Column("adopted_at", UtcTime, nullable=False),
    sa.Column("diagnosis_id", sa.ForeignKey("diagnoses.id")),
    reference("selections"),
    reference("baselines"),
    sa.Column("undone_at", UtcTime),
    sa.Column("undone_why", sa.Text),
    sa.Column("undone_who", sa.Text),
)

# What happened to what, when, by whom, why and with which shm: each stage that a recording or a
# test has reached, what was noticed on the way, what people changed. Written in the same
# transaction as what it tells of, never changed. `who` is empty of what nobody asked for; `via` is
# the way that a change came: page, API, command line. `version` is empty where it is not known.
journal = sa.Table(
    "journal",
    metadata,
    identity(),
    sa.Column("at", UtcTime, nullable=False, index=True),
    sa.Column("kind", sa.String(64), nullable=False),
    reference("recordings", nullable=True),
    reference("tests", nullable=True),
    sa.Column("subject", sa.Text, nullable=False),
    sa.Column("detail", sa.Text, nullable=False),
    sa.Column("who", sa.Text),
    sa.Column("via", sa.String(16)),
    sa.Column("version", sa.String(32)),
    sa.Index(None, "recording_id"),
    sa.Index(None, "test_id"),
)

# Where a second copy of a raw file lies: only such a one may be taken out of the archive.
archive_copies = sa.Table(
    "archive_copies",
    metadata,
    identity(),
    reference("recordings"),
    sa.Column("folder", sa.Text, nullable=False),
    sa.Column("at", UtcTime, nullable=False),
    sa.UniqueConstraint("recording_id", "folder"),
)

# Who may read or write over the network. Only the checksum of a token is kept.
tokens = sa.Table(
    "tokens",
    metadata,
    identity(),
    sa.Column("name", sa.String(255), nullable=False),
    sa.Column("token_sha256", sa.String(64), nullable=False, unique=True),
    sa.Column("scopes", sa.String(64), nullable=False),
    sa.Column("created_at", UtcTime, nullable=False),
    sa.Column("revoked_at", UtcTime),
    sa.Column("last_used_at", UtcTime),
    unique_where("revoked_at", "tokens", "name"),
)
