"""The whole bridge at a glance: what is shown of each hanger, and what moved over all of them.

All hangers in a handful of queries, and no samples: a page of 200 hangers must not wait.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cached_property

from fastapi import Request

from shm.errors import NothingThere
from shm.pipeline.bridge_reporting import hanger_lines, hanger_shifts
from shm.report.contents import HangerLine
from shm.report.formatting import Interval
from shm.report.hanger_status import BridgeMessage, Status, bridge_message
from shm.values import NAN, Hanger
from shm.watch.neighbours import BridgePattern, HangerShift, bridge_pattern
from shm_daemon.web.background_work import background_worker_of
from shm_daemon.web.site import Site

QUICKLY_COMPARED = 24
"""So many hangers are compared while a page waits."""


@dataclass(frozen=True)
class HangerGlance:
    """One hanger as its bridge's report has it; `is_quiet`: it was not tested for long."""

    line: HangerLine
    tests: int = 0
    is_quiet: bool = False

    @property
    def hanger(self) -> Hanger:
        return self.line.hanger

    @property
    def is_baseline(self) -> bool:
        """Whether the latest test is of the baseline itself."""
        return self.line.drift is None and self.line.status is Status.FIRST and self._has_baseline

    @property
    def shift(self) -> Interval | None:
        """Of the tension since the baseline, a fraction; None where there is none to tell.

        As the watch found it, the swing with the temperature taken out; else of two estimates.
        """
        line = self.line
        if line.drift is not None:
            return Interval.normal(line.drift.shift_mean, line.drift.shift_sd)
        if line.tension_n is None or line.baseline_tension_n is None or self.is_baseline:
            return None
        return line.tension_n.since(line.baseline_tension_n)

    @property
    def _has_baseline(self) -> bool:
        return self.line.baseline_tension_n is not None


@dataclass(frozen=True)
class BridgeGlance:
    """All hangers in the order of the description."""

    name: str
    hangers: tuple[HangerGlance, ...]

    @cached_property
    def message(self) -> BridgeMessage:
        """What the page says first."""
        return bridge_message({each.hanger.id: each.line.message for each in self.hangers})

    @property
    def worst(self) -> Status | None:
        """The status of the hanger that is worst off; None before the first test."""
        return self.message.status

    @property
    def latest(self) -> HangerLine | None:
        """The hanger that was tested last."""
        tested = [(each.line.latest, each.line) for each in self.hangers if each.line.latest]
        return max(tested, key=lambda pair: pair[0])[1] if tested else None


@dataclass(frozen=True)
class Compared:
    """What moved over the bridge; `pattern` is None where too few hangers can be compared."""

    pattern: BridgePattern | None
    why_not: str = ""

    @property
    def sentence(self) -> str:
        if self.pattern is None:
            return f"Over the bridge nothing can be compared: {self.why_not}"
        return " ".join((self.pattern.sentence, *self.pattern.remarks))


@dataclass(frozen=True)
class Comparison:
    """An order to compare the hangers: seconds where there are hundreds."""

    shifts: tuple[HangerShift, ...]
    order: tuple[int, ...]

    def make(self) -> Compared:
        try:
            return Compared(bridge_pattern(self.shifts, self.order))
        except NothingThere as reason:
            return Compared(None, reason.message)


def glance(site: Site, now: datetime) -> BridgeGlance:
    """The bridge as the store has it now."""
    workspace, store = site.workspace, site.store
    tests, quiet_before = store.tests.latest(), now - timedelta(days=workspace.settings.quiet_days)
    hangers = tuple(
        HangerGlance(
            line,
            tests[line.hanger.id].tests if line.hanger.id in tests else 0,
            line.latest is not None and line.latest < quiet_before,
        )
        for line in hanger_lines(workspace, store, now)
    )
    return BridgeGlance(workspace.bridge.name, hangers)


def compared(request: Request, site: Site) -> Compared | None:
    """What moved over the bridge; None while it is being worked out."""
    order = tuple(hanger.id for hanger in site.workspace.bridge.hangers)
    wanted = Comparison(tuple(map(_comparable, hanger_shifts(site.store, order))), order)
    if len(order) <= QUICKLY_COMPARED:
        return wanted.make()
    found: Compared | None = background_worker_of(request).wanted(wanted)
    return found


def _comparable(shift: HangerShift) -> HangerShift:
    """With the one NaN that equals itself where the change of temperature is not known."""
    known = math.isfinite(shift.temperature_change_k)
    return shift if known else replace(shift, temperature_change_k=NAN)
