"""Settings that the dashboard has changed: what holds of them instead of `bridge.toml`, and who
changed each when.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import sqlalchemy as sa

from shm.store.audit import note
from shm.store.checksums import decoding, loads, readable
from shm.store.database import Repository, insert
from shm.store.people_tables import changed_settings


@dataclass(frozen=True)
class ChangedSetting:
    """The value of a key of `bridge.toml` that holds instead of what the file says."""

    key: str
    value: float
    at: datetime
    who: str

    def __str__(self) -> str:
        value, by = f"{self.value:.10g}", f"{self.who} on {self.at:%Y-%m-%d}"
        return f"{self.key.replace('.', ' ')} = {value} instead of what bridge.toml says, by {by}"

    def is_of(self, hanger: int) -> bool:
        """Whether it changes a hanger, or all of them."""
        return self.key.startswith(("settings.", f"hanger.{hanger}."))


class ChangedSettings(Repository):
    """Settings that the dashboard has changed; the newest row of a key holds."""

    def change(self, key: str, value: float | None, who: str, at: datetime) -> None:
        """Has `value` hold instead of what `bridge.toml` says; None gives the key back to it."""
        with self.writing() as connection:
            values = {"key": key, "document": value, "who": who, "at": at}
            insert(connection, changed_settings, values)
            detail = "back to bridge.toml" if value is None else f"{value:.10g}"
            note(connection, at, "setting changed", key.replace(".", " "), detail, who)

    def newest(self) -> int:
        """The number of the last change; 0 where there was none."""
        with self.reading() as connection:
            return connection.scalar(sa.select(sa.func.max(changed_settings.c.id))) or 0

    def list_current(self) -> Mapping[str, ChangedSetting]:
        """What holds instead of `bridge.toml`, by its key."""
        newest = sa.select(sa.func.max(changed_settings.c.id)).group_by(changed_settings.c.key)
        query = sa.select(changed_settings).where(changed_settings.c.id.in_(newest))
        with self.reading() as connection:
            rows = connection.execute(query.order_by(changed_settings.c.key)).all()
        return {each.key: each for each in readable(rows, _changed) if each.value is not None}


def _changed(row: sa.Row[Any]) -> ChangedSetting:
    with decoding(changed_settings, row):
        return ChangedSetting(row.key, loads(row.document), row.at, row.who)
