"""What the page of a hanger shows, in numbers: trend, tests, documents of the figures."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import JSONResponse

from shm.documents import averaged_document
from shm.errors import NothingThere
from shm.report.states import QuantityOverTime, StatesOverTime, called_words
from shm.store import StoredWatch, TrendPoint
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.background_work import RETRY_AFTER, background_worker_of
from shm_daemon.web.faults import answers
from shm_daemon.web.hanger_figures import FIGURES
from shm_daemon.web.hanger_models import FigureDocument, HangerTests, HangerTrend
from shm_daemon.web.hanger_tests import TestLine, lines_before
from shm_daemon.web.hanger_view import HangerView
from shm_daemon.web.hangers import Number, described
from shm_daemon.web.models import LARGEST_NUMBER, MOST_ROWS
from shm_daemon.web.plotting import answer, plain
from shm_daemon.web.site import Site

router = APIRouter(prefix="/api/hangers/{hanger_id}", tags=["hangers"])


@router.get(
    "/trend",
    response_model=HangerTrend,
    responses=answers(400, 401, 403, 404, 422, 503),
    summary="Tension and end stiffness over time",
)
def trend(
    request: Request,
    site: AtSite,
    _: Reader,
    hanger_id: Number,
    since: Annotated[datetime | None, Query(description="ISO 8601; all tests without it.")] = None,
) -> Any:
    """Every test with its posterior in numbers, the oldest first, events and states over time."""
    view = _view(request, site, hanger_id)
    points = view.trend if since is None else view.store.posteriors.trend(view.hanger, since)
    events = view.store.alerts.list_hanger_events(hanger_id, since)
    return JSONResponse(
        plain(
            {
                "hanger": hanger_id,
                "points": [_point(point) for point in points],
                "events": [
                    {"at": e.at, "kind": e.kind.value, "who": e.who, "why": e.why} for e in events
                ],
                "changes": [_change(call) for call in view.calls],
                "states": None if view.states is None else _states(view.states),
            }
        ),
        headers=_headers(view),
    )


@router.get(
    "/tests",
    response_model=HangerTests,
    responses=answers(400, 401, 403, 404, 422, 503),
    summary="The tests of a hanger",
)
def some_tests(
    request: Request,
    site: AtSite,
    _: Reader,
    hanger_id: Number,
    limit: Annotated[int, Query(ge=1, le=MOST_ROWS)] = 50,
    before: Annotated[
        int | None,
        Query(ge=0, le=LARGEST_NUMBER, description="`next_before` of the answer before."),
    ] = None,
) -> Any:
    """The newest first; those before a test where `before` names its number."""
    rows = lines_before(_view(request, site, hanger_id), limit + 1, before)
    return {
        "hanger": hanger_id,
        "tests": [_test(line) for line in rows[:limit]],
        "next_before": rows[limit - 1].id if len(rows) > limit else None,
    }


@router.get(
    "/figures/{name}",
    response_model=FigureDocument,
    responses=answers(400, 401, 403, 404, 422, 503),
    summary="A figure of the hanger's page",
)
def figure(
    request: Request,
    site: AtSite,
    _: Reader,
    hanger_id: Number,
    name: Annotated[str, Path(max_length=40, description="`trend`, `stiffness`, ...")],
) -> JSONResponse:
    """A plotly document with its caption; with `Retry-After` where it is not whole yet."""
    view = _view(request, site, hanger_id)
    found = next((each for each in FIGURES if each.name == name and each.is_there(view)), None)
    if found is None:
        raise NothingThere(
            f"hanger {hanger_id} has no figure {name}.",
            remedy=f"Figures: {', '.join(e.name for e in FIGURES if e.is_there(view)) or 'none'}.",
        )
    made = answer(found.document(view))
    made.headers.update(_headers(view) if found.shows_states else {})
    return made


def _view(request: Request, site: Site, hanger_id: int) -> HangerView:
    hanger = described(site.workspace, hanger_id)
    return HangerView(site.workspace, site.store, hanger, background_worker_of(request))


def _headers(view: HangerView) -> dict[str, str]:
    return RETRY_AFTER if view.states is None else {}


def _point(point: TrendPoint) -> dict[str, Any]:
    return {
        "test": point.test,
        "time": point.time,
        "temperature_c": point.temperature_c,
        "model": point.model,
        "tension_n": vars(point.tension_n),
        "averaged": averaged_document(point.averaged),
        "stiffness": {name: vars(numbers) for name, numbers in point.stiffness.items()},
    }


def _change(call: StoredWatch) -> dict[str, Any]:
    change = call.watched.change
    return {
        "called_by": call.watched.test,
        "began_after": change.began_after,
        "began_by": change.began_by,
        "words": called_words(change),
    }


def _states(states: StatesOverTime) -> list[dict[str, Any]]:
    return [_state(states, quantity) for quantity in states.quantities]


def _state(states: StatesOverTime, quantity: QuantityOverTime) -> dict[str, Any]:
    band = quantity.filtered
    return {
        "quantity": quantity.name,
        "reference_temperature_c": states.reference_temperature_c,
        "times": list(states.times),
        "q05": band.low,
        "q50": band.middle,
        "q95": band.high,
    }


def _test(line: TestLine) -> dict[str, Any]:
    point = line.point
    return {
        "id": line.id,
        "test": line.name,
        "time": line.row.time,
        "stage": line.row.stage.value,
        "temperature_c": plain(point.temperature_c) if point else None,
        "model": point.model if point else None,
        "tension_n": vars(point.tension_n) if point else None,
        "averaged": plain(averaged_document(point.averaged)) if point else None,
        "page": line.address,
    }
