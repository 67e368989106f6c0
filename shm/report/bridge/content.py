"""What a report of a bridge is made from."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from shm.report.content import Interval
from shm.report.summary import Status
from shm.values import Hanger
from shm.watch.neighbours import BridgePattern


@dataclass(frozen=True)
class HangerLine:
    """A hanger as the report of its bridge shows it.

    `tension_n` is that of its latest test, None before the first; `called` says in a few words
    what was called since its baseline; `open_alerts` counts those that nobody took note of.
    """

    hanger: Hanger
    status: Status | None
    latest: datetime | None = None
    tension_n: Interval | None = None
    called: str = ""
    open_alerts: int = 0


@dataclass(frozen=True)
class BridgeReport:
    """All that a report of a bridge says; `why_no_pattern` stands where there is no pattern."""

    bridge: str
    hangers: tuple[HangerLine, ...]
    pattern: BridgePattern | None
    why_no_pattern: str
    generated_at: datetime
    version: str

    @property
    def worst(self) -> Status | None:
        """The status of the hanger that is worst off; None before the first test."""
        found = {line.status for line in self.hangers}
        return next((status for status in Status if status in found), None)
