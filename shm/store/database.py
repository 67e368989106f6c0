"""The engine, its transactions, and how the two kinds of database keep the same promises."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

from shm.errors import StoreError
from shm.store.checksums import forget_damage, look_before_update, seal
from shm.store.faults import translated
from shm.store.location import shown, url_of

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
    sa.event.listen(engine, "before_execute", look_before_update)
    return engine


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
    # A damaged text is told by the checksum of its row; one that is no UTF-8 must not hide others.
    connection.text_factory = _as_text


def _as_text(content: bytes) -> str:
    return content.decode("utf-8", "replace")


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
    """Inserts one row; its number."""
    result = connection.execute(sa.insert(table).values(values))
    return int((result.inserted_primary_key or (0,))[0])


class Repository:
    """Verbs on one database; each is one transaction."""

    def __init__(self, engine: Engine):
        self.engine = engine

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """One transaction, all or nothing; raises StoreBusy or StoreError."""
        with writing(self.engine) as connection:
            forget_damage(connection)
            yield connection
            seal(connection)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """One consistent view that holds up nobody; raises StoreError."""
        with reading(self.engine) as connection:
            yield connection


class Database(Repository):
    """One database, to be closed by who opened it."""

    def __init__(self, engine: Engine):
        super().__init__(engine)
        self.location = shown(engine.url)

    def close(self) -> None:
        self.engine.dispose()
