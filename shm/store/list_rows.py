"""What the store hands out to be looked at by the thousand, without samples or contents, and of
recordings, those too that are or were held: frozen rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import Any

from shm.store.rows import Stage
from shm.values import NAN, Averaged, BaselineCheck, Doubt, Summary

ON_THE_WAY = (Stage.RECEIVED, Stage.IDENTIFIED, Stage.UPDATED, Stage.WATCHED)
"""Where recordings stand that are not through."""


class Outcome(StrEnum):
    """What came of receiving a file."""

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
    """What came of taking a file in."""

    outcome: Outcome
    recording: StoredRecording


@dataclass(frozen=True)
class Step:
    """A stage that a recording or, where one is named, a test of it has reached.

    `version` is that of the shm that brought it there; None where it was not noted.
    """

    stage: str
    at: datetime
    version: str | None
    test_id: int | None = None
    test: str | None = None


@dataclass(frozen=True)
class Rerun:
    """What was sent back to be done again, and what that has superseded.

    `of_baseline` are those of the tests from which the hanger's baseline was made: they are not
    watched, and the baseline stays as it was made until it is set anew.
    """

    recording: StoredRecording
    tests: tuple[str, ...]
    posteriors: int
    watches: int
    of_baseline: tuple[str, ...]


@dataclass(frozen=True)
class Event:
    """Something noticed on the way: a duplicate, a file reopened or refused."""

    at: datetime
    kind: str
    file_name: str
    message: str
    recording_id: int | None = field(default=None)


@dataclass(frozen=True)
class Standing:
    """A recording that is not through: how far it has come, and since when it is there."""

    id: int
    file_name: str
    stage: Stage
    hanger: int | None
    since: datetime


@dataclass(frozen=True)
class Deaths:
    """Count the processes that died at a recording since it last moved on, the last `last_at`."""

    count: int
    last_at: datetime


class Decision(StrEnum):
    """What a person made of a held recording; `REPLACED`: it was done again before one had.

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
        """Whether nothing but the time of its tests is in doubt: what they measured is not."""
        return bool(self.doubts) and all(each.check.startswith("clock") for each in self.doubts)

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Of all its tests, each check once."""
        return tuple({d.check: d for test in self.tests for d in test.doubts}.values())

    @property
    def time_unknown(self) -> bool:
        """Whether the time that its test claims is certainly wrong."""
        return any(doubt.time_unknown for doubt in self.doubts)

    @property
    def is_in(self) -> bool:
        """Whether a person said that it counts."""
        return self.decision in (Decision.CONFIRMED, Decision.REINSTATED)

    @property
    def is_out(self) -> bool:
        """Whether a person said that it does not."""
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
    """What happened to a hanger beside its tests."""

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
