"""Alerts and who has seen them. An alert and what hooks are owed of it are one transaction."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Row

from shm.errors import NothingThere, UsageError
from shm.store.audit import note
from shm.store.database import insert
from shm.store.deliveries import Deliveries, alert_in
from shm.store.list_rows import AlertRow, DeliveryRow, EventKind, HangerEvent
from shm.store.outbox import (
    acknowledgement_of,
    raise_alert,
    resolution_of,
    resolve,
    stored_alert,
    stored_alerts,
)
from shm.store.rows import (
    Acknowledgement,
    DeliveryState,
    News,
    StoredAlert,
)
from shm.store.tables import (
    acknowledgements,
    adoptions,
    alerts,
    baselines,
    deliveries,
    resolutions,
)
from shm.values import Alert

_is_open = acknowledgements.c.id.is_(None) & resolutions.c.id.is_(None)
"""Of `stored_alerts`, and of whatever joins both tables: what `StoredAlert.is_open` says."""
_closed_at = sa.func.coalesce(acknowledgements.c.at, resolutions.c.at)


class Alerts(Deliveries):
    """Alerts and the outbox."""

    def list_all(
        self,
        hanger: int | None = None,
        baseline_id: int | None = None,
        *,
        standing: bool | None = None,
    ) -> tuple[StoredAlert, ...]:
        """Alerts as they were raised and acknowledged, the oldest first; of a hanger, against a
        baseline where these are named, and only those whose condition stands, or has ended, where
        `standing` tells.
        """
        query = stored_alerts.order_by(alerts.c.id)
        if standing is not None:
            query = query.where(resolutions.c.id.is_(None) == standing)
        if hanger is not None:
            query = query.where(alerts.c.hanger == hanger)
        if baseline_id is not None:
            query = query.where(alerts.c.baseline_id == baseline_id)
        with self.reading() as connection:
            return tuple(stored_alert(row) for row in connection.execute(query))

    def list_rows(
        self,
        hanger: int | None = None,
        *,
        is_open: bool | None = None,
        limit: int | None = None,
        before: int | None = None,
    ) -> tuple[AlertRow, ...]:
        """Alerts, the newest first; `before` is the number of the alert to go on after.

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
        return self._alert_rows(query.limit(limit))

    def row(self, alert_id: int) -> AlertRow:
        """One alert; raises NothingThere."""
        found = self._alert_rows(stored_alerts.where(alerts.c.id == alert_id))
        if not found:
            raise NothingThere(f"no alert {alert_id}.", remedy="See `shm alerts`.")
        return found[0]

    def resolve(self, alert_id: int, who: str, why: str, at: datetime) -> StoredAlert:
        """Notes that the condition of an alert ended, and acknowledges it where nobody has.

        Raises NothingThere where there is none of that number, UsageError where it is noted.
        """
        with self.writing() as connection:
            found = alert_in(connection, alert_id)
            if not resolve(connection, alert_id, who, why, at):
                raise UsageError(
                    f"alert {alert_id} is resolved already.", remedy="See `shm alerts`."
                )
            if found.acknowledgement is None:
                noted = Acknowledgement(alert_id, who, why, at)
                insert(connection, acknowledgements, vars(noted))
            note(connection, at, "alert resolved", _said_of(found), why, who)
            return alert_in(connection, alert_id)

    def settle(
        self, alert: Alert | None, hooks: Sequence[str], ended: Mapping[int, str], at: datetime
    ) -> None:
        """Ends alerts of these numbers, for these reasons, and raises one that no test's watch
        raises."""
        with self.writing() as connection:
            for alert_id, why in ended.items():
                resolve(connection, alert_id, "shm", why, at)
            if alert is not None:
                raise_alert(connection, None, None, alert, hooks, at)

    def acknowledge(self, alert_id: int, who: str, why: str, at: datetime) -> StoredAlert:
        """Notes that somebody has seen an alert to its end; the alert with that note.

        Raises NothingThere where there is none of that number, UsageError where it is noted.
        """
        with self.writing() as connection:
            alert = alert_in(connection, alert_id)
            if alert.acknowledgement is not None:
                raise UsageError(
                    f"alert {alert_id} was acknowledged by {alert.acknowledgement.who} on "
                    f"{alert.acknowledgement.at:%Y-%m-%d} already.",
                    remedy="See `shm alerts`.",
                )
            noted = Acknowledgement(alert_id, who, why, at)
            insert(connection, acknowledgements, vars(noted))
            note(connection, at, "alert acknowledged", _said_of(alert), why, who)
        return replace(alert, acknowledgement=noted)

    def counts(self) -> tuple[int, int]:
        """How many alerts are open, and how many were acknowledged."""
        with self.reading() as connection:
            noted = connection.scalar(sa.select(sa.func.count()).select_from(acknowledgements))
        return sum(self.open_counts().values()), int(noted or 0)

    def open_counts(self) -> dict[int, int]:
        """How many alerts of each hanger are open; hangers without any are left out.

        The only place where they are counted: whoever states a number of them asks here.
        """
        query = (
            sa.select(alerts.c.hanger, sa.func.count())
            .select_from(alerts)
            .outerjoin(acknowledgements, acknowledgements.c.alert_id == alerts.c.id)
            .outerjoin(resolutions, resolutions.c.alert_id == alerts.c.id)
        )
        with self.reading() as connection:
            rows = connection.execute(query.where(_is_open).group_by(alerts.c.hanger))
            return {row[0]: int(row[1]) for row in rows}

    def list_hanger_events(
        self, hanger: int, since: datetime | None = None
    ) -> tuple[HangerEvent, ...]:
        """What happened to a hanger beside its tests, by time."""
        with self.reading() as connection:
            found = [
                HangerEvent(row.at, kind, row.who or "", row.why or "", row.id)
                for kind, query in _events(hanger).items()
                for row in connection.execute(query)
            ]
        late = (event for event in found if since is None or event.at >= since)
        return tuple(sorted(late, key=lambda event: event.at))

    def _alert_rows(self, query: sa.Select[Any]) -> tuple[AlertRow, ...]:
        with self.reading() as connection:
            rows = connection.execute(query).all()
            owed = _deliveries_of(connection, query)
        return tuple(_row(row, tuple(owed[row.id])) for row in rows)


def _is_after(alert_id: int, *, is_open: bool | None) -> sa.ColumnElement[bool]:
    """Which alerts stand after one in a list of `list_rows`."""
    older = alerts.c.id < alert_id
    if is_open is not False:
        return older
    tables = alerts.outerjoin(acknowledgements, acknowledgements.c.alert_id == alerts.c.id)
    tables = tables.outerjoin(resolutions, resolutions.c.alert_id == alerts.c.id)
    at = sa.select(_closed_at).select_from(tables).where(alerts.c.id == alert_id)
    of_one = at.correlate(None).scalar_subquery()
    return (_closed_at < of_one) | ((_closed_at == of_one) & older)


def _deliveries_of(
    connection: Connection, chosen: sa.Select[Any]
) -> defaultdict[int, list[DeliveryRow]]:
    """Of the alerts that are chosen, by alert."""
    ids = sa.select(chosen.subquery().c.id)
    query = sa.select(deliveries).where(deliveries.c.alert_id.in_(ids)).order_by(deliveries.c.id)
    found = defaultdict[int, list[DeliveryRow]](list)
    for row in connection.execute(query):
        one = DeliveryRow(
            row.hook, DeliveryState(row.state), row.attempts, row.last_error, News(row.news)
        )
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
        resolution=resolution_of(row),
    )


def _events(hanger: int) -> dict[EventKind, sa.Select[Any]]:
    noted = sa.select(acknowledgements).join(alerts).where(alerts.c.hanger == hanger)
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
        EventKind.ACKNOWLEDGED: noted,
    }


def _of(hanger: int, table: sa.Table, query: sa.Select[Any]) -> sa.Select[Any]:
    return query.where(table.c.hanger == hanger).order_by(table.c.id)


def _named(table: sa.Table, at: str, who: str, why: str) -> sa.Select[Any]:
    named = {"at": at, "who": who, "why": why}
    return sa.select(table.c.id, *(table.c[name].label(label) for label, name in named.items()))


def _said_of(stored: StoredAlert) -> str:
    return f"alert {stored.id}, hanger {stored.alert.hanger}"
