"""Alerts over HTTP: listed, and taken note of."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query

from shm.pipeline import utc_now
from shm.store import Delivery, Store, StoredAlert
from shm_daemon.web.access import AtSite, Reader, Writer
from shm_daemon.web.faults import answers
from shm_daemon.web.models import Acknowledge, Alerts, AlertState

router = APIRouter(prefix="/api/alerts", tags=["alerts"])
_LARGEST = 2**31 - 1


@router.get(
    "",
    response_model=Alerts,
    responses=answers(400, 401, 403, 422, 503),
    summary="Alerts that were raised",
)
def alerts(
    site: AtSite,
    _: Reader,
    hanger: Annotated[int | None, Query(ge=0, le=_LARGEST)] = None,
    open: Annotated[bool, Query(description="Only those nobody has acknowledged.")] = False,
) -> Any:
    """All alerts, the oldest first, with their deliveries."""
    found = site.store.alerts(hanger)
    chosen = [alert for alert in found if alert.acknowledgement is None or not open]
    return {"alerts": alert_rows(site.store, chosen)}


@router.post(
    "/{alert_id}/acknowledgement",
    response_model=AlertState,
    responses=answers(400, 401, 403, 404, 409, 422, 503),
    summary="Take note of an alert",
)
def acknowledge(
    site: AtSite,
    writer: Writer,
    alert_id: Annotated[int, Path(ge=0, le=_LARGEST)],
    told: Acknowledge,
) -> Any:
    """Notes on the record that somebody has seen an alert to its end: once an alert."""
    who = writer.name if told.who is None else f"{told.who} (token {writer.name})"
    noted = site.store.acknowledge(alert_id, who, told.why, utc_now())
    return alert_rows(site.store, [noted])[0]


def alert_rows(store: Store, alerts: Sequence[StoredAlert]) -> list[dict[str, Any]]:
    """Alerts as documents, with what became of their deliveries."""
    deliveries = defaultdict(list)
    for each in store.deliveries() if alerts else ():
        deliveries[each.alert.key].append(each)
    return [_row(alert, deliveries[alert.alert.key]) for alert in alerts]


def _row(stored: StoredAlert, deliveries: Sequence[Delivery]) -> dict[str, Any]:
    noted, alert = stored.acknowledgement, stored.alert
    return {
        "id": stored.id,
        "hanger": alert.hanger,
        "raised_at": stored.raised_at,
        "test": alert.test,
        "test_at": alert.time,
        "kinds": list(alert.kinds),
        "message": alert.message,
        "acknowledged": None
        if noted is None
        else {"who": noted.who, "why": noted.why, "at": noted.at},
        "deliveries": [
            {
                "hook": each.hook,
                "state": each.state.value,
                "attempts": each.attempts,
                "last_error": each.last_error,
            }
            for each in deliveries
        ],
    }
