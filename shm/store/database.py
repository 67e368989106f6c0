"""The engine, its transactions, and what its errors mean."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

from shm.errors import StoreBusy, StoreError

BUSY_SECONDS = 10.0


@dataclass(frozen=True)
class Fault:
    """A fragment of a database's message, what it means, and when trying again may help."""

    fragment: str
    message: str
    remedy: str
    retry_after_s: float | None
    error: type[StoreError] = StoreError


FAULTS = (
    Fault("is locked", "is held by another process", "Try again.", 1.0, StoreBusy),
    Fault("disk is full", "cannot grow: the disk is full", "Free some space.", 60.0),
    Fault("readonly", "cannot be written", "Give this user write access to it.", 60.0),
    Fault("disk i/o", "cannot be read or written", "Check the disk.", 60.0),
    Fault("unable to open", "cannot be opened", "Check its path and permissions.", None),
    Fault("not a database", "is not a database", "Restore it from a backup.", None),
    Fault("malformed", "is damaged", "Restore it from a backup.", None),
)


def make_engine(location: str | Path) -> Engine:
    """The engine of a database file or URL; SQLite in the manner the daemon needs it.

    Raises StoreError where no driver for the URL is installed.
    """
    url = str(location) if "://" in str(location) else f"sqlite:///{location}"
    try:
        engine = sa.create_engine(url)
    except (ImportError, sa.exc.ArgumentError) as error:
        scheme = url.partition("://")[0]
        raise StoreError(
            f"no driver for a store of kind {scheme}: {error}.", remedy="Use a file name."
        ) from error
    if engine.dialect.name == "sqlite":
        sa.event.listen(engine, "connect", _configure_sqlite)
        sa.event.listen(engine, "begin", _begin_sqlite)
    return engine


def _configure_sqlite(connection: Any, _record: Any) -> None:
    # The driver must not begin transactions of its own: `_begin_sqlite` does.
    connection.isolation_level = None
    connection.execute(f"PRAGMA busy_timeout = {BUSY_SECONDS * 1000:.0f}")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA foreign_keys = ON")
    # A received file leaves the spool after the commit, so a commit must outlast a power cut.
    connection.execute("PRAGMA synchronous = FULL")


def _begin_sqlite(connection: Connection) -> None:
    # A deferred transaction that turns to writing fails at once under contention.
    reading = connection.get_execution_options().get("shm_reading", False)
    connection.exec_driver_sql("BEGIN" if reading else "BEGIN IMMEDIATE")


@contextmanager
def translated(location: str) -> Iterator[None]:
    """Turns the database's own errors into ours, with remedy and time to wait."""
    try:
        yield
    except sa.exc.SQLAlchemyError as error:
        cause = str(getattr(error, "orig", None) or error)
        fault = next((f for f in FAULTS if f.fragment in cause.lower()), None)
        if fault is None:
            raise StoreError(
                f"the store {location} refused a step: {cause}", remedy="Run `shm doctor`."
            ) from error
        raise fault.error(
            f"the store {location} {fault.message} ({cause}).",
            remedy=fault.remedy,
            retry_after_s=fault.retry_after_s,
        ) from error


def insert(connection: Connection, table: sa.Table, values: Mapping[str, Any]) -> int:
    """Inserts one row; its number."""
    result = connection.execute(sa.insert(table).values(values))
    return int((result.inserted_primary_key or (0,))[0])


class Database:
    """One database and its transactions; the verbs of the store stand on it."""

    def __init__(self, engine: Engine):
        self.engine = engine
        self.location = engine.url.render_as_string(hide_password=True)

    def close(self) -> None:
        self.engine.dispose()

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """One transaction, all or nothing; raises StoreBusy or StoreError."""
        with translated(self.location), self.engine.begin() as connection:
            yield connection

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """One consistent view that holds up nobody; raises StoreError."""
        with translated(self.location), self.engine.connect() as connection:
            yield connection.execution_options(shm_reading=True)
