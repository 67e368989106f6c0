"""What a report of a bridge is made from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime

from shm.report.content import Status, of_nominal
from shm.report.intervals import Interval
from shm.report.period import Period
from shm.values import Averaged, Drift, Hanger
from shm.values.force_units import ForceUnit, force_unit
from shm.watch.neighbours import BridgePattern


@dataclass(frozen=True)
class Course:
    """What became of a hanger in the period of the report.

    `change` is that of the tension from the first test of the period to the last, as a fraction;
    None where it has fewer than two.
    """

    tests: int = 0
    alerts: int = 0
    change: Interval | None = None


@dataclass(frozen=True)
class HangerLine:
    """A hanger as the report of its bridge shows it.

    `tension_n` is that of its latest test, None before the first, `averaged` all that is said of
    it; `drift` that of its tension since its baseline, None where nothing was compared; `called`
    says in a few words what was called since; `open_alerts` counts those that nobody took note of.
    `course` is None without a period.
    """

    hanger: Hanger
    status: Status | None
    latest: datetime | None = None
    tension_n: Interval | None = None
    called: str = ""
    open_alerts: int = 0
    drift: Drift | None = None
    test: str = ""
    model: str = ""
    course: Course | None = None
    baseline_tension_n: Interval | None = None
    averaged: Averaged | None = None

    @property
    def of_nominal(self) -> Interval | None:
        """The tension in percent of the nominal one."""
        return of_nominal(self.tension_n, self.hanger) if self.tension_n else None

    @property
    def is_hardly_known(self) -> bool:
        """Whether the interval of the tension is so wide that a shift could hardly be seen."""
        return self.tension_n is not None and self.tension_n.is_wide


def hangers_unit(lines: Iterable[HangerLine]) -> ForceUnit:
    """The one unit of all their tensions, so that they compare at a glance."""
    return force_unit(*(line.tension_n.mean for line in lines if line.tension_n))


@dataclass(frozen=True)
class BridgeReport:
    """All that a report of a bridge says; `why_no_pattern` stands where there is no pattern."""

    bridge: str
    hangers: tuple[HangerLine, ...]
    pattern: BridgePattern | None
    why_no_pattern: str
    generated_at: datetime
    version: str
    period: Period | None = None
    lineage: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)

    @property
    def worst(self) -> Status | None:
        """The status of the hanger that is worst off; None before the first test."""
        found = {line.status for line in self.hangers}
        return next((status for status in Status if status in found), None)
