"""The page of one hanger: how it stands, how it went, what the model misses, its tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_lines
from shm.report import formatting, hanger_tables
from shm.report.contents import HangerReport, message
from shm.report.diagnosis_report import answers, evidence
from shm.report.hanger_report import facts, gap_part
from shm.report.hanger_summary import details
from shm.report.paper import Table
from shm.report.states import called_words, temperature_table
from shm.store import EventKind, Workspace
from shm.values import Hanger
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.background_work import background_worker_of
from shm_daemon.web.frame import page
from shm_daemon.web.hanger_figures import FIGURES, HangerFigure
from shm_daemon.web.hanger_numbers import headings, lines_before
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.hangers import Number, described
from shm_daemon.web.models import LARGEST_NUMBER
from shm_daemon.web.site import held_documents

router = APIRouter(include_in_schema=False)

# Technical: what is read at a glance, and what a page has of the older ones.
_LATEST_TESTS = 10
_TESTS_A_PAGE = 100
_LATEST_EVENTS = 20
_EVENTS = {
    EventKind.BASELINE: "baseline set",
    EventKind.ADOPTED: "effect adopted",
    EventKind.UNDONE: "adoption undone",
    EventKind.ACKNOWLEDGED: "alert acknowledged",
}
_TABLES = (
    hanger_tables.results,
    hanger_tables.frequencies,
    hanger_tables.parameters,
    hanger_tables.models,
    hanger_tables.quality,
)


@dataclass(frozen=True)
class Chart:
    """A figure as the page refers to it."""

    title: str
    address: str
    caption: str
    height_px: int
    is_wide: bool


@router.get("/hangers/{hanger_id}")
def hanger(request: Request, site: AtSite, _: Reader, hanger_id: Number) -> HTMLResponse:
    """Everything known of a hanger; its figures are fetched as they come into view."""
    one = described(site.workspace, hanger_id)
    view = HangerView(site.workspace, site.store, one, background_worker_of(request))
    rows = lines_before(view, _LATEST_TESTS + 1)
    common: dict[str, Any] = {
        "name": formatting.hanger_name(one.id, one.name),
        "hanger": one,
        "beside": _beside(site.workspace, one),
        "tests": rows[:_LATEST_TESTS],
        "test_headings": headings(view),
        "has_more": len(rows) > _LATEST_TESTS,
        "held": held_documents(site, one.id),
        "notes": view.notes,
    }
    if view.report is None:
        (line,) = hanger_lines(site.workspace, site.store, utc_now(), [one])
        return page(request, "hanger_untested.html.j2", message=line.message, **common)
    return page(request, "hanger.html.j2", **common, **_content(view, view.report))


@router.get("/hangers/{hanger_id}/tests")
def all_tests(
    request: Request,
    site: AtSite,
    _: Reader,
    hanger_id: Number,
    before: Annotated[int | None, Query(ge=0, le=LARGEST_NUMBER)] = None,
) -> HTMLResponse:
    """All tests of a hanger, the newest first, some a page."""
    one = described(site.workspace, hanger_id)
    view = HangerView(site.workspace, site.store, one, background_worker_of(request))
    rows = lines_before(view, _TESTS_A_PAGE + 1, before)
    return page(
        request,
        "hanger_tests.html.j2",
        name=formatting.hanger_name(one.id, one.name),
        hanger=one,
        tests=rows[:_TESTS_A_PAGE],
        test_headings=headings(view),
        is_first=before is None,
        older=rows[_TESTS_A_PAGE - 1].id if len(rows) > _TESTS_A_PAGE else None,
    )


def _content(view: HangerView, report: HangerReport) -> dict[str, Any]:
    said = message(report)
    assert said.status is not None  # a hanger with a test has one
    return {
        "status_word": said.status.value,
        "style": said.status.name.lower(),
        "lead": said.words,
        "details": details(report),
        "facts": facts(report),
        "is_called": report.is_called,
        "charts": {part: _charts(view, part) for part in ("trends", "model", "gap")},
        "tables": _tables(view, report),
        "alerts": hanger_tables.alerts(report),
        "events": _events(view),
        "gap": gap_part(report),
        "answers": answers(view.sheet) if view.sheet else (),
        "evidence": evidence(view.sheet) if view.sheet else (),
        "origin": hanger_tables.origins(report)[-1],
    }


def _charts(view: HangerView, part: str) -> list[Chart]:
    return [_chart(view, each) for each in FIGURES if each.part == part and each.is_there(view)]


def _chart(view: HangerView, figure: HangerFigure) -> Chart:
    address = f"/api/hangers/{view.hanger.id}/figures/{figure.name}"
    return Chart(figure.title, address, figure.caption(view), figure.height_px, figure.is_wide)


def _tables(view: HangerView, report: HangerReport) -> list[Table]:
    made = [make(report) for make in _TABLES]
    if view.states is not None:
        made.insert(2, temperature_table(view.states))
    return [table for table in made if table.rows]


def _events(view: HangerView) -> Table:
    """What people did and what the watch detected, the latest first."""
    done = [(e.at, _EVENTS[e.kind], e.who, e.why) for e in view.events if e.kind in _EVENTS]
    called = [
        (call.watched.time, "change detected", "the watch", called_words(call.watched.change))
        for call in view.calls
    ]
    rows = sorted([*done, *called], key=lambda row: row[0], reverse=True)
    return Table(
        "What was set, adopted and detected, latest first",
        ("time", "what", "by", "why"),
        tuple((formatting.moment(at), *rest) for at, *rest in rows[:_LATEST_EVENTS]),
        note=formatting.some(min(len(rows), _LATEST_EVENTS), len(rows), "events").strip(),
    )


def _beside(workspace: Workspace, hanger: Hanger) -> list[tuple[str, Hanger]]:
    """The hangers before and after it in the description."""
    order: Sequence[Hanger] = workspace.bridge.hangers
    place = [each.id for each in order].index(hanger.id)
    before = [("previous", order[place - 1])] if place > 0 else []
    return before + [("next", each) for each in order[place + 1 : place + 2]]
