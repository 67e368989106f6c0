"""The whole bridge at a glance: what is shown of each hanger, what moved over all of them, and its
elevation: where deck, arch and hangers are drawn, and what marks them.

All hangers in a handful of queries, and no samples: a page of 200 hangers must not wait.

A class of shift has a colour and, for whoever cannot tell colours, a number of triangles: down for
lost, up for gained. Lengths are in drawing units; upwards is less y.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cached_property
from itertools import pairwise

from fastapi import Request

from shm.errors import NothingThere
from shm.pipeline.bridge_reporting import hanger_lines, hanger_shifts
from shm.report import formatting
from shm.report.contents import HangerLine
from shm.report.formatting import Interval
from shm.report.hanger_status import BridgeMessage, Status, bridge_message
from shm.values import NAN, Hanger
from shm.values.rounding import ForceUnit, rounded_percent
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
        """Return True if the latest test belongs to the baseline."""
        line = self.line
        is_first = line.drift is None and line.status is Status.FIRST
        return is_first and line.baseline_tension_n is not None

    @property
    def shift(self) -> Interval | None:
        """Of the tension since the baseline, a fraction; None where there is none to tell.

        As the watch found it, the swing with the temperature taken out; else of two estimates.
        """
        line = self.line
        if (drift := line.drift) is not None:
            is_known = math.isfinite(drift.shift_mean + drift.shift_sd)
            return Interval.normal(drift.shift_mean, drift.shift_sd) if is_known else None
        if line.tension_n is None or line.baseline_tension_n is None or self.is_baseline:
            return None
        return line.tension_n.since(line.baseline_tension_n)

    def cells(self, unit: ForceUnit) -> tuple[str, str, str]:
        """As tables have it: tension, percent of nominal, shift in percent; empty where unknown."""
        line, shift, tension = self.line, self.shift, "no test yet"
        if line.tension_n:
            tension = formatting.with_half(line.tension_n, unit).removesuffix(f" {unit.name}")
        nominal = formatting.mean(line.of_nominal) if line.of_nominal else ""
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
        return bridge_message({each.hanger.id: each.line.message for each in self.hangers})

    @property
    def latest(self) -> HangerLine | None:
        """The hanger that was tested last."""
        tested = [(each.line.latest, each.line) for each in self.hangers if each.line.latest]
        return max(tested, key=lambda pair: pair[0])[1] if tested else None


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


def glance(site: Site, now: datetime) -> BridgeGlance:
    """Return the bridge as the store has it now."""
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
    """Return the changes over the bridge; None while they are computed."""
    order = tuple(hanger.id for hanger in site.workspace.bridge.hangers)
    # One NaN, which equals itself, where a change of temperature is not known.
    shifts = tuple(
        shift if math.isfinite(shift.temperature_change_k)
        else replace(shift, temperature_change_k=NAN)
        for shift in hanger_shifts(site.store, order)
    )  # fmt: skip
    wanted = Comparison(shifts, order)
    if len(order) <= QUICKLY_COMPARED:
        return wanted.make()
    found: Compared | None = background_worker_of(request).wanted(wanted)
    return found


CLASSES = (
    ("lost3", "lost more than 6 %"),
    ("lost2", "lost 3 to 6 %"),
    ("lost1", "lost 1 to 3 %"),
    ("same", "within 1 %"),
    ("gained1", "gained 1 to 3 %"),
    ("gained2", "gained 3 to 6 %"),
    ("gained3", "gained more than 6 %"),
    ("unknown", "not known: no test since a baseline"),
)
"""The classes of shift from the baseline, each with its words."""
# Judgement: 1 % is what one test tells by, and each class is about twice the one before.
_LIMITS = (0.01, 0.03, 0.06)

# Judgement: drawing units, of which a laptop's page has about 1100. Hangers are so far apart that
# their numbers (every second, fifth ... where 30 units are too few) can be read.
_MOST_STEP, _LEAST_STEP, _WIDEST = 34.0, 9.0, 1100.0
_TALLEST, _TOP, _BELOW, _SIDE = 220.0, 48.0, 60.0, 36.0
_BETWEEN_NUMBERS = 30.0
_TRIANGLE = 10.0


@dataclass(frozen=True)
class Triangle:
    """A mark over a hanger; hollow where the shift may as well be none."""

    points: str
    hollow: bool


@dataclass(frozen=True)
class HangerMark:
    """A hanger as it is drawn, and what is said of it."""

    id: int
    x: float
    top: float
    kind: str
    words: str
    triangles: tuple[Triangle, ...]
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
    arch: str
    hangers: tuple[HangerMark, ...]


def elevation(hangers: Sequence[HangerGlance]) -> Elevation:
    """Return the hangers evenly spaced in their order, as long as they are, the arch over them."""
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
    ends = [(_SIDE, deck), *zip(places, tops, strict=True), (width - _SIDE, deck)]
    return Elevation(width, deck + _BELOW, deck, step, round(step / 4, 1), _curve(ends), marks)


def kind_of(glance: HangerGlance) -> str:
    """The class of a hanger's shift; a test that is of the baseline itself says nothing of one."""
    shift = glance.shift
    if shift is None:
        return "unknown"
    size = sum(abs(shift.mean) >= limit for limit in _LIMITS)
    if size == 0:
        return "same"
    return f"{'lost' if shift.mean < 0 else 'gained'}{size}"


def shift_words(glance: HangerGlance) -> str:
    """Return the shift from the baseline as people say it."""
    if glance.is_baseline:
        return "is the baseline"
    if glance.shift is None:
        return "no baseline yet" if glance.line.tension_n else "no test yet"
    shift = glance.shift
    return f"{rounded_percent(shift.mean, shift.width / 2, '+')} since the baseline"


def triangles(kind: str, x: float, base: float, hollow: bool = False) -> tuple[Triangle, ...]:
    """As many as the class says, one over the other from `base` up."""
    if kind in ("same", "unknown"):
        return ()
    count, down, half = int(kind[-1]), kind.startswith("lost"), _TRIANGLE / 2
    found = []
    for index in range(count):
        low = base - index * (_TRIANGLE + 1)
        flat, tip = (low - _TRIANGLE + 2, low) if down else (low, low - _TRIANGLE + 2)
        points = f"{x - half:.1f},{flat:.1f} {x + half:.1f},{flat:.1f} {x:.1f},{tip:.1f}"
        found.append(Triangle(points, hollow))
    return tuple(found)


def _mark(glance: HangerGlance, x: float, top: float, number: bool) -> HangerMark:
    kind, shift, line = kind_of(glance), glance.shift, glance.line
    hollow = shift is not None and shift.low < 0 < shift.high
    words = [formatting.hanger_name(glance.hanger.id, glance.hanger.name), shift_words(glance)]
    if line.latest:
        words.append(f"last test {line.latest:%Y-%m-%d}")
    if line.open_alerts:
        words.append(formatting.counted(line.open_alerts, "open alert"))
    return HangerMark(
        id=glance.hanger.id,
        x=round(x, 1),
        top=round(top, 1),
        kind=kind,
        words=", ".join(words),
        triangles=triangles(kind, x, top - 8, hollow),
        number=number,
        open_alerts=line.open_alerts,
        is_quiet=glance.is_quiet,
    )


def _numbered(hangers: Sequence[HangerGlance], places: Sequence[float]) -> set[int]:
    """Return the hangers with room for their number: alerts first, then those that moved."""

    def urgency(index: int) -> tuple[bool, float]:
        glance = hangers[index]
        moved = abs(glance.shift.mean) if glance.shift and kind_of(glance)[-1] in "23" else 0.0
        return glance.line.open_alerts == 0, -moved

    chosen: set[int] = set()
    for index in sorted(range(len(hangers)), key=urgency):
        if all(abs(places[index] - places[each]) >= _BETWEEN_NUMBERS for each in chosen):
            chosen.add(index)
    return chosen


def _curve(points: Sequence[tuple[float, float]]) -> str:
    """A path through all points, evenly spaced, round where they bend and with no hump that they
    have not: a monotone cubic, as Bezier pieces.
    """
    slopes = _slopes([y for _, y in points])
    path = f"M{points[0][0]:.1f} {points[0][1]:.1f}"
    for (begin, end), (first, last) in zip(pairwise(points), pairwise(slopes), strict=True):
        third = (end[0] - begin[0]) / 3
        path += f"C{begin[0] + third:.1f} {begin[1] + first / 3:.1f}"
        path += f" {end[0] - third:.1f} {end[1] - last / 3:.1f} {end[0]:.1f} {end[1]:.1f}"
    return path


def _slopes(heights: Sequence[float]) -> list[float]:
    """The rise from point to point at each of three or more (Fritsch and Butland, 1984): flat at a
    summit, and nowhere so steep as to overshoot.
    """
    rises = [after - before for before, after in pairwise(heights)]
    inner = [2 * a * b / (a + b) if a * b > 0 else 0.0 for a, b in pairwise(rises)]
    return [(3 * rises[0] - inner[0]) / 2, *inner, (3 * rises[-1] - inner[-1]) / 2]
