"""Read alerts, their deliveries and the events of a hanger for pages and `shm status`."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import sqlalchemy as sa

from shm.store.database import Repository
from shm.store.outbox import stored_alert, stored_alerts
from shm.store.rows import DeliveryState, EventKind, HangerEvent, StoredAlert, sum_counts
from shm.store.tables import adoptions, alerts, baselines, deliveries

_is_open = alerts.c.noted_at.is_(None) & alerts.c.ended_at.is_(None)
_closed_at = sa.func.coalesce(alerts.c.noted_at, alerts.c.ended_at)


def list_alert_page(
    store: Repository,
    hanger: int | None = None,
    *,
    is_open: bool | None = None,
    limit: int | None = None,
    before: int | None = None,
) -> tuple[StoredAlert, ...]:
    """List alerts, the newest first; `before` is the number of the alert to go on after.

    Only those that are open, or that are acknowledged or resolved, where `is_open` tells; the
    latter come in the order in which they were, the latest first.
    """
    query = stored_alerts
    if is_open is False:
        query = query.order_by(_closed_at.desc())
    query = query.order_by(alerts.c.id.desc())
    if hanger is not None:
        query = query.where(alerts.c.hanger == hanger)
    if is_open is not None:
        query = query.where(_is_open if is_open else sa.not_(_is_open))
    if before is not None:
        query = query.where(_is_after(before, is_open=is_open))
    return tuple(stored_alert(row) for row in store.rows(query.limit(limit)))


def count_alerts(store: Repository) -> tuple[int, int]:
    """Count the open and the acknowledged alerts."""
    noted = store.scalar(sa.select(sa.func.count(alerts.c.noted_at)))
    return sum(count_open_alerts(store).values()), int(noted or 0)


def count_open_alerts(store: Repository) -> dict[int, int]:
    """Count the open alerts of each hanger; hangers without any are left out.

    The only place where they are counted: whoever states a number of them asks here.
    """
    query = sa.select(alerts.c.hanger, sa.func.count())
    rows = store.rows(query.where(_is_open).group_by(alerts.c.hanger))
    return {row[0]: int(row[1]) for row in rows}


def list_hanger_events(
    store: Repository, hanger: int, since: datetime | None = None
) -> tuple[HangerEvent, ...]:
    """List the events of a hanger other than its tests, by time."""
    with store.reading() as connection:
        found = [
            HangerEvent(row.at, kind, row.who or "", row.why or "", row.id)
            for kind, query in _events(hanger).items()
            for row in connection.execute(query)
        ]
    late = (event for event in found if since is None or event.at >= since)
    return tuple(sorted(late, key=lambda event: event.at))


def count_deliveries(store: Repository) -> dict[str, int]:
    """Count the deliveries in each state; see `sum_counts`."""
    query = sa.select(sa.type_coerce(deliveries.c.state, sa.Text), sa.func.count()).group_by(
        deliveries.c.state
    )
    return sum_counts(DeliveryState, store.rows(query))


def _events(hanger: int) -> dict[EventKind, sa.Select[Any]]:
    noted = _named(alerts, "noted_at", "noted_who", "noted_why")
    undone = _named(adoptions, "undone_at", "undone_who", "undone_why")
    raised = sa.select(
        alerts.c.id,
        alerts.c.time.label("at"),
        sa.null().label("who"),
        alerts.c.message.label("why"),
    )
    return {
        EventKind.BASELINE: _of(hanger, baselines, _named(baselines, "set_at", "who", "why")),
        EventKind.ADOPTED: _of(hanger, adoptions, _named(adoptions, "adopted_at", "who", "why")),
        EventKind.UNDONE: _of(hanger, adoptions, undone.where(adoptions.c.undone_at.is_not(None))),
        EventKind.ALERT: _of(hanger, alerts, raised),
        EventKind.ACKNOWLEDGED: _of(hanger, alerts, noted.where(alerts.c.noted_at.is_not(None))),
    }


def _is_after(alert_id: int, *, is_open: bool | None) -> sa.ColumnElement[bool]:
    """Select the alerts after one in a list of `list_alert_page`."""
    older = alerts.c.id < alert_id
    if is_open is not False:
        return older
    one = alerts.alias()
    closed_at = sa.func.coalesce(one.c.noted_at, one.c.ended_at)
    of_one = sa.select(closed_at).where(one.c.id == alert_id).scalar_subquery()
    return (_closed_at < of_one) | ((_closed_at == of_one) & older)


def _named(table: sa.Table, at: str, who: str, why: str) -> sa.Select[Any]:
    named = {"at": at, "who": who, "why": why}
    return sa.select(table.c.id, *(table.c[name].label(label) for label, name in named.items()))


def _of(hanger: int, table: sa.Table, query: sa.Select[Any]) -> sa.Select[Any]:
    return query.where(table.c.hanger == hanger).order_by(table.c.id)
