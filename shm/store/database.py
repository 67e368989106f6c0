"""The engine, its transactions, and how the two kinds of database keep the same promises.

Where a store is: a SQLite file or the URL of a PostgreSQL database, told without password.

What a database's errors mean, what to do, and when trying again may help.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

from shm.errors import StoreBusy, StoreDamaged, StoreError

_FORM = "postgresql://USER@HOST:5432/DATABASE"


def url_of(location: str | Path) -> sa.URL:
    """The address of a store given as a file or a URL.

    Raises StoreError, which never repeats the URL: it may hold a password.
    """
    text = str(location)
    if "://" not in text:
        return sa.URL.create("sqlite", database=text)
    try:
        url = sa.make_url(text)
    except (sa.exc.ArgumentError, ValueError):
        raise _unreadable() from None
    kind = url.get_backend_name()
    if kind == "sqlite":
        return url
    if kind not in ("postgresql", "postgres"):
        raise StoreError(
            f"no driver for a store of kind {kind}.", remedy=f"Use a file name, or {_FORM}."
        )
    if "@" in (url.host or "") or not url.database:
        raise _unreadable()
    return url.set(drivername="postgresql+psycopg")


def is_server(location: str | Path) -> bool:
    """Return True if the store is a PostgreSQL database rather than a file."""
    return url_of(location).get_backend_name() == "postgresql"


def has_password(location: str) -> bool:
    """Return True if the URL itself holds a password, which then stands wherever the URL stands."""
    url = url_of(location)
    return bool(url.password) or "password" in url.query


@lru_cache(16)  # each transaction asks for it
def shown(url: sa.URL) -> str:
    """An address as it may be told to anybody: without password and options."""
    name = url.get_backend_name()
    return url.set(drivername=name, query={}).render_as_string(hide_password=True)


def _unreadable() -> StoreError:
    return StoreError(
        "the store's URL cannot be read.",
        remedy=f"Write {_FORM}; in a password, write @ as %40, / as %2F and : as %3A.",
    )


@dataclass(frozen=True)
class Fault:
    """An error by pieces of its message or the beginnings of its SQLSTATE, and what it means.

    A server may speak any language, so a SQLSTATE comes first; while connecting, there is none.
    """

    fragments: tuple[str, ...]
    message: str
    remedy: str
    retry_after_s: float | None
    error: type[StoreError] = StoreError
    states: tuple[str, ...] = ()


_RESTORE = "Restore it from a backup: `shm db restore FILE --replace`."

# Seconds are judgement: what another process holds is free soon, what a person mends takes longer.
FAULTS = (
    Fault(
        ("is locked", "lock timeout", "queuepool limit"),
        "is held by another process",
        "Try again.",
        1.0,
        StoreBusy,
        ("55P03", "40"),
    ),
    Fault(
        ("disk is full", "no space left"),
        "cannot grow: the disk is full",
        "Free some space.",
        60.0,
        states=("53100",),
    ),
    Fault(
        ("readonly", "read-only transaction"),
        "cannot be written",
        "Give this user write access to it.",
        60.0,
        states=("25006", "42501"),
    ),
    Fault(
        ("too many clients", "too many connections", "connection slots"),
        "has no connection free",
        "End other clients of the server, or raise its max_connections.",
        5.0,
        states=("53300",),
    ),
    Fault(
        ("password authentication failed", "no password supplied", "pg_hba.conf"),
        "does not let this user in",
        "Check user and password (SHM_STORE, PGPASSWORD or ~/.pgpass).",
        None,
        states=("28",),
    ),
    Fault(
        ('" does not exist',),
        "is of a user or a database that is not there",
        "Make it with `createuser` or `createdb`, then run `shm db upgrade`.",
        None,
        states=("3D000",),
    ),
    Fault(("disk i/o",), "cannot be read or written", "Check the disk.", 60.0, states=("58030",)),
    Fault(("unable to open",), "cannot be opened", "Check its path and permissions.", None),
    Fault(("not a database",), "is not a database", _RESTORE, 60.0, StoreDamaged),
    Fault(("malformed",), "is damaged", _RESTORE, 60.0, StoreDamaged, states=("XX001", "XX002")),
)

# A server that begins again takes some seconds.
UNREACHABLE = Fault(
    (),
    "cannot be reached",
    "Check that the server runs and that its address is right.",
    5.0,
    states=("08", "57P"),
)


@contextmanager
def translated(location: str, errors: type[Exception] = sa.exc.SQLAlchemyError) -> Iterator[None]:
    """Turns the database's own errors into ours, with remedy and time to wait."""
    try:
        yield
    except UnicodeDecodeError as error:  # SQLite's message quotes a damaged schema
        raise StoreDamaged(
            f"the store {location} is damaged: its schema cannot be read.",
            remedy=_RESTORE,
            retry_after_s=60.0,
        ) from error
    except errors as error:
        cause = " ".join(str(getattr(error, "orig", None) or error).split())
        fault = _meaning(error, cause.lower())
        if fault is None:
            raise StoreError(
                f"the store {location} refused a step: {cause}.", remedy="Run `shm db check`."
            ) from error
        raise fault.error(
            f"the store {location} {fault.message} ({cause}).",
            remedy=fault.remedy,
            retry_after_s=fault.retry_after_s,
        ) from error


def _meaning(error: Exception, cause: str) -> Fault | None:
    state = getattr(getattr(error, "orig", None), "sqlstate", "")
    for fault in (*FAULTS, UNREACHABLE):
        if state.startswith(fault.states) if state else any(f in cause for f in fault.fragments):
            return fault
    # psycopg knows no SQLSTATE of what went wrong with the connection itself.
    lost = isinstance(error, sa.exc.OperationalError) and state is None
    return UNREACHABLE if lost else None


BUSY_SECONDS = 10.0  # judgement: a hundred times the longest transaction; then the caller is told

# First keys of PostgreSQL's advisory locks; the second is the schema the tables are in.
WRITING_LOCK = 0x73686D01
ACTIVE_LOCK = 0x73686D02

_READING: Mapping[str, Mapping[str, Any]] = {
    "sqlite": {"shm_reading": True},
    "postgresql": {
        "shm_reading": True,
        "isolation_level": "REPEATABLE READ",
        "postgresql_readonly": True,
    },
}
# A machine that vanished is noticed within some 11 s, by us and (see below) by the server.
_CONNECTING: Mapping[str, Any] = {
    "application_name": "shm",
    "connect_timeout": 10,
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 11_000,
}
_NOTICING = """
    SET tcp_keepalives_idle = 5; SET tcp_keepalives_interval = 2; SET tcp_keepalives_count = 3;
    SET tcp_user_timeout = 11000; SET client_min_messages = warning
"""


def make_engine(location: str | Path, **options: Any) -> Engine:
    """The engine of a database file or URL; raises StoreError where its driver is missing."""
    url = url_of(location)
    try:
        engine = sa.create_engine(url, **_options(url), **options)
    except ImportError as error:
        raise StoreError(
            "a store in PostgreSQL needs psycopg, which is not installed.",
            remedy="Install it with `pip install shm[postgres]`.",
        ) from error
    configure, begin = _EVENTS[engine.dialect.name]
    sa.event.listen(engine, "connect", configure)
    sa.event.listen(engine, "begin", begin)
    return engine


def copy_engine(location: str | Path) -> Engine:
    """Return the engine of a copy in memory of a database file, which nobody can write.

    It needs no room on the disk, where SQLite else begins an index of its log; what is in the log
    is copied. Raises StoreError.
    """
    url = url_of(location)
    name = f"file:{uuid4().hex}?mode=memory&cache=shared"
    copy = sqlite3.connect(name, uri=True, check_same_thread=False)
    with translated(shown(url), sqlite3.Error), closing(sqlite3.connect(str(url.database))) as file:
        file.execute("PRAGMA locking_mode = EXCLUSIVE")  # the index is in memory then
        file.backup(copy)
    return make_engine(location, creator=partial(_connect_to_copy, name, copy))


def _connect_to_copy(name: str, _copy: sqlite3.Connection) -> sqlite3.Connection:
    """Return one more connection; the copy lives as long as the first."""
    connection = sqlite3.connect(name, uri=True, check_same_thread=False)
    connection.execute("PRAGMA query_only = ON")
    return connection


def _options(url: sa.URL) -> dict[str, Any]:
    if url.get_backend_name() != "postgresql":
        return {}
    given = {name: value for name, value in _CONNECTING.items() if name not in url.query}
    # Statements prepared by a server break when tables change, and behind connection poolers.
    return {"pool_pre_ping": True, "connect_args": {**given, "prepare_threshold": None}}


def _configure_sqlite(connection: Any, _record: Any) -> None:
    # The driver must not begin transactions of its own: `_begin_sqlite` does.
    connection.isolation_level = None
    connection.execute(f"PRAGMA busy_timeout = {BUSY_SECONDS * 1000:.0f}")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA foreign_keys = ON")
    # A received file leaves the spool after the commit, so a commit must outlast a power cut.
    connection.execute("PRAGMA synchronous = FULL")


def _configure_postgresql(connection: Any, _record: Any) -> None:
    connection.autocommit = True
    connection.execute(_NOTICING)
    connection.autocommit = False


def _is_reading(connection: Connection) -> bool:
    return bool(connection.get_execution_options().get("shm_reading", False))


def _begin_sqlite(connection: Connection) -> None:
    # A deferred transaction that turns to writing fails at once under contention.
    connection.exec_driver_sql("BEGIN" if _is_reading(connection) else "BEGIN IMMEDIATE")


def _begin_postgresql(connection: Connection) -> None:
    # Writers look before they write, so they come one after the other, as in SQLite; each statement
    # then sees what the writer before has committed (READ COMMITTED, the server's default).
    if not _is_reading(connection):
        connection.exec_driver_sql(
            f"SET LOCAL lock_timeout = {BUSY_SECONDS * 1000:.0f}; "
            f"SELECT pg_advisory_xact_lock({WRITING_LOCK}, hashtext(current_schema()))",
            execution_options={"no_parameters": True},
        )


_EVENTS = {
    "sqlite": (_configure_sqlite, _begin_sqlite),
    "postgresql": (_configure_postgresql, _begin_postgresql),
}


@contextmanager
def writing(engine: Engine) -> Iterator[Connection]:
    """One transaction, all or nothing, one writer at a time; raises StoreBusy or StoreError."""
    with translated(shown(engine.url)), engine.begin() as connection:
        yield connection


@contextmanager
def reading(engine: Engine) -> Iterator[Connection]:
    """One consistent view that holds up nobody; raises StoreError."""
    with translated(shown(engine.url)), engine.connect() as connection:
        yield connection.execution_options(**_READING[engine.dialect.name])


def insert(connection: Connection, table: sa.Table, values: Mapping[str, Any]) -> int:
    """Insert one row of plain values; return its number."""
    result = connection.execute(sa.insert(table), dict(values))
    return int((result.inserted_primary_key or (0,))[0])


class Repository:
    """Verbs on one database; each is one transaction."""

    def __init__(self, engine: Engine):
        self.engine = engine

    def writing(self) -> AbstractContextManager[Connection]:
        """One transaction, all or nothing; raises StoreBusy or StoreError."""
        return writing(self.engine)

    def reading(self) -> AbstractContextManager[Connection]:
        """One consistent view that holds up nobody; raises StoreError."""
        return reading(self.engine)

    def rows(self, query: sa.Executable) -> Sequence[Any]:
        """All rows of a query, of one view."""
        with self.reading() as connection:
            return connection.execute(query).all()

    def first(self, query: sa.Executable) -> Any:
        """The first row of a query; None where there is none."""
        with self.reading() as connection:
            return connection.execute(query).first()

    def scalar(self, query: sa.Executable) -> Any:
        """The first value of the first row of a query; None where there is none."""
        with self.reading() as connection:
            return connection.scalar(query)

    def scalars(self, query: sa.Executable) -> Sequence[Any]:
        """The first value of each row of a query."""
        with self.reading() as connection:
            return connection.scalars(query).all()


class Database(Repository):
    """One database, to be closed by who opened it."""

    def __init__(self, engine: Engine):
        super().__init__(engine)
        self.location = shown(engine.url)

    def close(self) -> None:
        self.engine.dispose()
