"""The store: one database, its verbs in repositories by what they are about."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Self

from sqlalchemy.engine import Engine

from shm.errors import NothingThere, StoreError
from shm.store import schema
from shm.store.alerts import Alerts, Silences
from shm.store.changed_settings import ChangedSettings
from shm.store.database import Database, copy_engine, is_server, make_engine
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

    copied: str = ""

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
    def open(cls, location: str | Path, *, or_copy: bool = False) -> Self:
        """An existing store, by file or URL; raises NothingThere, SchemaOutdated or StoreError.

        For one who only reads `or_copy` opens a copy in memory where the disk is full; `copied`
        says why.
        """
        _must_exist(location)
        try:
            return cls(_ready(make_engine(location), schema.check))
        except StoreError as error:
            if not or_copy or type(error) is not StoreError or is_server(location):
                raise
            with suppress(StoreError):
                store = cls(_ready(copy_engine(location), schema.check))
                store.copied = error.message
                return store
            raise

    @classmethod
    def create(cls, location: str | Path) -> Self:
        """Makes the tables where there are none, and opens the store."""
        return cls(_ready(make_engine(location), schema.upgrade))

    @staticmethod
    def upgrade(location: str | Path) -> None:
        """Brings an existing store to the present schema."""
        _must_exist(location)
        _ready(make_engine(location), schema.upgrade).dispose()

    def acting_as(self, actor: Actor) -> Self:
        """The same open store, where changes are noted as an actor's; not to be closed."""
        store = type(self)(acting_as(self.engine, actor))
        store.copied = self.copied
        return store

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


def _ready(engine: Engine, prepare: Callable[[Engine], None]) -> Engine:
    """The store's engine, once it is prepared; where that fails nothing stays open."""
    try:
        prepare(engine)
    except BaseException:
        engine.dispose()
        raise
    return engine
