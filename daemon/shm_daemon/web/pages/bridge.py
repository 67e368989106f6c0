"""The page of the bridge: its elevation, what moved over it, and all hangers in a table."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from shm.pipeline import utc_now
from shm.report import Interval, words
from shm.report.bridge.content import hangers_unit
from shm.values.force_units import ForceUnit
from shm_daemon.heartbeat import told
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.bridge_drawing import CLASSES, elevation, shift_words, triangles
from shm_daemon.web.bridge_view import (
    QUICKLY_COMPARED,
    BridgeGlance,
    HangerGlance,
    compared,
    glance,
)
from shm_daemon.web.faults import answers
from shm_daemon.web.frame import page
from shm_daemon.web.held import held_documents
from shm_daemon.web.models import BridgeState, Moved, Underway
from shm_daemon.web.test_address import test_page

router = APIRouter(tags=["state"])

_AGAIN_S = 2
_MOST_DECIMALS = 2
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
        rows=[_row(each, unit, now) for each in bridge.hangers],
    )


@router.get("/moved", include_in_schema=False)
def moved_fragment(request: Request, site: AtSite, _: Reader) -> Response:
    """What moved over the bridge, for a page that is shown already."""
    found = compared(request, site)
    if found is None:
        return _underway()
    return page(request, "moved.html.j2", moved=found.sentence)


@router.get(
    "/api/bridge",
    response_model=BridgeState,
    responses=answers(400, 401, 403, 503),
    summary="The whole bridge at a glance",
)
def bridge(site: AtSite, _: Reader) -> Any:
    """Each hanger's tension, against its baseline too."""
    found = glance(site, utc_now())
    return {
        "bridge": found.name,
        "status": found.worst.name.lower() if found.worst else None,
        "hangers": [_glance_document(each) for each in found.hangers],
    }


@router.get(
    "/api/bridge/moved",
    response_model=Moved,
    responses={202: {"model": Underway}, **answers(400, 401, 403, 503)},
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
    missing = [words.counted(quiet, "hanger") + " long not tested"] if quiet else []
    missing += [f"{never} without a result"] if never else []
    newest = latest.latest if latest else None
    return [
        (
            "Last test",
            f"{told(now - newest)} ago" if newest else "none yet",
            f"hanger {latest.hanger.id}, {words.moment(newest)}" if latest else "",
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
        "name": words.hanger_name(hanger.id, hanger.name),
        "status": line.status,
        "tension": words.with_span(tension.in_unit(unit)) if tension else "no test yet",
        "nominal": f"{line.of_nominal.mean:.1f}" if line.of_nominal else "",
        "shift": _shift(each),
        "called": line.called,
        "open_alerts": line.open_alerts,
        "day": f"{latest:%Y-%m-%d}" if latest else "",
        "age": f"{told(now - latest)} ago" if latest else "",
        "test_page": test_page(hanger.id, line.test) if latest else "",
        "is_quiet": each.is_quiet,
        "tests": each.tests,
    }


def _shift(each: HangerGlance) -> str:
    if each.shift is None:
        return shift_words(each) if each.line.latest else ""
    percent = each.shift.scaled(100)
    places = min(_MOST_DECIMALS, max(1, words.decimals(percent.width)))
    mean, low, high = (
        f"{value:+z.{places}f}" for value in (percent.mean, percent.low, percent.high)
    )
    return f"{mean} ({low} to {high})"


def _glance_document(each: HangerGlance) -> dict[str, Any]:
    line, hanger = each.line, each.hanger
    return {
        "hanger": hanger.id,
        "name": hanger.name,
        "length_m": hanger.length_m,
        "nominal_tension_n": hanger.nominal_tension_n,
        "status": line.status.name.lower() if line.status else None,
        "tests": each.tests,
        "latest_test": line.test or None,
        "latest_test_at": line.latest,
        "model": line.model or None,
        "tension_n": _interval(line.tension_n),
        "shift": _interval(each.shift),
        "called": line.called,
        "open_alerts": line.open_alerts,
    }


def _underway() -> JSONResponse:
    return JSONResponse({"message": _COMPARING}, 202, {"Retry-After": str(_AGAIN_S)})


def _interval(interval: Interval | None) -> dict[str, float] | None:
    return asdict(interval) if interval else None
