"""The pages of permanent sensors: what is live, and what one stream has shown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import timedelta
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import JSONResponse

from shm.errors import NothingThere
from shm.pipeline import utc_now
from shm.pipeline.stream_state import (
    StreamCondition,
    against_hammer,
    stream_course,
    stream_states,
    tension_words,
)
from shm.report import formatting
from shm.report.figures.stream_course import alt, caption, specify
from shm.report.paper import Table
from shm.store.ring import ring_of
from shm.values.rounding import NINETY_PERCENT, rounded_percent
from shm.values.stream import Stream, StreamEvent
from shm.watch.ambient_hammer import AmbientBias
from shm_daemon.heartbeat import duration_words
from shm_daemon.web import with_plotly
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.faults import answers
from shm_daemon.web.frame import page
from shm_daemon.web.models import FigureDocument, plain
from shm_daemon.web.site import Site

router = APIRouter(tags=["streams"])

_STYLES = {
    "live": "steady",
    "late": "watch",
    "silent": "alert",
    "never sent": "first",
    "sensor at fault": "alert",
    "sees nothing": "alert",
    "clock ahead": "alert",
}
_EVENTS_SHOWN = 40  # technical: what is read at a glance

# As long as the store keeps of a name, and as far back as it keeps hours.
Name = Annotated[str, Path(max_length=64)]
Days = Annotated[float, Query(gt=0, le=800, description="How far the figure reaches back.")]


@dataclass(frozen=True)
class Row:
    """A stream as the page lists it."""

    name: str
    hanger: int
    state: str
    style: str
    cells: tuple[str, ...]


@router.get("/streams", include_in_schema=False)
def streams_page(request: Request, site: AtSite, _: Reader) -> Response:
    """Return all streams of the bridge."""
    rows = [_row(each) for each in _states(site)]
    headings = ("Last sample", "Lag", "Lost in 24 h", "Last window", "Tension since the beginning")
    return page(request, "streams.html.j2", rows=rows, headings=headings)


@router.get("/streams/{name}", include_in_schema=False)
def stream_page(
    request: Request, site: AtSite, _: Reader, name: Name, days: Days = 7.0
) -> Response:
    """Show one stream: its state, its measurements, its events."""
    stream = _stream(site, name)
    state = next(each for each in _states(site) if each.stream.name == name)
    return page(
        request,
        "stream.html.j2",
        stream=stream,
        row=_row(state),
        facts=_facts(state, against_hammer(site.store, stream)),
        events=_events(state.events),
        address=f"/api/streams/{name}/figure?days={days:g}",
        days=days,
    )


@router.get("/api/streams", summary="Permanent sensors")
def streams(site: AtSite, _: Reader) -> Any:
    """Each stream: whether it is live, its lag, what it lost, what its last window said."""
    return JSONResponse(plain({"streams": [_document(each, site) for each in _states(site)]}))


@router.get(
    "/api/streams/{name}/figure",
    response_model=FigureDocument,
    responses=answers(404, 422),
    summary="What a stream has shown",
)
def stream_figure(site: AtSite, _: Reader, name: Name, days: Days = 7.0) -> JSONResponse:
    """Return a plotly document: spectra, tracked frequencies, tension, sensors at fault."""
    stream = _stream(site, name)
    until = ring_of(site.workspace).latest().get(name, utc_now())
    course = stream_course(site.store, stream, until - timedelta(days=days), until)
    if course is None:
        raise NothingThere(
            f"stream {name} has shown nothing in the last {days:g} days.",
            remedy="See `shm stream` for when it was heard last.",
        )
    return JSONResponse(with_plotly.with_words(specify(course), caption(course), alt(course)))


def _states(site: Site) -> tuple[StreamCondition, ...]:
    return stream_states(site.workspace, ring_of(site.workspace), site.store, utc_now())


def _stream(site: Site, name: str) -> Stream:
    for stream in site.workspace.bridge.streams:
        if stream.name == name:
            return stream
    raise NothingThere(f"there is no stream {name}.", remedy="See /streams for those there are.")


def _row(state: StreamCondition) -> Row:
    window = state.window.window if state.window else None
    modes = len(state.window.modes) if state.window else 0
    cells = (
        formatting.moment(state.last_sample) if state.last_sample else "none yet",
        duration_words(state.lag) if state.lag is not None else "",
        f"{state.lost_share:.1%}" if math.isfinite(state.lost_share) else "",
        f"{window.kind}, {formatting.counted(modes, 'mode')}" if window else "none yet",
        tension_words(state.hour),
    )
    return Row(state.stream.name, state.stream.hanger, state.state, _STYLES[state.state], cells)


def _facts(state: StreamCondition, hammer: AmbientBias) -> list[tuple[str, str, str]]:
    stream, window = state.stream, state.window
    behind = duration_words(state.behind) if state.behind is not None else "unknown"
    found = [
        ("Hanger", str(stream.hanger), f"{len(stream.channels)} channels"),
        ("Last sample", formatting.moment(state.last_sample) if state.last_sample else "none yet",
         f"{behind} of it not read yet"),
        ("Kept apart", f"{state.apart_s:.0f} s" if state.apart_s else "nothing",
         "in 24 hours, for a time that was there already"),
        ("Kept raw", f"{state.ring_bytes / 1e6:.0f} MB", ""),
        ("Tension", tension_words(state.hour), "since the beginning, as of the last hour"),
    ]  # fmt: skip
    if window is not None:
        how = {"tracked": "followed from the last window", "none": "no mode"}.get(
            window.how, "identified from scratch"
        )
        found.append(("Last window", f"{window.window.kind}, {len(window.modes)} modes",
                      window.why or how))  # fmt: skip
    if hammer.is_known:
        bias = rounded_percent(hammer.common, NINETY_PERCENT * hammer.common_sd, "+")
        found.append(("Against hammer tests", bias, hammer.text()))
    return found


def _events(events: tuple[StreamEvent, ...]) -> Table:
    newest = sorted(events, key=lambda each: each.start, reverse=True)
    rows = tuple(
        (formatting.moment(each.start), each.kind, each.channel, each.detail)
        for each in newest[:_EVENTS_SHOWN]
    )
    return Table(
        "What was noticed in the last 24 hours, latest first",
        ("time", "what", "channel", "detail"),
        rows,
        note=formatting.some(len(rows), len(newest), "events").strip(),
    )


def _document(state: StreamCondition, site: Site) -> dict[str, Any]:
    window, hour = state.window, state.hour
    hammer = against_hammer(site.store, state.stream)
    return {
        "stream": state.stream.name,
        "hanger": state.stream.hanger,
        "state": state.state,
        "last_sample": state.last_sample,
        "lag_s": state.lag.total_seconds() if state.lag is not None else None,
        "behind_s": state.behind.total_seconds() if state.behind is not None else None,
        "lost_share": state.lost_share,
        "apart_s": state.apart_s,
        "ring_bytes": state.ring_bytes,
        "window": window and {"start": window.window.start, "kind": window.window.kind,
                              "modes": len(window.modes), "how": window.how, "why": window.why},
        "tension_shift": hour.compensated_shift if hour else None,
        "tension_shift_sd": hour.compensated_sd if hour else None,
        "learning": hour.learning if hour else None,
        "ambient_bias": hammer.common,
        "ambient_bias_sd": hammer.common_sd,
        "hammer_tests": hammer.most_tests,
        "events": [vars(each) for each in state.events],
    }  # fmt: skip
