"""Alerts for those who look: page by page, with what became of their deliveries."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere
from shm.store.database import Database
from shm.store.glances import AlertRow, DeliveryRow
from shm.store.rows import DeliveryState
from shm.store.tables import acknowledgements, alerts, deliveries
from shm.store.watching import acknowledgement_of, stored_alert, stored_alerts


class AlertRows(Database):
    """The part of the store that lists alerts."""

    def alert_rows(
        self,
        hanger: int | None = None,
        *,
        is_open: bool | None = None,
        limit: int | None = None,
        before: int | None = None,
    ) -> tuple[AlertRow, ...]:
        """Alerts, the newest first; `before` is the number of the alert to go on after.

        Only those that are open, or acknowledged, where `is_open` tells; acknowledged ones come
        in the order in which they were, the latest first.
        """
        place = acknowledgements.c.id if is_open is False else alerts.c.id
        query = stored_alerts.order_by(place.desc())
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        if is_open is not None:
            query = query.where(acknowledgements.c.id.is_(None) == is_open)
        if before is not None:
            query = query.where(place < _place(before, is_open))
        return self._alert_rows(query.limit(limit))

    def alert_row(self, alert_id: int) -> AlertRow:
        """One alert; raises NothingThere."""
        found = self._alert_rows(stored_alerts.where(alerts.c.id == alert_id))
        if not found:
            raise NothingThere(f"no alert {alert_id}.", remedy="See `shm alerts`.")
        return found[0]

    def _alert_rows(self, query: sa.Select[Any]) -> tuple[AlertRow, ...]:
        with self.reading() as connection:
            rows = connection.execute(query).all()
            owed = _deliveries(connection, query)
        return tuple(_row(row, tuple(owed[row.id])) for row in rows)


def _place(alert_id: int, is_open: bool | None) -> Any:
    if is_open is not False:
        return alert_id
    noted = sa.select(acknowledgements.c.id).where(acknowledgements.c.alert_id == alert_id)
    return noted.scalar_subquery()


def _deliveries(
    connection: Connection, chosen: sa.Select[Any]
) -> defaultdict[int, list[DeliveryRow]]:
    """Of the alerts that are chosen, by alert."""
    ids = sa.select(chosen.subquery().c.id)
    query = sa.select(deliveries).where(deliveries.c.alert_id.in_(ids)).order_by(deliveries.c.id)
    found = defaultdict[int, list[DeliveryRow]](list)
    for row in connection.execute(query):
        one = DeliveryRow(row.hook, DeliveryState(row.state), row.attempts, row.last_error)
        found[row.alert_id].append(one)
    return found


def _row(row: Row[Any], owed: tuple[DeliveryRow, ...]) -> AlertRow:
    alert = stored_alert(row).alert
    return AlertRow(
        id=row.id,
        hanger=row.hanger,
        raised_at=row.raised_at,
        test=alert.test,
        test_time=row.time,
        kinds=alert.kinds,
        message=alert.message,
        acknowledgement=acknowledgement_of(row),
        deliveries=owed,
    )
