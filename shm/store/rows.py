"""Values of the store next to those of `shm.values`, frozen; `shm.store.tables` stores them."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import Any

import shm
from shm.documents import dump
from shm.values import (
    NAN,
    Alert,
    Averaged,
    BaselineCheck,
    Diagnosis,
    Doubt,
    Fingerprint,
    ForeignMode,
    FrequencyResponse,
    ModalTest,
    Posterior,
    QualityCheck,
    Selection,
    Summary,
    WatchedTest,
)


class Stage(StrEnum):
    """Progress of a recording or a test. A recording is where its least advanced test is."""

    RECEIVED = "received"
    IDENTIFIED = "identified"
    UPDATED = "updated"
    WATCHED = "watched"
    DONE = "done"
    REFUSED = "refused"
    HELD = "held"  # implausible: counts in nothing until a person has confirmed it


ENDED = (Stage.DONE, Stage.REFUSED, Stage.HELD)
"""Where a recording waits for no step: it is through, or for a person to look at."""


class DeliveryState(StrEnum):
    """State of a delivery."""

    WAITING = "waiting"
    DELIVERED = "delivered"
    GIVEN_UP = "given up"
    NOT_NEEDED = "not needed"
    """Acknowledged or resolved before its time came."""


class News(StrEnum):
    """The change of an alert's state that a delivery tells of."""

    RAISED = "raised"
    RESOLVED = "resolved"


OTHER = "other"
"""Stands for whatever a row says that this version has no name for."""


def sum_counts(known: Iterable[str], rows: Iterable[Sequence[Any]]) -> dict[str, int]:
    """Sum the counts in pairs of a name and a count; unknown names are summed under `OTHER`.

    Each name of `known` is counted, 0 where there is none.
    """
    counted: dict[str, int] = {str(name): 0 for name in known}
    for value, times in rows:
        name = value if value in counted else OTHER
        counted[name] = counted.get(name, 0) + int(times)
    return counted


DESCRIBED = "described"
"""Of a posterior's document: the hanger as it was described when it was made."""


@dataclass(frozen=True)
class Lineage:
    """Origin of a result: checksums of its input and settings, and the version.

    `described` is the description of the hanger among those settings, where it is known: kept
    beside a posterior, so that a later description can be compared with it.
    """

    input_sha256: str
    settings_sha256: str
    version: str
    described: Mapping[str, Any] | None = field(
        default=None, compare=False, repr=False, metadata={"stored": False}
    )

    @classmethod
    def of(
        cls, inputs: object, settings: object, described: Mapping[str, Any] | None = None
    ) -> Lineage:
        """The lineage of a result computed now from JSON-able `inputs` and `settings`."""
        return cls(checksum_of(inputs), checksum_of(settings), shm.__version__, described)

    @property
    def columns(self) -> dict[str, str]:
        """Return the part that has columns, and is in the lineage of what is made from it."""
        return {
            name: getattr(self, name) for name in ("input_sha256", "settings_sha256", "version")
        }


def checksum_of(document: object) -> str:
    """SHA-256 of a document's JSON text, as 64 hexadecimal digits."""
    return hashlib.sha256(dump(document).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class IdentifiedTest:
    """A test to be stored: its place in its file, its frequency response, what was dropped.

    `quality` and `set_aside` are empty where a file gave the modes. `times` are those of all files
    of the test, `fingerprint` is that of their samples, None where the modes were given; `signals`
    says which channels are doubtful. `possible_times` are several where the test has no time
    because the day in its file can be read in several orders.
    """

    test: ModalTest
    position: int = 0
    frequency_response: FrequencyResponse | None = None
    notes: tuple[str, ...] = ()
    quality: tuple[QualityCheck, ...] = ()
    set_aside: tuple[ForeignMode, ...] = ()
    times: tuple[datetime, ...] = ()
    fingerprint: Fingerprint | None = None
    signals: tuple[str, ...] = ()
    possible_times: tuple[datetime, ...] = ()


@dataclass(frozen=True, eq=False)
class StoredTest:
    """`time` is the test's own or, where it has none, the time of receipt.

    `key` is the file's checksum and the test's place in it: the same wherever and whenever the
    file is ingested.
    """

    id: int
    recording_id: int
    key: str
    hanger: int
    time: datetime
    stage: Stage
    test: ModalTest
    notes: tuple[str, ...]
    lineage: Lineage
    quality: tuple[QualityCheck, ...] = ()
    set_aside: tuple[ForeignMode, ...] = ()


@dataclass(frozen=True, eq=False)
class StoredPosterior:
    """A posterior with the time of its latest test and where it comes from."""

    id: int
    posterior: Posterior
    time: datetime
    lineage: Lineage


@dataclass(frozen=True, eq=False)
class StoredSelection:
    """A comparison of model classes, when it was made, and the class in force since.

    `model` is the most probable one, or one that was adopted.
    """

    id: int
    selection: Selection
    selected_at: datetime
    model: str


@dataclass(frozen=True, eq=False)
class Baseline:
    """The posterior that later tests of a hanger are compared with; who set it, when and why.

    `since` is the time from which on its tests were taken, where a person had the hanger compared
    with itself anew; tests before it belong to the baseline before. `described` is the hanger as
    it was described when the posterior was made; None of one of before that was kept.
    """

    id: int
    hanger: int
    posterior: Posterior
    set_at: datetime
    who: str
    why: str
    since: datetime | None = None
    described: Mapping[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class StoredDiagnosis:
    """A diagnosis of a hanger's gap, when it was made, and where it comes from."""

    id: int
    hanger: int
    diagnosis: Diagnosis
    diagnosed_at: datetime
    lineage: Lineage


@dataclass(frozen=True)
class Adoption:
    """Effects that become part of a hanger's model class: `model` is that class's name.

    `effect` and `at` are those of a `Cause`. The gaps are the root mean square by which predicted
    frequencies lie off the measured ones on the baseline's tests: in the class before, and in this
    one. `diagnosis_id` is None where no diagnosis called for it.
    """

    hanger: int
    model: str
    baseline_model: str
    effect: str
    at: str
    why: str
    who: str
    gap_before_percent: float = NAN
    gap_percent: float = NAN
    diagnosis_id: int | None = None


@dataclass(frozen=True)
class StoredAdoption:
    """An adoption and when it was made; where it was undone, when, why and by whom."""

    id: int
    adoption: Adoption
    adopted_at: datetime
    undone_at: datetime | None = None
    undone_why: str = ""
    undone_who: str = ""


@dataclass(frozen=True, eq=False)
class StoredWatch:
    """Result of the watch after a test, and the baseline it was compared with.

    `alert_probability` is by how much its alert was judged; NaN of a former version. `called` is
    the alert that it called for, raised or not; None of a former version, too.
    """

    id: int
    hanger: int
    baseline_id: int
    watched: WatchedTest
    alert_probability: float = NAN
    called: Alert | None = None


@dataclass(frozen=True)
class WatchCheckpoint:
    """Stored state of a watch, made with what `key` tells."""

    key: str
    last_test_time: datetime
    content: bytes


class Ending(StrEnum):
    """Name how an alert ended, and with it what may be said of its condition."""

    OVER = "over"  # its condition is
    BY_PERSON = "by a person"  # who knows what was known by then
    # Nobody has judged its condition: tests may call for it as if it had never been raised.
    JUDGED_AGAIN = "judged again"  # with other thresholds
    TEST_DISCARDED = "test discarded"


@dataclass(frozen=True)
class AlertNote:
    """Note on an alert, made once: who has taken note of it, or found that its condition ended.

    `ending` is None of an acknowledgement, which ends nothing.
    """

    alert_id: int
    who: str
    why: str
    at: datetime
    ending: Ending | None = None

    @property
    def as_document(self) -> dict[str, object]:
        """Return who, why and when, for documents."""
        return {"who": self.who, "why": self.why, "at": self.at}


@dataclass(frozen=True)
class StoredAlert:
    """An alert and when it was raised; its condition stands while it has no resolution.

    `baseline_id` is the number of the baseline against which it was raised, None of one that has
    none: of a held test, say.
    """

    id: int
    alert: Alert
    raised_at: datetime
    acknowledgement: AlertNote | None = None
    resolution: AlertNote | None = None
    baseline_id: int | None = None

    @property
    def is_open(self) -> bool:
        """Return True while its condition holds and nobody has acknowledged it."""
        return self.acknowledgement is None and self.resolution is None


@dataclass(frozen=True)
class Reconciled:
    """Alerts to open, and the numbers of open ones to close, each with the reason in words."""

    to_open: tuple[Alert, ...] = ()
    to_close: Mapping[int, tuple[Ending, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Silence:
    """From when until when no hook is told of a hanger, or of any where `hanger` is None.

    In a maintenance window tests are taken in but not watched. `ended_at` is when a person ended
    it before its time.
    """

    id: int
    hanger: int | None
    starts_at: datetime
    ends_at: datetime
    is_maintenance: bool
    who: str
    why: str
    made_at: datetime
    ended_at: datetime | None = None
    ended_who: str = ""

    @property
    def until(self) -> datetime:
        """Return its end, planned or made earlier by a person."""
        return self.ends_at if self.ended_at is None else min(self.ended_at, self.ends_at)

    def is_over(self, at: datetime) -> bool:
        """Return True if it is not in force and will not be: one may end before it begins."""
        return self.until <= max(at, self.starts_at)

    def is_in_force(self, at: datetime) -> bool:
        """Return True from its beginning to its end."""
        return self.starts_at <= at < self.until

    def covers(self, hanger: int, at: datetime) -> bool:
        """Return True if it is in force for a hanger at a time; its end is not part of it."""
        return self.hanger in (None, hanger) and self.is_in_force(at)


@dataclass(frozen=True)
class Delivery:
    """One alert on its way to one hook: the outbox.

    `message_id` is None until it is due; deliveries of one message have the same.
    """

    id: int
    stored: StoredAlert
    hook: str
    news: News
    state: DeliveryState
    attempts: int
    next_attempt_at: datetime
    last_error: str = ""
    ended_at: datetime | None = None
    message_id: int | None = None

    @property
    def alert(self) -> Alert:
        return self.stored.alert


@dataclass(frozen=True)
class FormerPosterior:
    """A posterior of one test, in force or superseded, without its samples."""

    id: int
    model: str
    updated_at: datetime
    superseded_at: datetime | None
    lineage: Lineage


@dataclass(frozen=True)
class FormerTest:
    """One identification of a test, in force or superseded, and the posteriors made from it."""

    id: int
    recording_id: int
    name: str
    stage: Stage
    identified_at: datetime
    superseded_at: datetime | None
    lineage: Lineage
    posteriors: tuple[FormerPosterior, ...]


ON_THE_WAY = (Stage.RECEIVED, Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)
"""Where recordings stand that are not through."""


class Outcome(StrEnum):
    """Outcome of receiving a file."""

    NEW = "new"
    RESUMED = "resumed"  # the same spool entry, after a crash before it was removed
    DUPLICATE = "duplicate"  # the same bytes dropped again
    REOPENED = "reopened"  # refused before, dropped again: tried again
    DISCARDED = "discarded before"  # a person discarded it, dropped again: it stays so
    REDESCRIBED = "redescribed"  # the same bytes with another sidecar: done again with that


@dataclass(frozen=True)
class ReceivedFile:
    """A file as it came in; `archived_as` and `sidecar_as` are relative to the archive.

    `modified_at` is when the file was last written, as its folder says; copying resets that.
    """

    sha256: str
    file_name: str
    size_bytes: int
    arrival: str
    archived_as: str | None = None
    sidecar_as: str | None = None
    modified_at: datetime | None = None


@dataclass(frozen=True)
class StoredRecording:
    """A file that was taken in and how far it has come; `reason` says why it was refused."""

    id: int
    file: ReceivedFile
    received_at: datetime
    stage: Stage
    hanger: int | None = None
    reason: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Receipt:
    """Outcome of taking a file in, with its recording."""

    outcome: Outcome
    recording: StoredRecording


@dataclass(frozen=True)
class Rerun:
    """Tests that were sent back to be done again, and the results that this has superseded.

    `of_baseline` are those of the tests from which the hanger's baseline was made: they are not
    watched, and the baseline stays as it was made until it is set anew.
    """

    recording: StoredRecording
    tests: tuple[str, ...]
    posteriors: int
    watches: int
    of_baseline: tuple[str, ...]


@dataclass(frozen=True)
class Deaths:
    """Count the processes that died at a recording since it last moved on, the last `last_at`."""

    count: int
    last_at: datetime


class Decision(StrEnum):
    """Decision of a person on a recording; `REPLACED`: it was done again before one was made.

    `WITHDRAWN`: it counted, and was discarded then; `REINSTATED`: what was discarded counts again.
    Of these two nothing was held, and no alert told.
    """

    CONFIRMED = "confirmed"
    DISCARDED = "discarded"
    REPLACED = "replaced"
    WITHDRAWN = "withdrawn"
    REINSTATED = "reinstated"


@dataclass(frozen=True)
class HeldTest:
    """One test that is held and why: its place in its file, and the shift of the tension that it
    implies (a fraction, NaN where that cannot be said)."""

    position: int
    name: str
    doubts: tuple[Doubt, ...]
    tension_shift: float = NAN


@dataclass(frozen=True)
class Hold:
    """A recording that is or was held; `message` is what its owner was told of it.

    `time` is the one that a person gave its test. All of `decision`, `decided_at`, `who`, `why` are
    empty while nobody has decided.
    """

    id: int
    recording_id: int
    file_name: str
    hanger: int
    held_at: datetime
    message: str
    tests: tuple[HeldTest, ...]
    sidecar_as: str | None = None
    decision: Decision | None = None
    decided_at: datetime | None = None
    who: str = ""
    why: str = ""
    time: datetime | None = None

    @property
    def is_for_its_clock(self) -> bool:
        """Return True if only the time of its tests is in doubt, not what they measured."""
        return bool(self.doubts) and all(each.check.startswith("clock") for each in self.doubts)

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Of all its tests, each check once."""
        return tuple({d.check: d for test in self.tests for d in test.doubts}.values())

    @property
    def time_unknown(self) -> bool:
        """Return True if the time that its test claims is certainly wrong."""
        return any(doubt.time_unknown for doubt in self.doubts)

    @property
    def is_in(self) -> bool:
        """Return True if a person said that it counts."""
        return self.decision in (Decision.CONFIRMED, Decision.REINSTATED)

    @property
    def is_out(self) -> bool:
        """Return True if a person said that it does not."""
        return self.decision in (Decision.DISCARDED, Decision.WITHDRAWN)


@dataclass(frozen=True)
class TestRow:
    """A test by its name; `time` is its own or, where it has none, the time of receipt."""

    __test__ = False  # no test, though named so

    id: int
    recording_id: int
    hanger: int
    name: str
    time: datetime
    stage: Stage


@dataclass(frozen=True)
class LatestTest:
    """The number of a hanger's tests and the time of the latest."""

    tests: int
    time: datetime


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """A posterior in numbers.

    `stiffness` is that of each plane's ends as `shm.models.end_stiffness` has it, log10 of
    N m/rad, by `transverse_end_stiffness` and the like; empty where the class clamps the ends.
    `parameters` are those of the class, as it takes them, and sigma. `averaged` is the tension over
    all model classes of the hanger.
    """

    tension_n: Summary
    most_probable_tension_n: float
    stiffness: Mapping[str, Summary]
    parameters: Mapping[str, Summary]
    averaged: Averaged


@dataclass(frozen=True, kw_only=True)
class TrendPoint(Numbers):
    """One test in the history of a hanger, with its posterior in numbers.

    `taken_at` is None where the test tells no time and `time` is that of its receipt.
    """

    test_id: int
    test: str
    hanger: int
    time: datetime
    taken_at: datetime | None
    temperature_c: float
    posterior_id: int
    model: str


@dataclass(frozen=True, kw_only=True)
class BaselineGlance(Numbers):
    """A baseline in force with its posterior in numbers; see `Baseline`.

    `temperature_c` is the mean of its tests, NaN where none has one; `check` is None of a baseline
    that a former version made; `begins_at` is when the first of its tests was made.
    """

    id: int
    hanger: int
    set_at: datetime
    who: str
    why: str
    since: datetime | None
    model: str
    tests: tuple[str, ...]
    temperature_c: float
    check: BaselineCheck | None = None
    begins_at: datetime | None = None
    described: Mapping[str, Any] | None = None


class EventKind(StrEnum):
    """Kind of an event of a hanger other than a test."""

    BASELINE = "baseline"
    ADOPTED = "adopted"
    UNDONE = "adoption undone"
    ALERT = "alert"
    ACKNOWLEDGED = "acknowledged"


@dataclass(frozen=True)
class HangerEvent:
    """Something that happened to a hanger, and who did it and why; `id` is that of its kind's row.

    An alert has its message for a reason and nobody who did it; its time is that of its test.
    """

    at: datetime
    kind: EventKind
    who: str
    why: str
    id: int


class Role(StrEnum):
    """Role of a person; each may what the one before may."""

    READER = "reader"
    OPERATOR = "operator"
    ENGINEER = "engineer"

    def may(self, needed: Role) -> bool:
        """Return True if this role may do what `needed` may."""
        order = list(Role)
        return order.index(self) >= order.index(needed)


@dataclass(frozen=True)
class User:
    """A person who may sign in, or once might."""

    id: int
    name: str
    role: Role
    made_at: datetime
    removed_at: datetime | None = None
    single_sign_on: bool = False
    """Whether a provider alone lets in, which says who it is; else a password alone does."""


class Scope(StrEnum):
    """Right of a token; one that may write may read."""

    READ = "read"
    WRITE = "write"


@dataclass(frozen=True)
class StoredToken:
    """A token without its secret."""

    id: int
    name: str
    scopes: frozenset[Scope]
    created_at: datetime
    revoked_at: datetime | None = None
    last_used_at: datetime | None = None


@dataclass(frozen=True)
class ArchiveCopy:
    """A recording whose file, and sidecar if it has one, were copied whole into a folder."""

    recording_id: int
    folder: str
    at: datetime


@dataclass(frozen=True)
class StreamWatchCheckpoint:
    """State of the watch of a hanger's sensors, and up to when it has seen readings."""

    reading_time: datetime
    content: bytes


@dataclass(frozen=True)
class ChangedSetting:
    """The value of a key of `bridge.toml` that holds instead of what the file says."""

    key: str
    value: float | str
    at: datetime
    who: str
    id: int = 0

    def __str__(self) -> str:
        setting, by = self.key.replace(".", " "), f"{self.who} on {self.at:%Y-%m-%d}"
        return f"{setting} = {value_text(self.value)} instead of what bridge.toml says, by {by}"

    def is_of(self, hanger: int) -> bool:
        """Return True if it changes a hanger, or all of them."""
        return self.key.startswith(("settings.", f"hanger.{hanger}."))


def value_text(value: float | str | None) -> str:
    """A value as people read it."""
    if isinstance(value, str):
        return value or "none"
    return "not set" if value is None or math.isnan(value) else f"{value:.10g}"


@dataclass(frozen=True)
class Entry:
    """Entry of the journal: the event, its subject, when, by whom, by which way, why, which shm.

    A step has the name of its `test`, where it is of one; `version` is None where it was not noted.
    """

    at: datetime
    kind: str
    recording_id: int | None
    test_id: int | None
    subject: str
    detail: str
    who: str | None
    via: str | None
    version: str | None
    id: int = 0
    test: str | None = field(default=None, metadata={"stored": False})

    @property
    def message(self) -> str:
        """Return what was noticed; of a decision who made it, too."""
        if self.kind not in (*Decision,) or not self.who:
            return self.detail
        return f"{self.kind} by {self.who}" + (f": {self.detail}" if self.detail else "")
