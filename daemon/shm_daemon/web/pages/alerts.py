"""The page of alerts: those that nobody has acknowledged, and the latest of the others."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from shm.store import StoredAlert
from shm_daemon.web.access import AtSite, Reader
from shm_daemon.web.alerts import alert_rows
from shm_daemon.web.frame import page
from shm_daemon.web.test_address import test_page

router = APIRouter(include_in_schema=False)

_SHOWN = 50
_MARKS = {"delivered": "steady", "waiting": "watch", "given up": "alert"}


@router.get("/alerts")
def alerts_page(
    request: Request, site: AtSite, _: Reader, hanger: int | None = None, all: bool = False
) -> Response:
    """Alerts of all hangers or of one, the newest first."""
    found = list(reversed(site.store.alerts(hanger)))
    opened = [each for each in found if each.acknowledgement is None]
    noted = sorted((each for each in found if each.acknowledgement), key=_noted_at, reverse=True)
    shown = noted if all else noted[:_SHOWN]
    rows = [_with_address(row) for row in alert_rows(site.store, [*opened, *shown])]
    return page(
        request,
        "alerts.html.j2",
        opened=rows[: len(opened)],
        noted=rows[len(opened) :],
        left_out=len(noted) - len(shown),
        hanger=hanger,
        has_hooks=bool(site.workspace.bridge.hooks),
        marks=_MARKS,
    )


def _noted_at(alert: StoredAlert) -> Any:
    assert alert.acknowledgement is not None
    return alert.acknowledgement.at


def _with_address(row: dict[str, Any]) -> dict[str, Any]:
    """An alert that only tries a hook is of no test."""
    is_trial = "test" in row["kinds"]
    address = None if is_trial else test_page(row["hanger"], row["test"])
    return {**row, "address": address}
