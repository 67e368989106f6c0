"""Verbs by which a person answers the watch: takes note of an alert, sets a baseline anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

from sqlalchemy.engine import Connection

from shm.errors import NothingThere, StoreBusy, UsageError
from shm.store.database import Database, insert
from shm.store.queries import baseline_in_force
from shm.store.results import insert_baseline, insert_posterior
from shm.store.rows import Acknowledgement, Baseline, Lineage, StoredAlert, StoredTest
from shm.store.tables import acknowledgements, alerts
from shm.store.watching import stored_alert, stored_alerts
from shm.values import Posterior


class Acknowledging(Database):
    """The part of the store that keeps what people made of the watch."""

    def acknowledge(self, alert_id: int, who: str, why: str, at: datetime) -> StoredAlert:
        """Notes that somebody has seen an alert to its end; the alert with that note.

        Raises NothingThere where there is none of that number, UsageError where it is noted.
        """
        with self.writing() as connection:
            by_id = stored_alerts.where(alerts.c.id == alert_id)
            row = connection.execute(by_id).one_or_none()
            if row is None:
                raise NothingThere(f"no alert {alert_id}.", remedy="See `shm alerts`.")
            alert = stored_alert(row)
            if alert.acknowledgement is not None:
                raise UsageError(
                    f"alert {alert_id} was acknowledged by {alert.acknowledgement.who} on "
                    f"{alert.acknowledgement.at:%Y-%m-%d} already.",
                    remedy="See `shm alerts`.",
                )
            noted = Acknowledgement(alert_id, who, why, at)
            insert(connection, acknowledgements, vars(noted))
        return replace(alert, acknowledgement=noted)

    def rebaseline(
        self,
        before: Baseline,
        posterior: Posterior,
        chosen: Sequence[StoredTest],
        record: tuple[str, str, datetime],
        lineage: Lineage,
        at: datetime,
    ) -> Baseline:
        """Has later tests compared with `posterior`, of the tests `chosen`, from now on.

        `record` is who, why, and the time since which those tests were taken. What was compared
        with the baseline `before` stays. Raises StoreBusy where that one is no longer in force.
        """
        (who, why, since), hanger = record, before.hanger
        with self.writing() as connection:
            _refuse_late(connection, before)
            number = insert_posterior(connection, hanger, posterior, chosen, lineage, at)
            id_ = insert_baseline(connection, hanger, number, who, why, at, since)
        return Baseline(id_, hanger, posterior, at, who, why, since)


def _refuse_late(connection: Connection, before: Baseline) -> None:
    """An adoption, its undoing or another baseline may have come in between."""
    if connection.scalar(baseline_in_force(before.hanger)) != before.id:
        raise StoreBusy(
            f"hanger {before.hanger} has another baseline by now.",
            remedy="Try again.",
            retry_after_s=0.0,
        )
