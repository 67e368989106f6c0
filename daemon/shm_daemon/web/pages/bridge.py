"""Show the page of the bridge and the page of all bridges, the worst first."""

from __future__ import annotations

import csv
import io
from datetime import datetime
from types import SimpleNamespace
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from shm.pipeline import utc_now
from shm.pipeline.controls import control_charts
from shm.report import formatting
from shm.report.contents import hangers_unit
from shm.report.formatting import Interval
from shm.report.hanger_status import Status, control_lead
from shm.values.messages import TODAY, URGENCIES, WEEK
from shm.values.rounding import ForceUnit
from shm_daemon.heartbeat import duration_words
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.address import SUMMARY, test_page
from shm_daemon.web.background_work import RETRY_AFTER
from shm_daemon.web.bridge_summary import (
    BridgeRow,
    Summary,
    groups,
    headline,
    row_document,
    site_rows,
    summary_of,
    worst_first,
)
from shm_daemon.web.bridge_view import (
    QUICKLY_COMPARED,
    BridgeGlance,
    HangerGlance,
    compared,
    elevation,
    legend,
    shift_words,
    summarize_hangers,
)
from shm_daemon.web.frame import page
from shm_daemon.web.models import Underway, document
from shm_daemon.web.other_bridges import OtherBridges
from shm_daemon.web.site import Site, held_documents

router = APIRouter(tags=["state"])

_WHEN = {"none": "", "next_test": "next test", "week": WEEK, "today": TODAY}
"""Of an action, in words."""
_COLUMNS = (
    "hanger", "name", "state", "when_to_act", "tension_kn", "tension_q05_kn", "tension_q95_kn",
    "percent_of_nominal", "shift_percent", "shift_q05_percent", "shift_q95_percent", "open_alerts",
    "last_test", "last_test_at", "tests",
)  # fmt: skip
"""Of the table of hangers as CSV: one number in each, days in ISO 8601."""
_COMPARING = "The hangers are being compared …"


@router.get("/", include_in_schema=False)
def bridge_page(request: Request, site: AtSite, _: Reader) -> Response:
    """Return the whole bridge at a glance."""
    now = utc_now()
    bridge = summarize_hangers(site, now)
    found = compared(request, site) if len(bridge.hangers) <= QUICKLY_COMPARED else None
    unit = hangers_unit(each.summary for each in bridge.hangers)
    return page(
        request,
        "bridge.html.j2",
        view=bridge,
        facts=_facts(bridge, now),
        held=held_documents(site),
        drawing=elevation(bridge.hangers) if bridge.hangers else None,
        legend=legend(bridge.hangers),
        moved=found.sentence if found else None,
        unit=unit.name,
        warnings=[
            text
            for each in bridge.hangers
            for text in each.summary.message.beyond_lead(each.summary.warnings)
        ],
        controls=[
            (chart.hanger, control_lead(chart))
            for chart in control_charts(site.workspace, site.store)
        ],
        notes=site.store.notes.list_all(of_bridge=True),
        rows=[SimpleNamespace(**_row(each, unit, now)) for each in bridge.hangers],
    )


@router.get("/hangers.csv", include_in_schema=False)
def hangers_csv(site: AtSite, _: Reader) -> Response:
    """Return the table of hangers as CSV, in the order of the description."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(_COLUMNS)
    writer.writerows(_csv_row(each) for each in summarize_hangers(site, utc_now()).hangers)
    headers = {"Content-Disposition": 'attachment; filename="hangers.csv"'}
    content = text.getvalue().encode("utf-8-sig")
    return Response(content, headers=headers, media_type="text/csv; charset=utf-8")


def _csv_row(each: HangerGlance) -> tuple[str | int, ...]:
    line = each.summary
    latest, name = line.latest, each.hanger.name
    return (
        each.hanger.id,
        f"'{name}" if name.startswith(("=", "@", "+", "-")) else name,  # no formula
        line.status.value if line.status else "",
        _WHEN[line.message.urgency],
        *_numbers(line.tension_n and line.tension_n.scaled(1e-3), line.is_determined),
        _numbers(line.of_nominal, line.is_determined)[0],
        *_numbers(line.change and line.change.scaled(100)),
        line.open_alerts,
        latest.name if latest else "",
        latest.time.isoformat() if latest else "",
        each.tests,
    )


def _numbers(interval: Interval | None, is_determined: bool = True) -> tuple[str, str, str]:
    """Return mean and 90 % interval, empty where unknown; no mean of what is not determined."""
    if interval is None:
        return "", "", ""
    mean = f"{interval.mean:.6g}" if is_determined else ""
    return mean, f"{interval.low:.6g}", f"{interval.high:.6g}"


@router.get("/moved", include_in_schema=False)
def moved_fragment(request: Request, site: AtSite, _: Reader) -> Response:
    """Return the changes over the bridge, for a page that is shown already."""
    found = compared(request, site)
    if found is None:
        return _underway()
    return page(request, "moved.html.j2", moved=found.sentence)


@router.get("/api/bridge", summary="The whole bridge at a glance")
def bridge(site: AtSite, _: Reader) -> JSONResponse:
    """Return each hanger's state and tension; `shift` is since the baseline, a fraction.

    Null before the first test; `shift` also where the latest test is the baseline's.
    """
    found = summarize_hangers(site, utc_now())
    hangers = [_glance_document(each) for each in found.hangers]
    return document({"bridge": found.name, **found.message.document, "hangers": hangers})


@router.get(
    "/api/bridge/moved",
    responses={202: {"model": Underway}},
    summary="What moved over the bridge",
)
def moved(request: Request, site: AtSite, _: Reader) -> JSONResponse:
    """Return the hangers compared with each other; 202 while that is being worked out."""
    found = compared(request, site)
    if found is None:
        return _underway()
    explanations = found.pattern.explanations if found.pattern else ()
    probabilities = {each.name: each.probability for each in explanations}
    return document({"sentence": found.sentence, "explanations": probabilities})


def _facts(bridge: BridgeGlance, now: datetime) -> list[tuple[str, str, str]]:
    """Return the tiles over the drawing."""
    latest = bridge.latest
    alerts = sum(each.summary.open_alerts for each in bridge.hangers)
    quiet = sum(each.is_quiet for each in bridge.hangers)
    never = sum(each.summary.latest is None for each in bridge.hangers)
    missing = [formatting.counted(quiet, "hanger") + " long not tested"] if quiet else []
    missing += [f"{never} without a result"] if never else []
    newest = latest.latest.time if latest and latest.latest else None
    return [
        (
            "Last test",
            f"{duration_words(now - newest)} ago" if newest else "none yet",
            f"hanger {latest.hanger.id}, {formatting.moment(newest)}" if latest else "",
        ),
        ("Hangers", str(len(bridge.hangers)), "; ".join(missing) or "all with a result"),
        ("Tests", str(sum(each.tests for each in bridge.hangers)), ""),
        ("Open alerts", str(alerts) if alerts else "none", ""),
    ]


def _row(each: HangerGlance, unit: ForceUnit, now: datetime) -> dict[str, Any]:
    """Return a hanger's row of the table."""
    line, hanger = each.summary, each.hanger
    latest, (tension, nominal, shift) = line.latest, each.cells(unit)
    return {
        "id": hanger.id,
        "name": formatting.hanger_name(hanger.id, hanger.name),
        "status": line.status,
        "tension": tension,
        "nominal": nominal,
        "shift": shift or (shift_words(each) if latest else ""),
        "message": line.message,
        "when": _WHEN[line.message.urgency],
        "severity": list(Status).index(line.status) if line.status else len(Status),
        "urgency": -URGENCIES.index(line.message.urgency),  # the most urgent first
        "open_alerts": line.open_alerts,
        "day": f"{latest.time:%Y-%m-%d}" if latest else "",
        "age": f"{duration_words(now - latest.time)} ago" if latest else "",
        "test_page": test_page(hanger.id, latest.name) if latest else "",
        "is_quiet": each.is_quiet,
        "tests": each.tests,
    }


def _glance_document(each: HangerGlance) -> dict[str, Any]:
    summary, hanger, latest = each.summary, each.hanger, each.summary.latest
    return {
        "hanger": hanger.id,
        "name": hanger.name,
        "length_m": hanger.length_m,
        "nominal_tension_n": hanger.nominal_tension_n,
        **{k: v for k, v in summary.message.document.items() if k != "reason"},
        "tests": each.tests,
        "latest_test": latest and latest.name,
        "latest_test_at": latest and latest.time,
        "model": latest and (latest.model or None),
        "tension_n": summary.tension_n and _bounded(summary.tension_n),
        "shift": summary.change and _bounded(summary.change),
        "called": summary.detected,
        "open_alerts": summary.open_alerts,
        "warnings": list(summary.warnings),
    }


def _bounded(interval: Interval) -> dict[str, float]:
    return {"mean": interval.mean, "low": interval.low, "high": interval.high}


def _underway() -> JSONResponse:
    return JSONResponse({"message": _COMPARING}, 202, RETRY_AFTER)


@router.get("/bridges", include_in_schema=False)
def bridges_page(request: Request, site: AtSite, _: Reader) -> Response:
    """Show the state of all bridges with links to them."""
    now, rows = utc_now(), _bridges(request, site)
    return page(
        request,
        "bridges.html.j2",
        groups=groups(rows),
        rows=[(each, _words_of(each, now)) for each in rows],
    )


@router.get("/api/bridges", summary="This bridge and the others that it knows")
def bridges(request: Request, site: AtSite, _: Reader) -> JSONResponse:
    """As `shm bridges --json` has them; what others said is at most some seconds old."""
    rows = _bridges(request, site)
    return document({"headline": headline(rows), "bridges": [*map(row_document, rows)]})


@router.get(SUMMARY, response_model=Summary, summary="This bridge in a line")
def summary(site: AtSite, _: Reader) -> Summary:
    """Return the lead of its home page; other bridges are not asked."""
    return summary_of(site, utc_now())


def _bridges(request: Request, site: Site) -> tuple[BridgeRow, ...]:
    asked: OtherBridges = request.app.state.other_bridges
    bridge = site.workspace.bridge
    others = asked.rows(bridge.other_bridges, site.workspace.folder)
    return worst_first((*site_rows(site, utc_now()), *others))


def _words_of(row: BridgeRow, now: datetime) -> str:
    """Return the small print below the lead of a bridge."""
    found = row.summary
    if found is None:
        return ""
    latest = (
        f"last test {duration_words(now - found.latest_test_at)} ago"
        if found.latest_test_at
        else ""
    )
    parts = (
        found.bridge if found.bridge != row.name else "",
        formatting.counted(found.hangers, "hanger"),
        latest or "no test yet",
        formatting.counted(found.open_alerts, "open alert")
        if found.open_alerts
        else "no open alert",
        f"{formatting.counted(found.held, 'recording')} held until you decide"
        if found.held
        else "",
    )
    return " · ".join(filter(None, parts))
