"""The page of one test: its modes and whether to trust them, its figures, where it comes from."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from shm.errors import NothingThere
from shm.report import formatting, modal_test_report
from shm.report.figures.modal_test_response import point_name, shown_points
from shm.report.figures.style import VERDICT_STYLES
from shm.report.formatting import Interval
from shm.report.modal_test_report import name
from shm.report.paper import Table, filled
from shm.report.shared_tables import headline, overall
from shm.store.tests import find_neighbours
from shm.values.rounding import force_unit
from shm_daemon.web.access import Reader
from shm_daemon.web.address import test_json, test_page
from shm_daemon.web.background_work import RETRY_AFTER
from shm_daemon.web.frame import page
from shm_daemon.web.modal_test_view import AT_WORK, ModalTestView, TestFigure
from shm_daemon.web.tests import MOST_RESPONSES, View, origin, steps, superseded

router = APIRouter(include_in_schema=False)
Part = Annotated[Literal["page", "hits"], Query()]
Response = Annotated[int | None, Query(ge=0, le=MOST_RESPONSES)]
_NOT_STORED = ("exponential window on the responses", "records")
"""Conditions that only the raw file tells."""


@router.get("/hangers/{hanger_id}/tests/{test:path}")
def one_test(
    request: Request, _: Reader, view: View, response: Response = None, part: Part = "page"
) -> HTMLResponse:
    """Return the page; or, where `part` says so, its tables of hits, once they are worked out."""
    if part == "hits":  # without the frame: the page that asked puts them in their place
        if view.whole() is None:
            return HTMLResponse(f'<p class="note">{AT_WORK}</p>', 202, RETRY_AFTER)
        return page(request, "test_hits.html.j2", hits=_hit_tables(view))
    sheet, hanger_id, shown = view.sheet, view.stored.hanger, view.shown()
    before, after = find_neighbours(view.store, view.stored)
    points = shown.spectrum.points if shown.spectrum else ()
    chosen = response if response is not None and response < len(points) else None
    if chosen is None:  # that which shows the modes best
        chosen = shown_points(shown.sheet, shown.spectrum, 1)[0] if shown.spectrum else 0
    address = test_page(hanger_id, view.stored.test.id)
    return page(
        request,
        "test.html.j2",
        title=name(sheet),
        hanger=hanger_id,
        test=view.stored.test.id,
        recording=view.recording.id,
        verdict=headline(view.stored.quality),
        style=VERDICT_STYLES[overall(view.stored.quality)],
        summary=view.summary,
        facts=_facts(view),
        missing=view.missing,
        before=before and (before, test_page(hanger_id, before)),
        after=after and (after, test_page(hanger_id, after)),
        checks=filled(modal_test_report.quality(sheet)),
        results=filled(modal_test_report.modes(sheet), modal_test_report.foreign_modes(sheet)),
        drawings=_drawings(view, chosen),
        points=[point_name(point) for point in points],
        chosen=chosen,
        address=address,
        document=test_json(hanger_id, view.stored.test.id),
        hits=_hit_tables(view),
        at_work=AT_WORK,
        details=_details(view),
        lineage=filled(origin(view), steps(view), superseded(view)),
    )


def _hit_tables(view: ModalTestView) -> tuple[Table, ...] | None:
    """Return the tables of hits; None where they are not computed."""
    whole = None if view.missing else view.background_worker.stored(view.order)
    return filled(whole.hits) if whole else None


def _details(view: ModalTestView) -> tuple[Table, ...]:
    """Return tables of details; dropped data are separate if computed, else among the notes."""
    notes = modal_test_report.notes(view.sheet)
    if view.worked:
        return filled(notes, view.worked.dropped, view.worked.conditions)
    found = modal_test_report.conditions(view.as_stored)
    rows = tuple(row for row in found.rows if row[0] not in _NOT_STORED)
    return filled(notes, replace(found, rows=rows))


def _drawings(view: ModalTestView, chosen: int) -> dict[str, list[tuple[TestFigure, str, int]]]:
    """Return the figures of each tab with their addresses and heights."""
    found: dict[str, list[tuple[TestFigure, str, int]]] = {}
    for each in view.figures():
        found.setdefault(each.tab, []).append((each, *_chart(view, each, chosen)))
    return found


def _chart(view: ModalTestView, figure: TestFigure, chosen: int) -> tuple[str, int]:
    """Return the address of a figure's document, and its height."""
    address = f"{test_json(view.stored.hanger, view.stored.test.id)}/figures/{figure.name}"
    if figure.source == "both":
        address += f"?point={chosen}"
    return address, figure.height_px(view.sheet)


def _facts(view: ModalTestView) -> tuple[tuple[str, str, str], ...]:
    """Return the figures on top: what, value, what stands beside it."""
    test, sheet = view.stored.test, view.sheet
    planes = {mode.plane for mode in sheet.modes}
    n_foreign = len(sheet.identification.set_aside)
    return (
        ("Modes", str(len(sheet.modes)), f"in {formatting.counted(len(planes), 'plane')}"),
        _tension(view),
        ("Temperature", formatting.temperature(test.temperature_c, "not recorded"), "of the test"),
        (
            "Tested",
            formatting.moment(test.time),
            f"received {formatting.moment(view.recording.received_at)}",
        ),
        ("Excluded", str(n_foreign), "resonances without an order"),
    )


def _tension(view: ModalTestView) -> tuple[str, str, str]:
    try:
        posterior = view.store.posteriors.get(view.stored.hanger, view.stored.test.id)
    except NothingThere:
        return "Tension", "not yet", f"the test is {view.stored.stage}"
    tension_n = Interval.of_samples(posterior.tension_n)
    unit = force_unit(tension_n.mean)
    tension = tension_n.in_unit(unit)
    span = f"90 % interval {formatting.span(tension)} {unit.name}"
    details = f"{span}, {formatting.model_class(posterior.model)}"
    return "Tension by this test", f"{formatting.mean(tension)} {unit.name}", details
