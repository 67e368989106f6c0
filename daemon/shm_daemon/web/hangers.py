"""Hangers as documents: the state of all; the trend, tests and figures of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from fastapi.responses import JSONResponse

from shm.documents import averaged_document
from shm.errors import NothingThere
from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import HangersNow
from shm.report import formatting
from shm.report.formatting import Interval
from shm.report.states import StatesOverTime
from shm.store import DeliveryState, StoredWatch, TestRow
from shm.store import TrendPoint as StoredPoint
from shm.store.alerts import count_alerts, count_deliveries, list_hanger_events
from shm.store.posteriors import list_trend
from shm.store.recordings import count_stages
from shm.store.tests import count_tests, list_test_rows
from shm.values import Hanger
from shm.values.rounding import ForceUnit, force_unit
from shm.watch.words.alert_text import called_words
from shm_daemon.heartbeat import seconds_since_beat
from shm_daemon.spool import scan
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.address import test_page
from shm_daemon.web.background_work import RETRY_AFTER
from shm_daemon.web.faults import answers
from shm_daemon.web.hanger_figures import FIGURES
from shm_daemon.web.hanger_view import HangerView, View
from shm_daemon.web.models import (
    LARGEST_NUMBER,
    MOST_ROWS,
    FigureDocument,
    HangerNumber,
    document,
    paged,
)
from shm_daemon.web.site import Site, described, quarantined


def tension_unit(points: Sequence[StoredPoint]) -> ForceUnit:
    """Return the one unit of the tensions of a hanger's tests."""
    return force_unit(*(point.averaged.tension_n.mean for point in points))


@dataclass(frozen=True)
class ModalTestRow:
    """One test, its tension in `unit`; `point` is None before it has been through updating."""

    row: TestRow
    point: StoredPoint | None
    unit: ForceUnit

    @property
    def id(self) -> int:
        return self.row.id

    @property
    def name(self) -> str:
        return self.row.name

    @property
    def address(self) -> str:
        return test_page(self.row.hanger, self.row.name)

    @property
    def time(self) -> str:
        """Its own or, where it tells none, that of its receipt."""
        received = self.point is not None and self.point.taken_at is None
        return formatting.moment(self.row.time) + (" (received)" if received else "")

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Temperature, model, tension and its interval."""
        if self.point is None:
            return ("", f"on its way: {self.row.stage.value}", "", "")
        tension = Interval.of_averaged(self.point.averaged).in_unit(self.unit)
        return (
            formatting.temperature(self.point.temperature_c, "not recorded"),
            formatting.model_class(self.point.model),
            formatting.mean(tension),
            formatting.span(tension),
        )


def headings(view: HangerView) -> tuple[str, ...]:
    """Return the headings of the table of tests."""
    unit = tension_unit(view.trend)
    return ("test", "time", "temperature", "model", *formatting.tension_headings(unit))


def lines_before(view: HangerView, limit: int, before: int | None = None) -> list[ModalTestRow]:
    """Return `limit` tests, the newest first, that are older than the test number `before`."""
    points = {point.test_id: point for point in view.trend}
    rows = list_test_rows(view.store, view.hanger.id, limit, before)
    unit = tension_unit(view.trend)
    return [ModalTestRow(row, points.get(row.id), unit) for row in rows]


_of_all = APIRouter(prefix="/api", tags=["state"])
# Statuses as RFC 9110 defines them.
_of_one = APIRouter(
    prefix="/api/hangers/{hanger_id}", tags=["hangers"], responses=answers(404, 422)
)
_SHIFT = ("quantity", "shift_mean", "shift_sd", "threshold", "probability")


@_of_all.get("/status", summary="What is stored and what waits")
def status(site: AtSite, _: Reader) -> JSONResponse:
    """Return counts of recordings, files, alerts and deliveries."""
    workspace, store = site.workspace, site.store
    found = {
        "bridge": workspace.bridge.name,
        "recordings": count_stages(store),
        "spool": len(scan(workspace.spool)),
        "quarantine": quarantined(workspace),
        "open_alerts": count_alerts(store)[0],
        "waiting_deliveries": count_deliveries(store)[DeliveryState.WAITING],
        "daemon_seen_seconds_ago": seconds_since_beat(workspace),
    }
    return document(found)


@_of_all.get("/hangers", summary="The state of all hangers")
def hangers(site: AtSite, _: Reader) -> JSONResponse:
    """Return state, action and urgency of each hanger, its tensions, shifts and open alerts.

    `averaged` is the best estimate since the last change over all model classes, `basis` what it
    rests on, `change` that since the baseline as a fraction, `by_latest_test` and `tension_n` what
    the latest test gives, over all classes and by the class in force. Null before the first test.
    """
    return document({"hangers": _now(site, site.workspace.bridge.hangers)})


@_of_all.get(
    "/hangers/{hanger_id}",
    responses=answers(404, 422),
    summary="The state of one hanger",
)
def hanger(site: AtSite, _: Reader, hanger_id: HangerNumber) -> JSONResponse:
    """Return of one hanger what `/api/hangers` has of all."""
    return document(_now(site, [described(site.workspace, hanger_id)])[0])


def _now(site: Site, hangers: Sequence[Hanger]) -> list[dict[str, Any]]:
    """Return the state of many hangers with as many queries as for one."""
    store = site.store
    known = HangersNow(site.workspace, store, hangers, utc_now())
    tests = count_tests(store)
    set_at = {id_: each.set_at for id_, each in known.baselines.items()}
    return [
        {
            "hanger": hanger.id,
            **{k: v for k, v in known.summary(hanger).document.items() if k != "reason"},
            "tests": tests[hanger.id].tests if hanger.id in tests else 0,
            "latest_test_at": tests[hanger.id].time if hanger.id in tests else None,
            "nominal_tension_n": hanger.nominal_tension_n,
            "baseline_set_at": set_at.get(hanger.id),
            **_watched(known.watches.get(hanger.id)),
            "open_alerts": known.open_alerts.get(hanger.id, 0),
            **_tension(known.latest.get(hanger.id)),
        }
        for hanger in hangers
    ]


def _tension(latest: StoredPoint | None) -> dict[str, Any]:
    if latest is None:
        return {"model": None, "tension_n": None}
    summary = {**asdict(latest.tension_n), "map": latest.most_probable_tension_n}
    return {"model": latest.model, "tension_n": summary}


def _watched(latest: StoredWatch | None) -> dict[str, Any]:
    """Return the result of the latest test compared with the current baseline."""
    drifts = latest.watched.published_drifts if latest else ()
    creep = latest.watched.creep_per_year if latest else None
    return {
        "shifts": [{key: getattr(drift, key) for key in _SHIFT} for drift in drifts],
        "creep_per_year": {"mean": creep.mean, "sd": creep.sd}
        if creep and creep.is_known
        else None,
    }


@_of_one.get("/trend", summary="Tension and end stiffness over time")
def trend(
    _: Reader,
    view: View,
    since: Annotated[datetime | None, Query(description="ISO 8601; all tests without it.")] = None,
) -> JSONResponse:
    """Return every test with its posterior in numbers, oldest first, events and states over time.

    Stiffness is log10 of N m/rad. `states` are temperature-compensated estimates from all tests so
    far, null while they are worked out: ask again after `Retry-After`. `changes` began with 90 %
    probability between `began_after` and `began_by`.
    """
    points = view.trend if since is None else list_trend(view.store, view.hanger, since)
    events = list_hanger_events(view.store, view.hanger.id, since)
    found = {
        "hanger": view.hanger.id,
        "points": [_point(point) for point in points],
        "events": [{"at": e.at, "kind": e.kind.value, "who": e.who, "why": e.why} for e in events],
        "changes": [_change(call) for call in view.calls],
        "states": None if view.states is None else _states(view.states),
    }
    return document(found, _headers(view))


@_of_one.get("/tests", summary="The tests of a hanger")
def some_tests(
    _: Reader,
    view: View,
    limit: Annotated[int, Query(ge=1, le=MOST_ROWS)] = 50,
    before: Annotated[
        int | None,
        Query(ge=0, le=LARGEST_NUMBER, description="`next_before` of the answer before."),
    ] = None,
) -> JSONResponse:
    """Return the newest first; those before a test where `before` names its number.

    `next_before` goes on, null at the oldest test; `page` is the address of a test's page.
    """
    shown, older = paged(lines_before(view, limit + 1, before), limit)
    tests = list(map(_test, shown))
    return document({"hanger": view.hanger.id, "tests": tests, "next_before": older})


@_of_one.get(
    "/figures/{name}", response_model=FigureDocument, summary="A figure of the hanger's page"
)
def figure(
    _: Reader,
    view: View,
    name: Annotated[str, Path(max_length=40, description="`trend`, `stiffness`, ...")],
) -> JSONResponse:
    """Return a plotly document with its caption; with `Retry-After` where it is not whole yet."""
    found = next((each for each in FIGURES if each.member.name == name), None)
    drawing = found.document(view) if found else None
    if found is None or drawing is None:
        known = ", ".join(each.member.name for each in FIGURES if each.specify(view)) or "none"
        raise NothingThere(
            f"hanger {view.hanger.id} has no figure {name}.", remedy=f"Figures: {known}."
        )
    made = JSONResponse(drawing)
    made.headers.update(_headers(view) if found.shows_states else {})
    return made


def _headers(view: HangerView) -> dict[str, str]:
    return RETRY_AFTER if view.states is None else {}


def _point(point: StoredPoint) -> dict[str, Any]:
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
    return [
        {
            "quantity": quantity.name,
            "reference_temperature_c": states.reference_temperature_c,
            "times": list(states.times),
            "q05": quantity.filtered.low,
            "q50": quantity.filtered.middle,
            "q95": quantity.filtered.high,
        }
        for quantity in states.quantities
    ]


def _test(line: ModalTestRow) -> dict[str, Any]:
    point = line.point
    return {
        "id": line.id,
        "test": line.name,
        "time": line.row.time,
        "stage": line.row.stage.value,
        "temperature_c": point.temperature_c if point else None,
        "model": point.model if point else None,
        "tension_n": vars(point.tension_n) if point else None,
        "averaged": averaged_document(point.averaged) if point else None,
        "page": line.address,
    }


router = APIRouter()
router.include_router(_of_all)
router.include_router(_of_one)
