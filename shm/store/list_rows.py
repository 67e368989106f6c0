"""What the store hands out to be looked at by the thousand: rows without samples or contents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from shm.store.rows import Acknowledgement, DeliveryState, News, Resolution, Stage
from shm.values import Averaged, BaselineCheck, Summary


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
class WaitingTest:
    """A test on its way, without its contents."""

    id: int
    recording_id: int
    hanger: int
    stage: Stage
    name: str


@dataclass(frozen=True)
class WatchedName:
    """A watched test, without its contents."""

    id: int
    name: str
    time: datetime


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


@dataclass(frozen=True)
class DeliveryRow:
    """One alert on its way to one hook: how that went."""

    hook: str
    state: DeliveryState
    attempts: int
    last_error: str
    news: News = News.RAISED


@dataclass(frozen=True)
class AlertRow:
    """An alert without its shifts; `StoredAlert.is_open` says which are open."""

    id: int
    hanger: int
    raised_at: datetime
    test: str
    test_time: datetime
    kinds: tuple[str, ...]
    message: str
    acknowledgement: Acknowledgement | None
    deliveries: tuple[DeliveryRow, ...]
    resolution: Resolution | None = None


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
