"""Settings that the dashboard has changed: what holds of them instead of `bridge.toml`, and who
changed each when.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

import sqlalchemy as sa

from shm.store.audit import note
from shm.store.checksums import loads
from shm.store.database import Repository, insert
from shm.store.people_tables import changed_settings


@dataclass(frozen=True)
class ChangedSetting:
    """The value of a key of `bridge.toml` that holds instead of what the file says."""

    key: str
    value: object
    at: datetime
    who: str


class ChangedSettings(Repository):
    """Settings that the dashboard has changed; the newest row of a key holds."""

    def change(self, key: str, value: object, who: str, at: datetime) -> None:
        """Has `value` hold instead of what `bridge.toml` says; None gives the key back to it."""
        with self.writing() as connection:
            values = {"key": key, "document": value, "who": who, "at": at}
            insert(connection, changed_settings, values)
            detail = "back to bridge.toml" if value is None else str(value)
            note(connection, at, "setting changed", key.replace(".", " "), detail, who)

    def list_current(self) -> Mapping[str, ChangedSetting]:
        """What holds instead of `bridge.toml`, by its key."""
        newest = sa.select(sa.func.max(changed_settings.c.id)).group_by(changed_settings.c.key)
        query = sa.select(changed_settings).where(changed_settings.c.id.in_(newest))
        with self.reading() as connection:
            rows = connection.execute(query.order_by(changed_settings.c.key)).all()
        return {
            row.key: ChangedSetting(row.key, loads(row.document), row.at, row.who)
            for row in rows
            if row.document is not None
        }
