"""The page of the bridge: its elevation, what moved over it, and all hangers in a table.

The elevation of the bridge: where its deck, arch and hangers are drawn, and what marks them.

A class of shift has a colour and, for whoever cannot tell colours, a number of triangles: down for
lost, up for gained. Lengths are in drawing units; upwards is less y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from shm.pipeline import utc_now
from shm.report import formatting
from shm.report.contents import hangers_unit
from shm.report.formatting import Interval
from shm.values.messages import TODAY, WEEK
from shm.values.rounding import ForceUnit, rounded_percent
from shm_daemon.heartbeat import told
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.address import test_page
from shm_daemon.web.background_work import RETRY_AFTER
from shm_daemon.web.bridge_view import (
    QUICKLY_COMPARED,
    BridgeGlance,
    HangerGlance,
    compared,
    glance,
)
from shm_daemon.web.frame import page
from shm_daemon.web.models import BridgeState, Moved, Underway
from shm_daemon.web.site import held_documents

router = APIRouter(tags=["state"])

_WHEN = {
    "none": "",
    "next_test": "next test",
    "week": WEEK,
    "today": TODAY,
}  # of an action, in words
_COMPARING = "The hangers are being compared …"


@router.get("/", include_in_schema=False)
def bridge_page(request: Request, site: AtSite, _: Reader) -> Response:
    """The whole bridge at a glance."""
    now = utc_now()
    bridge = glance(site, now)
    found = compared(request, site) if len(bridge.hangers) <= QUICKLY_COMPARED else None
    unit = hangers_unit(each.line for each in bridge.hangers)
    return page(
        request,
        "bridge.html.j2",
        view=bridge,
        facts=_facts(bridge, now),
        held=held_documents(site),
        drawing=elevation(bridge.hangers) if bridge.hangers else None,
        legend=[(kind, said, triangles(kind, 16, 24)) for kind, said in CLASSES],
        moved=found.sentence if found else None,
        unit=unit.name,
        warnings=[
            said
            for each in bridge.hangers
            for said in each.line.message.beyond_lead(each.line.warnings)
        ],
        notes=site.store.notes.list_all(of_bridge=True),
        rows=[SimpleNamespace(**_row(each, unit, now)) for each in bridge.hangers],
    )


@router.get("/moved", include_in_schema=False)
def moved_fragment(request: Request, site: AtSite, _: Reader) -> Response:
    """What moved over the bridge, for a page that is shown already."""
    found = compared(request, site)
    if found is None:
        return _underway()
    return page(request, "moved.html.j2", moved=found.sentence)


@router.get("/api/bridge", response_model=BridgeState, summary="The whole bridge at a glance")
def bridge(site: AtSite, _: Reader) -> Any:
    """Each hanger's tension, against its baseline too."""
    found = glance(site, utc_now())
    return {
        "bridge": found.name,
        **found.message.document,
        "hangers": [_glance_document(each) for each in found.hangers],
    }


@router.get(
    "/api/bridge/moved",
    response_model=Moved,
    responses={202: {"model": Underway}},
    summary="What moved over the bridge",
)
def moved(request: Request, site: AtSite, _: Reader) -> Any:
    """The hangers compared with each other; 202 while that is being worked out."""
    found = compared(request, site)
    if found is None:
        return _underway()
    explanations = found.pattern.explanations if found.pattern else ()
    return {
        "sentence": found.sentence,
        "explanations": {each.name: each.probability for each in explanations},
    }


def _facts(bridge: BridgeGlance, now: datetime) -> list[tuple[str, str, str]]:
    """The tiles over the drawing."""
    latest = bridge.latest
    alerts = sum(each.line.open_alerts for each in bridge.hangers)
    quiet = sum(each.is_quiet for each in bridge.hangers)
    never = sum(each.line.latest is None for each in bridge.hangers)
    missing = [formatting.counted(quiet, "hanger") + " long not tested"] if quiet else []
    missing += [f"{never} without a result"] if never else []
    newest = latest.latest if latest else None
    return [
        (
            "Last test",
            f"{told(now - newest)} ago" if newest else "none yet",
            f"hanger {latest.hanger.id}, {formatting.moment(newest)}" if latest else "",
        ),
        ("Hangers", str(len(bridge.hangers)), "; ".join(missing) or "all with a result"),
        ("Tests", str(sum(each.tests for each in bridge.hangers)), ""),
        ("Open alerts", str(alerts) if alerts else "none", ""),
    ]


def _row(each: HangerGlance, unit: ForceUnit, now: datetime) -> dict[str, Any]:
    """A hanger's row of the table."""
    line, hanger = each.line, each.hanger
    tension, latest = line.tension_n, line.latest
    return {
        "id": hanger.id,
        "name": formatting.hanger_name(hanger.id, hanger.name),
        "status": line.status,
        "tension": _in(unit, tension) if tension else "no test yet",
        "nominal": formatting.mean(line.of_nominal) if line.of_nominal else "",
        "shift": _shift(each),
        "message": line.message,
        "when": _WHEN[line.message.urgency],
        "open_alerts": line.open_alerts,
        "day": f"{latest:%Y-%m-%d}" if latest else "",
        "age": f"{told(now - latest)} ago" if latest else "",
        "test_page": test_page(hanger.id, line.test) if latest else "",
        "is_quiet": each.is_quiet,
        "tests": each.tests,
    }


def _in(unit: ForceUnit, tension: Interval) -> str:
    return formatting.with_half(tension, unit).removesuffix(f" {unit.name}")


def _shift(each: HangerGlance) -> str:
    if each.shift is None:
        return shift_words(each) if each.line.latest else ""
    return rounded_percent(each.shift.mean, each.shift.width / 2, "+").removesuffix(" %")


def _glance_document(each: HangerGlance) -> dict[str, Any]:
    line, hanger = each.line, each.hanger
    return {
        "hanger": hanger.id,
        "name": hanger.name,
        "length_m": hanger.length_m,
        "nominal_tension_n": hanger.nominal_tension_n,
        **line.message.document,
        "tests": each.tests,
        "latest_test": line.test or None,
        "latest_test_at": line.latest,
        "model": line.model or None,
        "tension_n": _interval(line.tension_n),
        "shift": _interval(each.shift),
        "called": line.called,
        "open_alerts": line.open_alerts,
        "warnings": list(line.warnings),
    }


def _underway() -> JSONResponse:
    return JSONResponse({"message": _COMPARING}, 202, RETRY_AFTER)


def _interval(interval: Interval | None) -> dict[str, float] | None:
    return asdict(interval) if interval else None


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
_TALLEST, _TOP, _BELOW, _BESIDE = 220.0, 48.0, 60.0, 36.0
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
    """The hangers evenly spaced in their order, as long as they are, the arch over them."""
    step = min(_MOST_STEP, max(_LEAST_STEP, (_WIDEST - 2 * _BESIDE) / (len(hangers) + 1)))
    longest = max(each.hanger.length_m for each in hangers)
    deck = _TOP + _TALLEST
    tops = [deck - _TALLEST * each.hanger.length_m / longest for each in hangers]
    places = [_BESIDE + step * (index + 1) for index in range(len(hangers))]
    numbered = _numbered(hangers, places)
    marks = tuple(
        _mark(each, x, top, index in numbered)
        for index, (each, x, top) in enumerate(zip(hangers, places, tops, strict=True))
    )
    width = 2 * _BESIDE + step * (len(hangers) + 1)
    ends = [(_BESIDE, deck), *zip(places, tops, strict=True), (width - _BESIDE, deck)]
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
    """The shift from the baseline as people say it."""
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
    kind, shift = kind_of(glance), glance.shift
    hollow = shift is not None and shift.low < 0 < shift.high
    return HangerMark(
        id=glance.hanger.id,
        x=round(x, 1),
        top=round(top, 1),
        kind=kind,
        words=_words(glance),
        triangles=triangles(kind, x, top - 8, hollow),
        number=number,
        open_alerts=glance.line.open_alerts,
        is_quiet=glance.is_quiet,
    )


def _words(glance: HangerGlance) -> str:
    parts = [formatting.hanger_name(glance.hanger.id, glance.hanger.name), shift_words(glance)]
    if glance.line.latest:
        parts.append(f"last test {glance.line.latest:%Y-%m-%d}")
    if glance.line.open_alerts:
        parts.append(formatting.counted(glance.line.open_alerts, "open alert"))
    return ", ".join(parts)


def _numbered(hangers: Sequence[HangerGlance], places: Sequence[float]) -> set[int]:
    """Which have room for their number: those with an alert, then those that moved, go before."""

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
