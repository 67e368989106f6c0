"""The whole bridge at a glance: what is shown of each hanger, and what moved over all of them.

All hangers in a handful of queries, and no samples: a page of 200 hangers must not wait.

A bridge in a line: what its home page says first, as every list of bridges shows it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timedelta
from functools import cached_property
from typing import Literal
from urllib.parse import quote

from fastapi import Request

import shm
from shm.errors import NothingThere, ShmError
from shm.pipeline.bridge_reporting import hanger_lines, hanger_shifts
from shm.report.contents import HangerLine
from shm.report.formatting import Interval, counted, listed
from shm.report.hanger_status import QUIET, BridgeMessage, Status, bridge_message
from shm.values import NAN, Hanger
from shm.values.messages import URGENCIES, Lead, Urgency
from shm.watch.neighbours import BridgePattern, HangerShift, bridge_pattern
from shm_daemon.web.background_work import background_worker_of
from shm_daemon.web.health import notices, troubles
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
    def size_bytes(self) -> int:
        return 2000 * len(self.pattern.rows) if self.pattern else 100

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


NOT_REACHED, STANDS_STILL = "Not reached", "Stands still"


@dataclass(frozen=True)
class Summary:
    """What a bridge says of itself.

    `notices` are what every page of its dashboard says at its top, `troubles` why its work stands
    still; `others` says which other hangers need action.
    """

    bridge: str
    version: str
    status: Literal["alert", "watch", "check", "unclear", "steady", "first"] | None
    state: str
    action: str
    urgency: Urgency
    notes: tuple[str, ...]
    others: str
    notices: tuple[Lead, ...]
    troubles: tuple[str, ...]
    hangers: int
    latest_test_at: datetime | None
    open_alerts: int
    held: int

    @property
    def words(self) -> str:
        said = f"{self.state} {self.action}", *self.notes, self.others
        return " ".join(part for part in said if part)


def summary_of(site: Site, now: datetime) -> Summary:
    """What the site's own home page says first. Raises StoreError where the store is out."""
    workspace, store = site.workspace, site.store
    lines = hanger_lines(workspace, store, now)
    message = bridge_message({each.hanger.id: each.message for each in lines})
    return Summary(
        bridge=workspace.bridge.name,
        version=shm.__version__,
        **{**message.document, "notes": message.notes},  # type: ignore[arg-type]
        others=message.others,
        notices=tuple(notices(site)),
        troubles=tuple(troubles(site)),
        hangers=len(lines),
        latest_test_at=max((each.latest for each in lines if each.latest), default=None),
        open_alerts=store.alerts.counts()[0],
        held=len(store.recordings.list_holds()),
    )


@dataclass(frozen=True)
class BridgeRow:
    """A bridge of the list, and where its dashboard is.

    `trouble` is why it cannot be asked now, None where it was asked just now; `summary` is what it
    said when it could be last, at `told_at`; both are None where it never could.
    """

    name: str
    address: str
    summary: Summary | None
    told_at: datetime | None
    trouble: Lead | None = None

    @property
    def anchor(self) -> str:
        """Of its part of the page."""
        return f"bridge-{quote(self.name, safe='')}"

    @property
    def leads(self) -> tuple[Lead, ...]:
        """What is said before its own words: that it is not reached, or what limits its work."""
        if self.trouble or self.summary is None:
            return (self.trouble,) if self.trouble else ()
        said = self.summary.notices
        more = set(self.summary.troubles) - {each.state for each in said}
        look = "See its page Operation today."
        return (*(Lead(each, look) for each in sorted(more)), *said)

    @property
    def states(self) -> tuple[tuple[str, str], ...]:
        """How it is in a word or two, each with its style; empty before its first test.

        What is not watched is never quiet, whatever its last tests said.
        """
        status = (
            Status[self.summary.status.upper()] if self.summary and self.summary.status else None
        )
        own = ((status.value, status.name.lower()),) if status else ()
        if self.is_watched:
            return own
        lost = (NOT_REACHED if self.trouble else STANDS_STILL, "alert")
        return (lost, *(own if status not in QUIET and not self.trouble else ()))

    @property
    def is_watched(self) -> bool:
        """Whether its words are of now, and work goes on: else nothing of it is quiet."""
        return not self.trouble and self.summary is not None and not self.summary.troubles

    @property
    def urgency(self) -> Urgency:
        """Of the whole row: a bridge that nobody watches wants somebody today."""
        return "today" if not self.is_watched or self.summary is None else self.summary.urgency


def own_row(site: Site, now: datetime) -> tuple[BridgeRow, ...]:
    """The site's own bridge; empty where nothing of it is described, so that it only lists others.

    A store that is out is told like a bridge that is not reached.
    """
    bridge = site.workspace.bridge
    if not bridge.watched and bridge.other_bridges:
        return ()
    try:
        return (BridgeRow(bridge.name, "/", summary_of(site, now), now),)
    except ShmError as error:
        said = Lead(f"{bridge.name} cannot be read: {error.message}", error.remedy)
        return (BridgeRow(bridge.name, "/", None, None, said),)


def row_document(row: BridgeRow) -> dict[str, object]:
    """As `shm bridges --json` and `/api/bridges` give it."""
    return {
        "name": row.name,
        "address": row.address,
        "states": [word for word, _ in row.states],
        "urgency": row.urgency,
        "trouble": row.trouble and asdict(row.trouble),
        "told_at": row.told_at,
        "summary": row.summary and asdict(row.summary),
    }


_ORDER = [status.name.lower() for status in Status]


def worst_first(rows: Sequence[BridgeRow]) -> tuple[BridgeRow, ...]:
    """By urgency, then state, then whether they are watched; else in their order."""

    def rank(row: BridgeRow) -> tuple[int, int, bool]:
        status = row.summary and row.summary.status
        place = _ORDER.index(status) if status else len(_ORDER)
        return -URGENCIES.index(row.urgency), place, row.is_watched

    return tuple(sorted(rows, key=rank))


_GROUPS = {
    "today": "Action today",
    "week": "Action within a week",
    "next_test": "Action at the next planned test",
    "none": "No action before the next planned test",
}


def groups(rows: Sequence[BridgeRow]) -> dict[str, tuple[BridgeRow, ...]]:
    """Which bridges need what, the most urgent first; one that stands still may need more."""
    found: dict[str, list[BridgeRow]] = {
        said: [] for said in (_GROUPS["today"], NOT_REACHED, STANDS_STILL, *_GROUPS.values())
    }
    for row in worst_first(rows):
        if not row.is_watched:
            found[row.states[0][0]].append(row)
        if row.summary and not row.trouble and (row.is_watched or row.summary.urgency != "none"):
            found[_GROUPS[row.summary.urgency]].append(row)
    return {said: tuple(of) for said, of in found.items() if of}


def headline(rows: Sequence[BridgeRow]) -> str:
    """How many bridges there are, and which need what."""
    said = (f"{key}: {listed([each.name for each in of])}." for key, of in groups(rows).items())
    return " ".join((f"{counted(len(rows), 'bridge')}.", *said))
