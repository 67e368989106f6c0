"""The page that compares hangers: their tension since the baseline on one axis, and a table."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, date, datetime, time
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse

from shm.errors import BadInput, NothingThere
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.report import formatting
from shm.report.figures.compared_hangers import MOST, TensionShifts, alt, caption, specify
from shm.report.formatting import Interval
from shm.report.hanger_summary import HangerSummary
from shm.store.posteriors import list_baselines_in_force, list_trend
from shm.values import Hanger
from shm_daemon.web import with_plotly
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.faults import answers
from shm_daemon.web.frame import page
from shm_daemon.web.models import LARGEST_NUMBER, FigureDocument
from shm_daemon.web.site import Site, described

router = APIRouter(tags=["hangers"])

_Chosen = Annotated[
    list[Annotated[int, Query(ge=0, le=LARGEST_NUMBER)]] | None,
    Query(description=f"The number of a hanger; up to {MOST} of them."),
]
_Since = Annotated[date | None, Query(description="The first day; all tests without it.")]


@router.get("/compare", include_in_schema=False)
def compare_page(
    request: Request,
    site: AtSite,
    _: Reader,
    hanger: _Chosen = None,
    since: Annotated[str, Query(max_length=10)] = "",
) -> HTMLResponse:
    """Show hangers to choose from, and the chosen ones next to each other."""
    every, day = site.workspace.bridge.hangers, _day(since)
    chosen = _chosen(site, hanger) if hanger else []
    rows = hanger_summaries(site.workspace, site.store, utc_now(), chosen)
    if not chosen:  # the hanger that is worst off, between its neighbours
        first = next((i for i, each in enumerate(rows) if each.message.urgency == "today"), 0)
        start = max(0, min(first - 1, len(rows) - 3))
        rows = rows[start : start + 3]
        chosen = [each.hanger for each in rows]
    asked = [("hanger", each.id) for each in chosen] + ([("since", day)] if day else [])
    return page(
        request,
        "comparison.html.j2",
        choices=[
            (each.id, formatting.hanger_name(each.id, each.name), each in chosen)
            for each in every
        ],
        most=MOST,
        since=day,
        address=f"/api/compare/figure?{urlencode(asked)}" if _is_there(rows, day) else "",
    )  # fmt: skip


@router.get(
    "/api/compare/figure",
    response_model=FigureDocument,
    responses=answers(404, 422),
    summary="Hangers on one time axis",
)
def compare_figure(
    site: AtSite, _: Reader, hanger: _Chosen = None, since: _Since = None
) -> JSONResponse:
    """Return a plotly document: the tension of each hanger since its baseline."""
    courses = _courses(site, _chosen(site, hanger or []), since)
    if not courses:
        raise NothingThere(
            "none of these hangers was tested since a baseline of its own.",
            remedy="Choose others, or an earlier day.",
        )
    return JSONResponse(with_plotly.with_words(specify(courses), caption(courses), alt(courses)))


def _chosen(site: Site, numbers: Sequence[int]) -> list[Hanger]:
    """Return each once, in the order of the description; raises BadInput, NothingThere."""
    if len(set(numbers)) > MOST:
        raise BadInput(
            f"{len(set(numbers))} hangers are too many for one figure.",
            remedy=f"Choose up to {MOST}.",
        )
    wanted = {described(site.workspace, each).id for each in numbers}
    return [each for each in site.workspace.bridge.hangers if each.id in wanted]


def _is_there(rows: Sequence[HangerSummary], since: date | None) -> bool:
    """Return True if `_courses` has data of these hangers."""
    return any(
        row.baseline is not None and row.latest and row.latest.time >= _begin(since) for row in rows
    )


def _begin(since: date | None) -> datetime:
    return datetime.combine(since or date.min, time(), UTC)


def _day(text: str) -> date | None:
    """Return the day of a form field, which may be empty; raises BadInput."""
    if not text:
        return None
    try:
        return date.fromisoformat(text)
    except ValueError as error:
        raise BadInput(f"{text} is no day.", remedy="Give it as 2026-05-31.") from error


def _courses(site: Site, chosen: Sequence[Hanger], since: date | None) -> list[TensionShifts]:
    """Return the courses of the hangers with a baseline and tests since that day."""
    begin = _begin(since) if since else None
    baselines = list_baselines_in_force(site.store, chosen)
    found = []
    for hanger in chosen:
        points = list_trend(site.store, hanger, begin)
        if hanger.id in baselines and points:
            base = Interval.of_averaged(baselines[hanger.id].averaged)
            found.append(
                TensionShifts(
                    formatting.hanger_name(hanger.id, hanger.name),
                    [point.time for point in points],
                    [point.test for point in points],
                    [Interval.of_averaged(point.averaged).since(base) for point in points],
                )
            )
    return found
