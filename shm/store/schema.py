"""Makes, upgrades and checks the schema; alembic is driven from here, without an ini file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

from shm.errors import SchemaOutdated, StoreError
from shm.resources import migrations_folder
from shm.store.database import make_engine, reading, shown, writing
from shm.store.tables import SCHEMA

_RELEASED = ("0014", "0015", "0016")
"""Schemas besides the first that the one step to today's takes: of 1.0.0, and of what followed."""


def upgrade(engine: Engine) -> None:
    """Brings an empty or older database to the present schema, in one transaction."""
    # Imported here because most commands only check, and alembic takes as long as all the rest.
    from alembic import command
    from alembic.config import Config
    from alembic.util import CommandError

    location = shown(engine.url)
    with _changes_alone_logged(engine), writing(engine) as connection:
        found = _version(connection)
        _refuse_newer(found, location)
        if found in _RELEASED:
            connection.execute(sa.text("UPDATE alembic_version SET version_num = '0001'"))
        elif found not in (None, "0001", SCHEMA):
            raise StoreError(
                f"the store {location} has schema {found}, which no release of shm had.",
                remedy="Run `shm db upgrade` of shm 1.0.0 on it first, or restore a backup.",
            )
        config = Config()
        config.set_main_option("script_location", str(migrations_folder()))
        config.attributes["connection"] = connection
        try:
            command.upgrade(config, "head")
        except CommandError as error:
            raise StoreError(
                f"the store {location} cannot be upgraded: {error}.",
                remedy="Restore it from a backup.",
            ) from error


@contextmanager
def _changes_alone_logged(engine: Engine) -> Iterator[None]:
    """Have SQLite log what it changes and not what it adds: all rows are added once.

    Where another process has the file open it goes on as ever, and takes twice the room.
    """
    if engine.dialect.name != "sqlite":
        yield
        return
    _set_journal_mode(engine, "DELETE")
    try:
        yield
    finally:
        _set_journal_mode(engine, "WAL")


def _set_journal_mode(engine: Engine, mode: str) -> None:
    with suppress(sa.exc.DatabaseError), engine.connect() as connection:
        connection.exec_driver_sql("ROLLBACK")  # a mode is set outside of transactions
        connection.exec_driver_sql(f"PRAGMA journal_mode = {mode}")
        connection.exec_driver_sql("BEGIN")


def check(engine: Engine) -> None:
    """Raises SchemaOutdated unless the database has the present schema."""
    location = shown(engine.url)
    found = version(engine)
    _refuse_newer(found, location)
    if found != SCHEMA:
        raise SchemaOutdated(
            f"the store {location} has schema {found or 'none'}, this shm needs {SCHEMA}.",
            remedy="Run `shm db upgrade`.",
        )


def version(engine: Engine) -> str | None:
    """The schema of a database; None where it holds no store."""
    with reading(engine) as connection:
        return _version(connection)


def _version(connection: Connection) -> str | None:
    if not sa.inspect(connection).has_table("alembic_version"):
        return None
    found: str | None = connection.scalar(sa.text("SELECT version_num FROM alembic_version"))
    return found


def _refuse_newer(version: str | None, location: str) -> None:
    if version is not None and version > SCHEMA:
        raise SchemaOutdated(
            f"the store {location} has schema {version}, newer than this shm knows ({SCHEMA}).",
            remedy="Install the shm that wrote it, or a newer one.",
        )


def changed_objects(connection: Connection) -> tuple[str, ...]:
    """Tables and indexes of a SQLite store that are not as its migrations make them.

    A flipped bit in the text of the schema leaves every row and page valid, and yet may drop a
    constraint or read a number as a text. Of a server, and of another schema, nothing is said.
    """
    if connection.dialect.name != "sqlite" or _version(connection) != SCHEMA:
        return ()
    held = _objects(connection)
    return tuple(
        f"{kind} {name}" for (kind, name), made in _made().items() if held.get((kind, name)) != made
    )


_Object = tuple[str, Counter[str]]


def _objects(connection: Connection) -> dict[tuple[str, str], _Object]:
    query = "SELECT type, name, tbl_name, coalesce(sql, '') FROM sqlite_master ORDER BY name"
    return {
        (kind, name): (table, _parts(sql))
        for kind, name, table, sql in connection.exec_driver_sql(query).fetchall()
    }


def _parts(sql: str) -> Counter[str]:
    """Alembic's batches write the constraints of a table in any order."""
    return Counter(sql.removesuffix("\n)").split(","))


@cache
def _made() -> dict[tuple[str, str], _Object]:
    """Return what the migrations make, all run on an empty database in memory."""
    engine = make_engine("sqlite://")
    try:
        upgrade(engine)
        with reading(engine) as connection:
            return _objects(connection)
    finally:
        engine.dispose()
