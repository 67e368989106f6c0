"""Summarize all hangers of a bridge, and lay out its elevation, coloured by their states.

All hangers in a handful of queries, and no samples: a page of 200 hangers must not wait. Lengths of
the elevation are in drawing units; upwards is less y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cached_property

from fastapi import Request

from shm.errors import NothingThere
from shm.pipeline.bridge_reporting import hanger_shifts, hanger_summaries
from shm.report import formatting
from shm.report.hanger_status import BridgeMessage, Status, bridge_message
from shm.report.hanger_summary import HangerSummary
from shm.values import Hanger
from shm.values.rounding import ForceUnit, rounded_percent
from shm.watch.neighbours import BridgePattern, HangerShift
from shm.watch.words.neighbours_words import bridge_pattern
from shm_daemon.web.background_work import background_worker_of
from shm_daemon.web.site import Site

_UNTESTED = "untested"
QUICKLY_COMPARED = 24
"""So many hangers are compared while a page waits."""


@dataclass(frozen=True)
class HangerGlance:
    """One hanger as its bridge's report has it; `is_quiet`: it was not tested for long."""

    summary: HangerSummary
    is_quiet: bool = False

    @property
    def hanger(self) -> Hanger:
        return self.summary.hanger

    @property
    def tests(self) -> int:
        return self.summary.tests

    def cells(self, unit: ForceUnit) -> tuple[str, str, str]:
        """Return tension, percent of nominal and shift in percent for a table; empty if unknown."""
        summary, shift = self.summary, self.summary.change
        tension = _untested(summary)
        is_known = summary.is_determined
        if summary.tension_n:
            known = formatting.with_half(summary.tension_n, unit).removesuffix(f" {unit.name}")
            tension = known if is_known else "not determined"
        nominal = summary.of_nominal_words.removesuffix(" %")
        percent = rounded_percent(shift.mean, shift.width / 2, "+") if shift else ""
        return tension, nominal, percent.removesuffix(" %")


@dataclass(frozen=True)
class BridgeGlance:
    """All hangers in the order of the description."""

    name: str
    hangers: tuple[HangerGlance, ...]

    @cached_property
    def message(self) -> BridgeMessage:
        """Return the lead of the page."""
        return bridge_message({each.hanger.id: each.summary.message for each in self.hangers})

    @property
    def latest(self) -> HangerSummary | None:
        """Return the hanger that was tested last."""
        times = [(e.summary.latest.time, e.summary) for e in self.hangers if e.summary.latest]
        return max(times, key=lambda pair: pair[0])[1] if times else None


@dataclass(frozen=True)
class Compared:
    """Changes over the bridge; `pattern` is None if too few hangers can be compared."""

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


def summarize_hangers(site: Site, now: datetime) -> BridgeGlance:
    """Return the bridge as the store has it now."""
    workspace, store = site.workspace, site.store
    quiet_before = now - timedelta(days=workspace.settings.quiet_days)
    hangers = tuple(
        HangerGlance(
            summary,
            summary.latest is not None and summary.latest.time < quiet_before,
        )
        for summary in hanger_summaries(workspace, store, now)
    )
    return BridgeGlance(workspace.bridge.name, hangers)


def compared(request: Request, site: Site) -> Compared | None:
    """Return the changes over the bridge; None while they are computed."""
    order = tuple(hanger.id for hanger in site.workspace.bridge.hangers)
    wanted = Comparison(hanger_shifts(site.store, order), order)
    if len(order) <= QUICKLY_COMPARED:
        return wanted.make()
    found: Compared | None = background_worker_of(request).get_or_start(wanted)
    return found


# Judgement: drawing units, of which a laptop's page has about 1100. Hangers are so far apart that
# their numbers (every second, fifth ... where 30 units are too few) can be read.
_MOST_STEP, _LEAST_STEP, _WIDEST = 34.0, 9.0, 1100.0
_TALLEST, _TOP, _BELOW, _SIDE = 220.0, 48.0, 60.0, 36.0
_BETWEEN_NUMBERS = 30.0


@dataclass(frozen=True)
class HangerMark:
    """A hanger as it is drawn, and what is said of it; an `arrow` where a change was found."""

    id: int
    x: float
    top: float
    style: str
    words: str
    arrow: str
    number: bool
    open_alerts: int
    is_quiet: bool


@dataclass(frozen=True)
class Elevation:
    """The drawing; `deck` is the deck's height, `step` a hanger's room, `bar` its width."""

    width: float
    height: float
    deck: float
    step: float
    bar: float
    hangers: tuple[HangerMark, ...]


def elevation(hangers: Sequence[HangerGlance]) -> Elevation:
    """Return the hangers evenly spaced in their order, as long as they are.

    Where they are along the bridge is not described, so no arch is drawn.
    """
    step = min(_MOST_STEP, max(_LEAST_STEP, (_WIDEST - 2 * _SIDE) / (len(hangers) + 1)))
    longest = max(each.hanger.length_m for each in hangers)
    deck = _TOP + _TALLEST
    tops = [deck - _TALLEST * each.hanger.length_m / longest for each in hangers]
    places = [_SIDE + step * (index + 1) for index in range(len(hangers))]
    numbered = _numbered(hangers, places)
    marks = tuple(
        _mark(each, x, top, index in numbered)
        for index, (each, x, top) in enumerate(zip(hangers, places, tops, strict=True))
    )
    width = 2 * _SIDE + step * (len(hangers) + 1)
    return Elevation(width, deck + _BELOW, deck, step, round(step / 4, 1), marks)


def _untested(summary: HangerSummary) -> str:
    return "no result yet" if summary.tests else "no test yet"


def legend(hangers: Sequence[HangerGlance]) -> list[tuple[str, str]]:
    """Return style and word of each state that a hanger has, the worst first."""
    found = {each.summary.status for each in hangers}
    untested = [(_UNTESTED, "no result yet")] if None in found else []
    return [(each.name.lower(), each.value) for each in Status if each in found] + untested


def shift_words(glance: HangerGlance) -> str:
    """Return the shift from the baseline as people say it."""
    summary = glance.summary
    if summary.is_baseline and summary.baseline:
        return "is the baseline"
    if (shift := summary.change) is None:
        return "no baseline yet" if summary.latest else _untested(summary)
    return f"{rounded_percent(shift.mean, shift.width / 2, '+')} since the baseline"


def _mark(glance: HangerGlance, x: float, top: float, number: bool) -> HangerMark:
    summary, change = glance.summary, glance.summary.change
    words = [
        formatting.hanger_name(glance.hanger.id, glance.hanger.name),
        summary.status.value if summary.status else "",
        shift_words(glance),
        f"last test {summary.latest.time:%Y-%m-%d}" if summary.latest else "",
        formatting.counted(summary.open_alerts, "open alert") if summary.open_alerts else "",
    ]
    arrow = "" if change is None or not summary.is_found else "▼" if change.mean < 0 else "▲"
    return HangerMark(
        id=glance.hanger.id,
        x=round(x, 1),
        top=round(top, 1),
        style=summary.status.name.lower() if summary.status else _UNTESTED,
        words=", ".join(filter(None, words)),
        arrow=arrow,
        number=number,
        open_alerts=summary.open_alerts,
        is_quiet=glance.is_quiet,
    )


def _numbered(hangers: Sequence[HangerGlance], places: Sequence[float]) -> set[int]:
    """Return the hangers with room for their number: those that need action first."""
    order = list(Status)

    def urgency(index: int) -> tuple[bool, int]:
        summary = hangers[index].summary
        place = order.index(summary.status) if summary.status else len(order)
        return summary.open_alerts == 0, place

    chosen: set[int] = set()
    for index in sorted(range(len(hangers)), key=urgency):
        if all(abs(places[index] - places[each]) >= _BETWEEN_NUMBERS for each in chosen):
            chosen.add(index)
    return chosen
