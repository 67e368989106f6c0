"""Rows of alerts and what is owed of them to hooks, within the caller's transaction."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import lru_cache
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.documents import alert_document, value_of
from shm.errors import DamagedRow
from shm.store.checksums import decoding, loads, note_damage
from shm.store.database import insert
from shm.store.rows import Acknowledgement, DeliveryState, News, Resolution, StoredAlert
from shm.store.tables import acknowledgements, alerts, deliveries, resolutions, tests
from shm.values import Alert

_HELD = 1024  # technical: those that stand on a large bridge, of some kilobytes each

stored_alerts = sa.select(
    alerts,
    tests.c.name.label("test"),
    *(acknowledgements.c[name].label(f"ack_{name}") for name in ("who", "why", "at")),
    *(resolutions.c[name].label(f"end_{name}") for name in ("who", "why", "at")),
).select_from(
    alerts.outerjoin(acknowledgements)
    .outerjoin(resolutions, resolutions.c.alert_id == alerts.c.id)
    .outerjoin(tests, tests.c.id == alerts.c.test_id)
)


def raise_alert(
    connection: Connection,
    test_id: int | None,
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
        insert(connection, deliveries, _owed(alert_id, hook, News.RAISED, at))
    return StoredAlert(alert_id, alert, at, baseline_id=baseline_id)


def resolve(connection: Connection, alert_id: int, who: str, why: str, at: datetime) -> bool:
    """Notes that the condition of an alert ended; False where that is noted already.

    Each hook that was told of the alert is owed that news.
    """
    known = sa.select(resolutions.c.id).where(resolutions.c.alert_id == alert_id)
    if connection.execute(known).first() is not None:
        return False
    insert(connection, resolutions, vars(Resolution(alert_id, who, why, at)))
    told = sa.select(deliveries.c.hook).where(
        deliveries.c.alert_id == alert_id,
        deliveries.c.news == News.RAISED,
        deliveries.c.state == DeliveryState.DELIVERED,
    )
    for hook in connection.scalars(told.order_by(deliveries.c.id)).all():
        insert(connection, deliveries, _owed(alert_id, hook, News.RESOLVED, at))
    return True


def owe_resolution(connection: Connection, alert_id: int, hook: str, at: datetime) -> None:
    """A hook that was told of an alert after its condition ended is owed that news too."""
    ended = sa.select(resolutions.c.id).where(resolutions.c.alert_id == alert_id)
    owed = sa.select(deliveries.c.id).where(
        deliveries.c.alert_id == alert_id,
        deliveries.c.hook == hook,
        deliveries.c.news == News.RESOLVED,
    )
    if connection.execute(ended).first() and connection.execute(owed).first() is None:
        insert(connection, deliveries, _owed(alert_id, hook, News.RESOLVED, at))


def _owed(alert_id: int, hook: str, news: News, at: datetime) -> dict[str, Any]:
    return {
        "alert_id": alert_id,
        "hook": hook,
        "news": news,
        "state": DeliveryState.WAITING,
        "attempts": 0,
        "next_attempt_at": at,
        "last_error": "",
    }


def stored_alert(row: Row[Any]) -> StoredAlert:
    """An alert and its acknowledgement, of a row of `stored_alerts`."""
    return StoredAlert(
        row.id,
        alert_of(row),
        row.raised_at,
        acknowledgement_of(row),
        resolution_of(row),
        row.baseline_id,
    )


@lru_cache(_HELD)
def _alert_in(text: str) -> Alert:
    """An alert as it was raised; those that stand are asked for again and again."""
    return value_of(Alert, loads(text))


def alert_of(row: Row[Any]) -> Alert:
    """An alert that was raised is told even where its document is damaged: as much as is left."""
    try:
        with decoding(alerts, row, row.hanger):
            return _alert_in(row.document)
    except DamagedRow as error:
        note_damage(error)
        message = f"{row.message} (Details are lost: {error.message})"
        return Alert(row.key, row.hanger, row.test or "", row.time, message, ())


def acknowledgement_of(row: Row[Any]) -> Acknowledgement | None:
    """Who took note of an alert, of a row of `stored_alerts`; None while it is open."""
    if row.ack_at is None:
        return None
    return Acknowledgement(row.id, row.ack_who, row.ack_why, row.ack_at)


def resolution_of(row: Row[Any]) -> Resolution | None:
    """How the condition of an alert ended, of a row of `stored_alerts`; None while it stands."""
    if row.end_at is None:
        return None
    return Resolution(row.id, row.end_who, row.end_why, row.end_at)
