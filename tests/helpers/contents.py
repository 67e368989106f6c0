"""What a store holds, table by table, for tests of copies."""

from __future__ import annotations

from shm.store import Store
from shm.store.backups import TableContent, contents


def quiet(_label: str, _fraction: float) -> None:
    """Nobody watches."""


def held(store: Store) -> tuple[TableContent, ...]:
    with store.reading() as connection:
        return contents(connection, quiet)
