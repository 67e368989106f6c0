"""The documents that the interface answers with. Unknown numbers are null."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from enum import Enum
from typing import Annotated, Any, Literal, Protocol, TypeVar

import numpy as np
from fastapi import Path, Query
from pydantic import AfterValidator, BaseModel, Field


def _written(text: str) -> str:
    """Return text that a person may have written and any database keeps."""
    if not text.strip() or not all(sign.isprintable() or sign in "\n\t" for sign in text):
        raise ValueError("a text without control characters is expected")
    return text.strip()


MOST_WRITTEN = 2000
"""Technical: characters of a reason or of a list, more than anybody reads."""
MOST_ROWS = 1000
"""Technical: of one answer, which `limit` may ask for; some hundred kilobytes."""
LARGEST_NUMBER = 2**31 - 1
"""Of the store's integers: PostgreSQL refuses larger ones."""

Row = Annotated[int, Path(ge=0, le=LARGEST_NUMBER)]
"""The number of a row of the store, in an address."""
Before = Annotated[int | None, Query(ge=0, le=LARGEST_NUMBER)]
"""The number of the row to go on after."""
HangerNumber = Annotated[
    int, Path(ge=0, le=LARGEST_NUMBER, description="The number of the hanger.")
]
Written = Annotated[str, Field(max_length=MOST_WRITTEN), AfterValidator(_written)]


class Numbered(Protocol):
    """A row by whose number one can go on."""

    @property
    def id(self) -> int: ...


Listed = TypeVar("Listed", bound=Numbered)


def paged(rows: Sequence[Listed], most: int) -> tuple[Sequence[Listed], int | None]:
    """Return the first `most` of `most` + 1 rows, and `before` of the next page."""
    return rows[:most], rows[most - 1].id if len(rows) > most else None


class Uploaded(BaseModel):
    """An upload that is safe: the daemon takes it from the spool."""

    sha256: str
    size_bytes: int
    file_name: str = Field(description="The name in the spool; changed if it was taken.")
    outcome: Literal["new", "duplicate", "reopened", "discarded before"] = Field(
        description="`duplicate`: these bytes are stored already. `reopened`: they were refused "
        "before and are tried again. `discarded before`: a person has discarded them; they stay so."
    )
    status_url: str = Field(description="Progress, once the daemon has taken it.")


class TestLink(BaseModel):
    """A test by its name, and where its page is."""

    name: str
    page: str


class RecordingStatus(BaseModel):
    """A recording and how far it has come."""

    id: int
    sha256: str
    file_name: str
    size_bytes: int
    received_at: datetime
    stage: Literal["received", "identified", "updated", "watched", "done", "refused", "held"]
    hanger: int | None
    tests: list[TestLink] = Field(description="Results so far.")
    reason: dict[str, Any] | None = Field(
        description="Why it was refused or is held; null if neither."
    )


class Recordings(BaseModel):
    """Recordings that were asked for."""

    recordings: list[RecordingStatus]


class Posterior(BaseModel):
    """A posterior in numbers; `q05` and `q95` bound 90 % of it."""

    mean: float
    sd: float
    q05: float
    q50: float
    q95: float


class Quantity(Posterior):
    """A posterior in numbers, and where it is most probable."""

    map: float


class Shift(BaseModel):
    """Shift of a quantity from its baseline: a fraction of the tension, decades of a spring."""

    quantity: str
    shift_mean: float | None
    shift_sd: float | None
    threshold: float | None
    probability: float | None = Field(description="Probability of a shift beyond the threshold.")


class AveragedTension(BaseModel):
    """The tension over all model classes, each with its probability; its interval is absolute."""

    tension_n: Posterior
    repeatability_sd_n: float | None = Field(
        description="Standard deviation for comparing two tests."
    )
    probability_above_limit: float | None = Field(description="Null where no limit is set.")
    probability_slack: float | None = Field(description="Null where no limit is set.")
    caveats: list[str] = Field(description="What limits its use.")


class Creep(BaseModel):
    """Creep rate of the tension: a fraction a year, below 0 if it relaxes."""

    mean: float
    sd: float


class Message(BaseModel):
    """The lead, the same on every surface; `status` is null if nothing is known."""

    status: Literal["alert", "watch", "check", "unclear", "steady", "first"] | None
    state: str = Field(description="The state, with its interval.")
    action: str = Field(description="What to do, and how soon.")
    urgency: Literal["none", "next_test", "week", "today"]
    notes: list[str] = Field(description="Actions of people.")


class HangerState(Message):
    """State of a hanger after its latest test; null or empty before the first."""

    hanger: int
    tests: int
    latest_test_at: datetime | None
    model: str | None
    nominal_tension_n: float
    tension_n: Quantity | None = Field(description="By the latest test and class in force alone.")
    averaged: AveragedTension | None = Field(description="Best estimate since the last change.")
    basis: str = Field(description="What that estimate rests on.")
    change: Bounded | None = Field(description="Of the tension since the baseline, a fraction.")
    by_latest_test: AveragedTension | None = Field(description="By the latest test alone.")
    baseline_set_at: datetime | None
    shifts: list[Shift]
    creep_per_year: Creep | None = Field(description="Null if the tests do not show it.")
    open_alerts: int


class Hangers(BaseModel):
    """All hangers of the bridge."""

    hangers: list[HangerState]


class DeliveryState(BaseModel):
    """One alert on its way to one hook."""

    hook: str
    state: str
    attempts: int
    last_error: str = Field(description="Why the latest attempt failed; empty if none did.")
    news: Literal["raised", "resolved"]
    escalation: bool = Field(description="Only for alerts that nobody acknowledged in time.")
    waits_until: datetime | None = Field(description="The end of its hook's quiet hours.")


class Acknowledged(BaseModel):
    """Acknowledgement of an alert: person, time and comment."""

    who: str
    why: str
    at: datetime


class AlertState(BaseModel):
    """An alert; it is open while `acknowledged` and `resolved` are null."""

    id: int
    hanger: int
    raised_at: datetime
    test: str
    test_at: datetime
    kinds: list[str] = Field(description="The rules that raised it.")
    message: str
    state: str = Field(description="The first sentence of the message.")
    action: str = Field(description="What the alert asks to do, and how soon.")
    urgency: Literal["none", "next_test", "week", "today"]
    acknowledged: Acknowledged | None
    resolved: Acknowledged | None = Field(
        description="How its condition ended; null while it holds."
    )
    silenced_until: datetime | None = Field(
        description="Hooks are notified about this hanger again from then on; null if they are now."
    )
    deliveries: list[DeliveryState]


class Alerts(BaseModel):
    """Alerts as they were raised."""

    alerts: list[AlertState]
    next_before: int | None = Field(
        default=None,
        description="Ask for older ones with `before` of this; null where there are none, and "
        "without `limit`.",
    )


class Acknowledge(BaseModel):
    """Comment of a person on an alert."""

    why: Written = Field(description="The result, for the record.")
    who: Written | None = Field(
        default=None,
        description="The person behind a token, recorded with it; a user has a name.",
    )
    resolved: bool = Field(
        default=False, description="Its cause is gone or explained; the hooks are notified."
    )


class Status(BaseModel):
    """Contents of the workspace, and files that wait."""

    bridge: str
    recordings: dict[str, int] = Field(description="How many are at each stage.")
    spool: int
    quarantine: int
    open_alerts: int
    waiting_deliveries: int
    daemon_seen_seconds_ago: float | None


class Health(BaseModel):
    """Health; `reasons` states the problems. Degraded parts work, but not as described."""

    status: Literal["ok", "degraded", "failing"]
    reasons: list[str]
    attention: list[str] = Field(
        default=[], description="What a person should look at though nothing fails."
    )


class HeldRecording(BaseModel):
    """A recording that counts in nothing until a person decides, and why."""

    recording: int
    file: str
    hanger: int
    held_at: datetime
    message: str


class RefusedFile(BaseModel):
    """A file in the quarantine, and why it is there."""

    file: str
    message: str
    remedy: str
    at: datetime | None


class Operation(BaseModel):
    """Operation; `troubles` is empty if the work goes on."""

    troubles: list[str]
    daemon: str | None = Field(description="The active daemon; null if there is none.")
    daemon_seen_seconds_ago: float | None
    recordings: dict[str, int] = Field(description="How many are at each stage.")
    spool: int
    oldest_waiting_at: datetime | None
    deliveries: dict[str, int]
    held: list[HeldRecording]
    quarantine: list[RefusedFile] = Field(description="The newest first, at most 100.")
    quarantined: int
    disk_free_bytes: int
    disk_bytes: int
    version: str
    python: str


class Finding(BaseModel):
    """Result of one check of `shm doctor`."""

    check: str
    level: Literal["ok", "unknown", "warning", "fault"]
    found: str
    remedy: str


class Examination(BaseModel):
    """All checks of `shm doctor`."""

    findings: list[Finding]


class FigureDocument(BaseModel):
    """A figure as plotly draws it, with its words."""

    data: list[dict[str, Any]]
    layout: dict[str, Any]
    caption: str
    alt: str = Field(description="Description for screen readers.")


class Underway(BaseModel):
    """It is being worked out: ask again after `Retry-After` seconds."""

    message: str


class Bounded(BaseModel):
    """A mean; `low` and `high` bound 90 %."""

    mean: float
    low: float
    high: float


class HangerAtAGlance(Message):
    """One hanger as the page of the bridge shows it; null before its first test."""

    hanger: int
    name: str
    length_m: float
    nominal_tension_n: float
    tests: int
    latest_test: str | None
    latest_test_at: datetime | None
    model: str | None
    tension_n: Bounded | None
    shift: Bounded | None = Field(
        description="Of the tension since the baseline, a fraction; null where there is no "
        "baseline, or the latest test is of it."
    )
    called: str = Field(description="Changes called since the baseline; empty where none was.")
    open_alerts: int
    warnings: list[str] = Field(description="Faults of the baseline.")


class BridgeState(Message):
    """The whole bridge: its message is that of its most urgent hanger."""

    bridge: str
    hangers: list[HangerAtAGlance]


class Moved(BaseModel):
    """Changes over the bridge in words, and possible explanations."""

    sentence: str
    explanations: dict[str, float] = Field(description="The probability of each explanation.")


def plain(value: Any) -> Any:
    """Convert to JSON values: arrays to lists, times to ISO 8601, NaN and infinity to null."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            return np.where(np.isfinite(value), value, None).tolist()  # type: ignore[call-overload]
        if value.dtype.kind == "M":
            return value.astype(str).tolist()
        return plain(value.tolist()) if value.dtype.kind == "O" else value.tolist()
    if isinstance(value, str | bool) or value is None:
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return _single(value)


def _single(value: Any) -> Any:
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, np.datetime64):
        return str(value)
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
