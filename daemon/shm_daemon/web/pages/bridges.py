"""The page of all bridges: this one and those of `[[other_bridge]]`, the worst first."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, Field

from shm.pipeline import utc_now
from shm.report.formatting import counted
from shm.values.messages import Lead, Urgency
from shm_daemon.heartbeat import told
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.address import SUMMARY
from shm_daemon.web.bridge_summary import (
    BridgeRow,
    Summary,
    groups,
    headline,
    own_row,
    row_document,
    summary_of,
    worst_first,
)
from shm_daemon.web.frame import page
from shm_daemon.web.other_bridges import OtherBridges
from shm_daemon.web.site import Site

router = APIRouter(tags=["state"])


class BridgeInList(BaseModel):
    """A bridge, and what it said of itself when it could be asked last."""

    name: str
    address: str
    states: list[str] = Field(description="In a word or two; empty before the first test.")
    urgency: Urgency = Field(description="`today` too where nobody watches it.")
    trouble: Lead | None = Field(description="Why it cannot be asked now; null where it was.")
    told_at: datetime | None
    summary: Summary | None = Field(description="Null where it could never be asked.")


class Bridges(BaseModel):
    """This bridge and the others, the worst first."""

    headline: str
    bridges: list[BridgeInList]


@router.get("/bridges", include_in_schema=False)
def bridges_page(request: Request, site: AtSite, _: Reader) -> Response:
    """How all bridges are, and the way to each."""
    now, rows = utc_now(), _rows(request, site)
    return page(
        request,
        "bridges.html.j2",
        groups=groups(rows),
        rows=[(each, _facts(each, now)) for each in rows],
    )


@router.get(
    "/api/bridges",
    response_model=Bridges,
    summary="This bridge and the others that it knows",
)
def bridges(request: Request, site: AtSite, _: Reader) -> Any:
    """As `shm bridges --json` has them; what others said is at most some seconds old."""
    rows = _rows(request, site)
    return {"headline": headline(rows), "bridges": [row_document(each) for each in rows]}


@router.get(SUMMARY, response_model=Summary, summary="This bridge in a line")
def summary(site: AtSite, _: Reader) -> Summary:
    """What its home page says first; it does not ask other bridges."""
    return summary_of(site, utc_now())


def _rows(request: Request, site: Site) -> tuple[BridgeRow, ...]:
    asked = request.app.state.other_bridges
    assert isinstance(asked, OtherBridges)
    bridge = site.workspace.bridge
    others = asked.rows(bridge.other_bridges, site.workspace.folder)
    return worst_first((*own_row(site, utc_now()), *others))


def _facts(row: BridgeRow, now: datetime) -> str:
    """What is told small below a bridge's words."""
    found = row.summary
    if found is None or row.told_at is None:
        return ""
    latest = f"last test {told(now - found.latest_test_at)} ago" if found.latest_test_at else ""
    parts = (
        found.bridge if found.bridge != row.name else "",
        counted(found.hangers, "hanger"),
        latest or "no test yet",
        counted(found.open_alerts, "open alert") if found.open_alerts else "no open alert",
        f"{counted(found.held, 'recording')} held until you decide" if found.held else "",
    )
    return " · ".join(filter(None, parts))
