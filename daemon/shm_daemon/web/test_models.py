"""The documents of one test. Unknown numbers are null."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel, Field


class Waiting(BaseModel):
    """What was asked for is being worked out: ask again after `Retry-After` seconds."""

    message: str


class Check(BaseModel):
    """One figure of the test's quality beside its limit."""

    name: str
    verdict: Literal["good", "warning", "refused", "unknown"]
    value: float | None
    limit: float | None
    unit: str
    found: str
    remedy: str


class RawFile(BaseModel):
    """What the test came as."""

    file_name: str
    sha256: str
    size_bytes: int
    received_at: datetime
    archived: bool = Field(description="Whether the raw file is still in the archive.")


class LineageState(BaseModel):
    """What a result comes from."""

    input_sha256: str
    settings_sha256: str
    version: str


class StepState(BaseModel):
    """A stage that the file, or the test, has reached."""

    stage: str
    at: datetime
    version: str | None


class Former(BaseModel):
    """A result that a later run has replaced."""

    what: Literal["identification", "posterior"]
    model: str | None
    made_at: datetime
    superseded_at: datetime
    lineage: LineageState


class TestState(BaseModel):
    """One test as it is stored."""

    test: dict[str, Any] = Field(description="An entry of a modal-tests document (shm.modes/1).")
    hanger: int
    time: datetime = Field(description="The test's own or, where it has none, that of receipt.")
    stage: str
    verdict: Literal["good", "warning", "refused", "unknown"]
    summary: str
    quality: list[Check]
    set_aside: list[dict[str, Any]]
    notes: list[str]
    responses: list[str] = Field(description="The points of the stored frequency response.")
    file: RawFile
    lineage: LineageState
    steps: list[StepState]
    superseded: list[Former]
    previous: str | None = Field(description="The name of the hanger's test before this one.")
    next: str | None
    missing: str = Field(
        description="Why there is no more than the store holds; empty where the raw file can be "
        "identified once more."
    )
    figures: list[str] = Field(description="Names for `/figures/{name}`.")


class HitState(BaseModel):
    """One hit of the hammer; `record` counts from 0."""

    record: int
    start_s: float
    peak_force_n: float
    used: bool
    reason: str = Field(description="Why it was dropped; empty where it was used.")


class DroppedState(BaseModel):
    """What else was left out, and why."""

    what: str
    count: int
    reason: str


class Hits(BaseModel):
    """The hits of a test and all that was left out."""

    hits: list[HitState]
    dropped: list[DroppedState]


class PlotlyFigure(BaseModel):
    """A figure for plotly, with its words."""

    data: list[dict[str, Any]]
    layout: dict[str, Any]
    caption: str
    alt: str
