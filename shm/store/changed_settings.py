"""Settings that a page has changed: they hold instead of what `bridge.toml` says."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime

import sqlalchemy as sa
from sqlalchemy.engine import Connection

from shm.errors import UsageError
from shm.store.columns import value_in
from shm.store.database import Repository, insert
from shm.store.journal import note
from shm.store.rows import ChangedSetting, value_text
from shm.store.tables import changed_settings


class ChangedSettings(Repository):
    """Settings that the dashboard has changed; the newest row of a key holds."""

    def change(
        self,
        key: str,
        value: float | str | None,
        who: str,
        at: datetime,
        *,
        based_on: int | None = None,
        in_file: str = "not set",
    ) -> None:
        """Has `value` hold instead of what `bridge.toml` says (`in_file`); None gives the key back,
        an empty text says that there is none.

        `based_on` is the number of the change that was in force when this was decided, 0 for the
        file; raises UsageError where another is in force by now.
        """
        with self.writing() as connection:
            current = _current(connection, changed_settings.c.key == key).get(key)
            if based_on not in (None, current.id if current else 0):
                raise _overtaken(key, current, value, in_file)
            values = {"key": key, "document": value, "who": who, "at": at}
            insert(connection, changed_settings, values)
            before = in_file if current is None else value_text(current.value)
            after = f"{in_file}, back to bridge.toml" if value is None else value_text(value)
            detail = f"from {before} to {after}"
            note(connection, at, "setting changed", key.replace(".", " "), detail, who)

    def newest(self) -> int:
        """The number of the last change; 0 where there was none."""
        return self.scalar(sa.select(sa.func.max(changed_settings.c.id))) or 0

    def list_current(self) -> Mapping[str, ChangedSetting]:
        """Return what holds instead of `bridge.toml`, by its key."""
        with self.reading() as connection:
            return _current(connection)


def _current(connection: Connection, *which: sa.ColumnElement[bool]) -> dict[str, ChangedSetting]:
    newest = sa.select(sa.func.max(changed_settings.c.id)).group_by(changed_settings.c.key)
    query = sa.select(changed_settings).where(changed_settings.c.id.in_(newest), *which)
    rows = connection.execute(query.order_by(changed_settings.c.key)).all()
    changed = (value_in(row, ChangedSetting, value=row.document) for row in rows)
    return {each.key: each for each in changed if each.value is not None}


def _overtaken(
    key: str, current: ChangedSetting | None, wanted: float | str | None, in_file: str
) -> UsageError:
    yours = "" if wanted is None else f", {value_text(wanted)},"
    found = f"back at {in_file}, as in bridge.toml"
    if current is not None:
        found = (
            f"{value_text(current.value)}, set by {current.who} at {current.at:%Y-%m-%d %H:%M} UTC"
        )
    return UsageError(
        f"{key.replace('.', ' ')} was changed since you opened the page: it is {found}.",
        remedy=f"Your change{yours} was not saved: make it again if it should still hold.",
    )
