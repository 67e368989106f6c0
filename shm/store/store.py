"""The store: one database, its verbs in repositories by what they are about."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Self

from sqlalchemy.engine import Engine

from shm.errors import NothingThere
from shm.store import schema
from shm.store.alerts import Alerts, Silences
from shm.store.changed_settings import ChangedSettings
from shm.store.database import Database, make_engine
from shm.store.journal import Actor, Journal, acting_as
from shm.store.notes import Notes
from shm.store.people import People
from shm.store.posteriors import Posteriors
from shm.store.recordings import Recordings
from shm.store.streams import Streams
from shm.store.tests import Tests
from shm.store.upkeep import Upkeep
from shm.store.watch import Watch


class Store(Database):
    """Keeps every noun of the flow. Open it with `Store.open`; close it, or use it in a `with`.

    `recordings` are the received files, how far each has come and what people decided of it;
    `tests` what was identified from them; `posteriors` what was computed from tests, with
    selections, diagnoses and adoptions; `watch` what it said after each test, and its baselines;
    `alerts` those that were raised, and their deliveries; `silences` when no hook is told;
    `streams` what permanent sensors said; `people` who signs in by name; `notes` what they saw or
    did; `journal` what happened, and who changed what; `settings` what the dashboard says beside
    `bridge.toml`; `upkeep` tokens, copies of raw files and backups.
    """

    def __init__(self, engine: Engine):
        super().__init__(engine)
        self.recordings = Recordings(engine)
        self.tests = Tests(engine)
        self.posteriors = Posteriors(engine)
        self.watch = Watch(engine)
        self.alerts = Alerts(engine)
        self.silences = Silences(engine)
        self.streams = Streams(engine)
        self.people = People(engine)
        self.notes = Notes(engine)
        self.journal = Journal(engine)
        self.settings = ChangedSettings(engine)
        self.upkeep = Upkeep(engine)

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

    def acting_as(self, actor: Actor) -> Self:
        """The same open store, where changes are noted as an actor's; not to be closed."""
        return type(self)(acting_as(self.engine, actor))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
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
