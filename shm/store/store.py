"""The store: one class whose verbs are grouped by what they are about."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from sqlalchemy.engine import Engine

from shm.errors import NothingThere
from shm.store import schema
from shm.store.acknowledging import Acknowledging
from shm.store.adopting import Adopting
from shm.store.alert_rows import AlertRows
from shm.store.archive_copies import ArchiveCopies
from shm.store.damage import Damage
from shm.store.database import make_engine
from shm.store.holding import Holding
from shm.store.listing import Listing
from shm.store.measuring import Measuring
from shm.store.naming import Naming
from shm.store.receiving import Receiving
from shm.store.results import Results
from shm.store.stepping import Stepping
from shm.store.superseding import Superseding
from shm.store.tokens import Tokens
from shm.store.trends import Trends
from shm.store.upkeep import Upkeep
from shm.store.withdrawing import Withdrawing


class Store(
    Receiving,
    Results,
    Holding,
    Listing,
    AlertRows,
    Trends,
    Acknowledging,
    Adopting,
    Stepping,
    Superseding,
    Withdrawing,
    Naming,
    Measuring,
    Tokens,
    ArchiveCopies,
    Upkeep,
    Damage,
):
    """Keeps every noun of the flow. Open it with `Store.open`; close it, or use it in a `with`."""

    @classmethod
    def open(cls, location: str | Path) -> Self:
        """An existing store, by file or URL; raises NothingThere, SchemaOutdated or StoreError."""
        _must_exist(location)
        return cls(_ready(location, schema.check))

    @classmethod
    def create(cls, location: str | Path) -> Self:
        """Makes the tables where there are none, and opens the store."""
        return cls(_ready(location, schema.upgrade))

    @staticmethod
    def upgrade(location: str | Path) -> None:
        """Brings an existing store to the present schema."""
        _must_exist(location)
        _ready(location, schema.upgrade).dispose()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _must_exist(location: str | Path) -> None:
    if "://" not in str(location) and not Path(location).is_file():
        raise NothingThere(
            f"there is no store at {location}.",
            remedy="Bring it back with `shm db restore BACKUP`, or make the workspace anew: "
            "`shm init DIR --from bridge.toml`.",
        )


def _ready(location: str | Path, prepare: Callable[[Engine], None]) -> Engine:
    """The store's engine, once it is prepared; where that fails nothing stays open."""
    engine = make_engine(location)
    try:
        prepare(engine)
    except BaseException:
        engine.dispose()
        raise
    return engine
