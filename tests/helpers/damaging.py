"""Changes bytes of a store behind its back, as a disk does: no checksum is told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sqlalchemy as sa

from shm.store import Workspace
from shm.store.checksums import plain_table
from shm.store.database import make_engine, writing


def damage(workspace: Workspace, table: str, column: str, id_: int) -> None:
    """Flips one bit in the middle of a value of a row."""
    change(workspace.location, table, column, id_, flipped)


def change(location: Any, table: str, column: str, id_: int, altered: Callable[[Any], Any]) -> None:
    """Puts `altered` of a value of a row in its place."""
    plain, engine = plain_table(table), make_engine(location)
    key = "posterior_id" if table == "summaries" else "id"
    with writing(engine) as connection:
        here = plain.c[key] == id_
        value = connection.scalar(sa.select(plain.c[column]).where(here))
        connection.execute(sa.update(plain).where(here).values({column: altered(value)}))
    engine.dispose()


def flipped(value: Any) -> Any:
    """A value with one bit flipped."""
    if isinstance(value, str):
        if not value:
            return "?"
        middle = next((k for k in range(len(value) // 2, len(value)) if value[k].isalnum()), 0)
        other = "0" if value[middle] != "0" else "1"
        return value[:middle] + other + value[middle + 1 :]
    if isinstance(value, bytes | memoryview):
        content = bytearray(value)
        content[len(content) // 2] ^= 4
        return bytes(content)
    return value + 1
