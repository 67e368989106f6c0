"""What the store hands out beside the nouns of `shm.values`: frozen rows, complete at birth."""

from __future__ import annotations

import hashlib
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
    Diagnosis,
    Fingerprint,
    ForeignMode,
    FrequencyResponse,
    ModalTest,
    Posterior,
    QualityCheck,
    Selection,
    WatchedTest,
)


class Stage(StrEnum):
    """How far a recording or a test has come. A recording stands where its last test stands."""

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
    """What has become of a delivery."""

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


def counts_by_name(known: type[StrEnum], rows: Iterable[Sequence[Any]]) -> dict[str, int]:
    """How many rows say what: each name of `known`, 0 where there is none, and `OTHER` where a row
    says something else, as one of a newer version may.

    `rows` are pairs of what is said and how often. Counting never fails for what a row says.
    """
    counted: dict[str, int] = {str(name): 0 for name in known}
    for said, times in rows:
        name = said if said in counted else OTHER
        counted[name] = counted.get(name, 0) + int(times)
    return counted


DESCRIBED = "described"
"""Of a posterior's document: the hanger as it was described when it was made."""


@dataclass(frozen=True)
class Lineage:
    """Where a result comes from: checksums of its input and settings, and the version.

    `described` is the description of the hanger among those settings, where it is known: kept
    beside a posterior, so that a later description can be compared with it.
    """

    input_sha256: str
    settings_sha256: str
    version: str
    described: Mapping[str, Any] | None = field(default=None, compare=False, repr=False)

    @classmethod
    def of(
        cls, inputs: object, settings: object, described: Mapping[str, Any] | None = None
    ) -> Lineage:
        """The lineage of a result computed now from JSON-able `inputs` and `settings`."""
        return cls(checksum_of(inputs), checksum_of(settings), shm.__version__, described)

    @property
    def columns(self) -> dict[str, str]:
        """What stands in columns of its own, and in the lineage of what is made from it."""
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
    """What the watch said after a test, and the baseline it was compared with.

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
class KeptWatch:
    """What a watch goes on from: bytes of its own, made with what `key` tells."""

    key: str
    last_test_time: datetime
    content: bytes


@dataclass(frozen=True)
class Note:
    """What somebody notes on an alert, once."""

    alert_id: int
    who: str
    why: str
    at: datetime

    @property
    def said(self) -> dict[str, object]:
        """Who, why and when, as documents tell it."""
        return {"who": self.who, "why": self.why, "at": self.at}


class Acknowledgement(Note):
    """Who has taken note of an alert, when, and what they say to it."""


class Resolution(Note):
    """When the condition that an alert tells of ended, who found that (`shm` or a person), why."""


@dataclass(frozen=True)
class StoredAlert:
    """An alert and when it was raised; its condition stands while it has no resolution.

    `baseline_id` is the number of the baseline against which it was raised, None of one that has
    none: of a held test, say.
    """

    id: int
    alert: Alert
    raised_at: datetime
    acknowledgement: Acknowledgement | None = None
    resolution: Resolution | None = None
    baseline_id: int | None = None

    @property
    def is_open(self) -> bool:
        """Whether it waits for somebody: it stands, and nobody has acknowledged it."""
        return self.acknowledgement is None and self.resolution is None


@dataclass(frozen=True)
class Reconciled:
    """Alerts to open, and the numbers of open ones to close, each with the reason."""

    to_open: tuple[Alert, ...] = ()
    to_close: Mapping[int, str] = field(default_factory=dict)


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
        """When it ends, or ended."""
        return self.ends_at if self.ended_at is None else min(self.ended_at, self.ends_at)

    def is_over(self, at: datetime) -> bool:
        """Whether it is not in force and will not be: one may end before it begins."""
        return self.until <= max(at, self.starts_at)

    def is_in_force(self, at: datetime) -> bool:
        """Return True from its beginning to its end."""
        return self.starts_at <= at < self.until

    def covers(self, hanger: int, at: datetime) -> bool:
        """Whether it is in force for a hanger at a time; its end is not part of it."""
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
