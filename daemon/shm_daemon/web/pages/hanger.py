"""Show the page of a hanger: state, trend, model, tests; its report and its results as files."""

from __future__ import annotations

import csv
import io
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse

from shm.errors import NothingThere
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.pipeline.reporting import DEED_WORDS, hanger_report
from shm.report import formatting, hanger_tables
from shm.report.bar_table import bar_table
from shm.report.contents import DiagnosisSheet, HangerReport
from shm.report.diagnosis_report import answers, evidence, next_measurements, tension
from shm.report.hanger_report import facts, gap_part, hanger_paper
from shm.report.hanger_sentences import details
from shm.report.hanger_tables import temperature_table
from shm.report.paper import Table, filled
from shm.store import EventKind, Store, TrendPoint, Workspace
from shm.store.posteriors import find_latest_trends, list_trend
from shm.values import Hanger
from shm.values.bar_description import describe_bar
from shm.watch.words.alert_text import called_words
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.background_work import RETRY_AFTER, BackgroundWorker, background_worker_of
from shm_daemon.web.faults import Refused
from shm_daemon.web.frame import page
from shm_daemon.web.hanger_figures import FIGURES, HangerFigure
from shm_daemon.web.hanger_view import HangerView, View
from shm_daemon.web.hangers import headings, lines_before
from shm_daemon.web.models import Before, HangerNumber, paged
from shm_daemon.web.site import described, held_documents

router = APIRouter(include_in_schema=False)

# Technical: what is read at a glance, and what a page has of the older ones.
_LATEST_TESTS = 10
_TESTS_A_PAGE = 100
_LATEST_EVENTS = 20
_EVENTS = {**DEED_WORDS, EventKind.ACKNOWLEDGED: "alert acknowledged"}
_TABLES = {
    "numbers": (hanger_tables.changes, hanger_tables.frequencies),
    "model": (hanger_tables.models, hanger_tables.parameters),
    "tests": (hanger_tables.quality, hanger_tables.conditions),
}
_TYPES = {"pdf": "application/pdf", "html": "text/html; charset=utf-8"}
# Judgement: a report takes 5 to 15 s; a browser's user waits for a minute, hardly longer.
_LONGEST_S = 60.0
_LOOK_S = 0.2
_FRESH_S = 60
"""A report is kept for so long: acknowledgements and notes change it without a new test."""
_COLUMNS = (
    "test", "time_utc", "temperature_c", "model", "tension_n", "tension_q05_n", "tension_q95_n",
    "repeatability_sd_n",
)  # fmt: skip


@dataclass(frozen=True)
class Chart:
    """A figure as the page refers to it."""

    title: str
    address: str
    caption: str
    height_px: int


@router.get("/hangers/{hanger_id}")
def hanger(request: Request, site: AtSite, _: Reader, view: View) -> HTMLResponse:
    """Show a hanger; its figures are fetched as they come into view."""
    one, rows = view.hanger, lines_before(view, _LATEST_TESTS + 1)
    common: dict[str, Any] = {
        "name": formatting.hanger_name(one.id, one.name),
        "hanger": one,
        "beside": _neighbours(site.workspace, one),
        "tests": rows[:_LATEST_TESTS],
        "test_headings": headings(view),
        "has_more": len(rows) > _LATEST_TESTS,
        "held": held_documents(site, one.id),
        "notes": view.notes,
        "bar": bar_table(describe_bar(one) if view.report is None else view.report.bar),
    }
    if view.report is None:
        (line,) = hanger_summaries(site.workspace, site.store, utc_now(), [one])
        return page(request, "hanger_untested.html.j2", message=line.message, **common)
    return page(request, "hanger.html.j2", **common, **_content(view, view.report))


@router.get("/hangers/{hanger_id}/tests")
def all_tests(request: Request, _: Reader, view: View, before: Before = None) -> HTMLResponse:
    """Return all tests of a hanger, the newest first, some a page."""
    one = view.hanger
    tests, older = paged(lines_before(view, _TESTS_A_PAGE + 1, before), _TESTS_A_PAGE)
    return page(
        request,
        "hanger_tests.html.j2",
        name=formatting.hanger_name(one.id, one.name),
        hanger=one,
        tests=tests,
        test_headings=headings(view),
        is_first=before is None,
        older=older,
    )


def _content(view: HangerView, report: HangerReport) -> dict[str, Any]:
    lead = report.now.message
    assert lead.status is not None  # a hanger with a test has one
    tables = {part: [make(report) for make in of] for part, of in _TABLES.items()}
    if view.states is not None:
        tables["numbers"].append(temperature_table(view.states))
    return {
        "status_word": lead.status.value,
        "style": lead.status.name.lower(),
        "lead": lead.words,
        "details": details(report),
        "facts": facts(report),
        "is_called": bool(report.now.called),
        "charts": {
            part: [_chart(view, e) for e in FIGURES if e.part == part and e.specify(view)]
            for part in ("trends", "model", "gap", "gap_details")
        },
        "tables": {part: [each for each in of if each.rows] for part, of in tables.items()},
        "alerts": hanger_tables.alerts(report),
        "events": _events(view),
        "gap": gap_part(report),
        **_diagnosis_tables(view.sheet),
    }


def _diagnosis_tables(sheet: DiagnosisSheet | None) -> dict[str, tuple[Table, ...]]:
    """Return the tables that decide what to do, and those that few read, which are folded."""
    if sheet is None:
        return {"answers": (), "evidence": ()}
    shown = filled(tension(sheet), next_measurements(sheet))
    titles = {each.title for each in shown}
    others = tuple(each for each in answers(sheet) if each.title not in titles)
    return {"answers": shown, "evidence": (*others, *evidence(sheet))}


def _chart(view: HangerView, figure: HangerFigure) -> Chart:
    address = f"/api/hangers/{view.hanger.id}/figures/{figure.member.name}"
    return Chart(figure.member.title, address, figure.caption(view), figure.height_px)


def _events(view: HangerView) -> Table:
    """Return the actions of people and the detections of the watch, the latest first."""
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


def _neighbours(workspace: Workspace, hanger: Hanger) -> list[tuple[str, Hanger]]:
    """Return the hangers before and after it in the description."""
    order = workspace.bridge.bars
    place = [each.id for each in order].index(hanger.id)
    before = [("previous", order[place - 1])] if place > 0 else []
    return before + [("next", each) for each in order[place + 1 : place + 2]]


@dataclass(frozen=True)
class ReportOrder:
    """A report to be made in a process of its own: of which hanger, in which minute."""

    folder: Path
    hanger: int
    form: Literal["pdf", "html"]
    minute: int

    def make(self) -> bytes:
        workspace = Workspace.open(self.folder)
        with workspace.store() as store:
            paper = hanger_paper(hanger_report(workspace, store, self.hanger, utc_now()))
        if self.form == "pdf":
            from shm.report.as_pdf import as_pdf

            return as_pdf(paper)
        from shm.report.as_html import as_html

        return as_html(paper).encode()


@router.get("/hangers/{hanger_id}/report.{form}")
def report(
    request: Request, site: AtSite, _: Reader, hanger_id: HangerNumber, form: Literal["pdf", "html"]
) -> Response:
    """Return the document of `shm report`; 503 with `Retry-After` if many others wait."""
    _refuse_untested(site.store, described(site.workspace, hanger_id))
    minute = int(time.time() // _FRESH_S)
    order = ReportOrder(site.workspace.folder, hanger_id, form, minute)
    made = _awaited(background_worker_of(request), order)
    return _file(made, f"hanger{hanger_id}.{form}", _TYPES[form])


@router.get("/hangers/{hanger_id}/results.csv")
def results(site: AtSite, _: Reader, hanger_id: HangerNumber) -> Response:
    """Return every test with its tension averaged over the classes, in N, oldest first, as CSV."""
    hanger = described(site.workspace, hanger_id)
    _refuse_untested(site.store, hanger)
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(_COLUMNS)
    writer.writerows(_row(point) for point in list_trend(site.store, hanger))
    return _file(text.getvalue().encode(), f"hanger{hanger_id}.csv", "text/csv; charset=utf-8")


def _refuse_untested(store: Store, hanger: Hanger) -> None:
    if not find_latest_trends(store, [hanger]):
        raise NothingThere(
            f"hanger {hanger.id} has no test to report.", remedy="Upload a recording of it."
        )


def _awaited(worker: BackgroundWorker[bytes], order: ReportOrder) -> bytes:
    ends_at = time.monotonic() + _LONGEST_S
    while (made := worker.get_or_start(order)) is None:
        if time.monotonic() > ends_at:
            raise Refused(503, "the report is not made yet.", "Ask again.", RETRY_AFTER)
        time.sleep(_LOOK_S)
    return made


def _file(content: bytes, name: str, kind: str) -> Response:
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(content, headers=headers, media_type=kind)


def _row(point: TrendPoint) -> tuple[str, ...]:
    known = point.averaged.tension_n
    numbers = (known.mean, known.q05, known.q95, point.averaged.repeatability_sd_n)
    when = f"{point.taken_at:%Y-%m-%dT%H:%M:%SZ}" if point.taken_at else ""
    temperature = _cell(point.temperature_c)
    # No formula for a spreadsheet: a test is named by whoever uploads its file.
    inert = f"'{point.test}" if point.test.startswith(("=", "+", "-", "@")) else point.test
    return (inert, when, temperature, point.model, *map(_cell, numbers))


def _cell(value: float) -> str:
    """Return a value for CSV; empty where unknown."""
    return f"{value:.6g}" if math.isfinite(value) else ""
