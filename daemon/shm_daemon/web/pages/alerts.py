"""The page of alerts: those that are open, then the others, some at a time."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response

from shm.store import AlertRow
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.address import test_page
from shm_daemon.web.alerts import alert_documents
from shm_daemon.web.frame import page
from shm_daemon.web.models import LARGEST_NUMBER
from shm_daemon.web.site import Site

router = APIRouter(include_in_schema=False)

_SHOWN = 50  # technical: alerts on a page, which links to older ones
_MARKS = {"delivered": "steady", "waiting": "watch", "given up": "alert", "not needed": "steady"}
Number = Annotated[int | None, Query(ge=0, le=LARGEST_NUMBER)]


@router.get("/alerts")
def alerts_page(
    request: Request,
    site: AtSite,
    _: Reader,
    hanger: Number = None,
    open_before: Number = None,
    noted_before: Number = None,
) -> Response:
    """Alerts of all hangers or of one, the newest first.

    `open_before` goes on among the open ones alone, `noted_before` among the others.
    """
    opened, older_open = _some(site, hanger, open_before, is_open=True)
    noted, older_noted = _some(site, hanger, noted_before, is_open=False)
    counts = site.store.alerts.open_counts()
    return page(
        request,
        "alerts.html.j2",
        opened=None if noted_before is not None else opened,
        noted=None if open_before is not None else noted,
        older_open=older_open,
        older_noted=older_noted,
        open_count=sum(counts.values()) if hanger is None else counts.get(hanger, 0),
        is_first=open_before is None and noted_before is None,
        hanger=hanger,
        has_hooks=bool(site.workspace.bridge.hooks),
        marks=_MARKS,
    )


def _some(
    site: Site, hanger: int | None, before: int | None, *, is_open: bool
) -> tuple[list[dict[str, Any]], int | None]:
    """Alerts as the page shows them, and the number to go on after, if there are more."""
    rows = site.store.alerts.list_rows(hanger, is_open=is_open, limit=_SHOWN + 1, before=before)
    shown = rows[:_SHOWN]
    documents = alert_documents(shown, site)
    older = shown[-1].id if len(rows) > _SHOWN else None
    return [
        {**document, "address": _address(each)}
        for each, document in zip(shown, documents, strict=True)
    ], older


def _address(alert: AlertRow) -> str | None:
    """An alert that only tries a hook is of no test."""
    if "held" in alert.kinds:  # what is held has no page of its own
        return "/operation#held"
    return None if "test" in alert.kinds else test_page(alert.hanger, alert.test)
