"""The documents about one hanger. Unknown numbers are null."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import BaseModel, Field

from shm_daemon.web.models import AveragedTension


class Numbers(BaseModel):
    """Posterior samples in numbers; `q05` and `q95` bound 90 % of them."""

    mean: float
    sd: float
    q05: float
    q50: float
    q95: float


class TrendPoint(BaseModel):
    """One test; stiffness is log10 of N m/rad, by `transverse_end_stiffness` and the like."""

    test: str
    time: datetime
    temperature_c: float | None
    model: str
    tension_n: Numbers = Field(description="By the class in force alone.")
    averaged: AveragedTension = Field(description="What figures and tables show.")
    stiffness: dict[str, Numbers]


class TrendEvent(BaseModel):
    """What happened to the hanger beside its tests."""

    at: datetime
    kind: str = Field(description="baseline, adopted, adoption undone, alert, acknowledged")
    who: str
    why: str


class CalledChange(BaseModel):
    """A change that was called, and when it began with 90 % probability."""

    called_by: str = Field(description="The test after which it was called.")
    began_after: datetime
    began_by: datetime
    words: str


class StateOverTime(BaseModel):
    """What all tests up to each say of one quantity: tension in N, stiffness log10 of its unit.

    It holds at the reference temperature: the swing with the temperature is taken out.
    """

    quantity: str
    reference_temperature_c: float | None
    times: list[datetime]
    q05: list[float | None]
    q50: list[float | None]
    q95: list[float | None]


class HangerTrend(BaseModel):
    """A hanger over time; `states` are null while they are worked out: ask again."""

    hanger: int
    points: list[TrendPoint]
    events: list[TrendEvent]
    changes: list[CalledChange]
    states: list[StateOverTime] | None


class TestState(BaseModel):
    """One test; what updating finds is null before it has been through it."""

    __test__ = False  # no test, though named so

    id: int
    test: str
    time: datetime
    stage: str
    temperature_c: float | None
    model: str | None
    tension_n: Numbers | None = Field(description="By the class in force alone.")
    averaged: AveragedTension | None = Field(description="What tables show.")
    page: str = Field(description="The address of its page.")


class HangerTests(BaseModel):
    """Tests of a hanger, the newest first."""

    hanger: int
    tests: list[TestState]
    next_before: int | None = Field(description="To go on with; null at the oldest test.")


class FigureDocument(BaseModel):
    """A figure as plotly draws it, with its words."""

    data: list[dict[str, Any]]
    layout: dict[str, Any]
    caption: str
    alt: str = Field(description="What a blind reader needs.")
