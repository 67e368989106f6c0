"""An alert and what is owed of it to hooks, written within the caller's transaction."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.documents import alert_document
from shm.store.database import insert
from shm.store.rows import DeliveryState, StoredAlert
from shm.store.tables import alerts, deliveries
from shm.values import Alert


def raise_alert(
    connection: Connection,
    test_id: int,
    baseline_id: int | None,
    alert: Alert,
    hooks: Sequence[str],
    at: datetime,
) -> StoredAlert | None:
    """Keeps an alert and what is owed to each hook; None where one of its key was raised before."""
    known = sa.select(alerts.c.id).where(alerts.c.key == alert.key)
    if connection.execute(known).first() is not None:
        return None
    values = {
        **{name: getattr(alert, name) for name in ("key", "hanger", "time", "message")},
        "test_id": test_id,
        "baseline_id": baseline_id,
        "raised_at": at,
        # Names its hooks, so that a delivery that is gone is missed.
        "document": {**alert_document(alert), "hooks": list(hooks)},
    }
    alert_id = insert(connection, alerts, values)
    for hook in hooks:
        insert(connection, deliveries, _owed(alert_id, hook, at))
    return StoredAlert(alert_id, alert, at)


def _owed(alert_id: int, hook: str, at: datetime) -> dict[str, Any]:
    return {
        "alert_id": alert_id,
        "hook": hook,
        "state": DeliveryState.WAITING,
        "attempts": 0,
        "next_attempt_at": at,
        "last_error": "",
    }
