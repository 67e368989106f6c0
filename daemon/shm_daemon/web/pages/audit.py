"""The page of the audit log: who changed what, the newest first."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from shm.report import formatting
from shm.report.paper import Table
from shm_daemon.web.access import AtSite, Engineer
from shm_daemon.web.frame import page
from shm_daemon.web.models import LARGEST_NUMBER

router = APIRouter(include_in_schema=False)

_SHOWN = 100  # technical: changes on a page, which links to older ones


@router.get("/audit")
def audit_page(
    request: Request,
    site: AtSite,
    _: Engineer,
    before: Annotated[int | None, Query(ge=0, le=LARGEST_NUMBER)] = None,
) -> Response:
    """What people changed, by page, API or command line."""
    rows = site.store.audit.list_rows(_SHOWN + 1, before)
    shown = rows[:_SHOWN]
    table = Table(
        "Changes",
        ("time", "who", "by", "action", "of", "detail"),
        tuple(
            (formatting.moment(each.at), each.who, each.via, each.action, each.subject, each.detail)
            for each in shown
        ),
    )
    older = shown[-1].id if len(rows) > _SHOWN else None
    return page(request, "audit.html.j2", table=table, older=older, is_first=before is None)
