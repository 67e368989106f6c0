"""Makes, upgrades and checks the schema; alembic is driven from here, without an ini file."""

from __future__ import annotations

import sqlalchemy as sa
from sqlalchemy.engine import Connection, Engine

from shm.errors import SchemaOutdated, StoreError
from shm.resources import migrations_folder
from shm.store.checksums import seal
from shm.store.database import reading, writing
from shm.store.location import shown
from shm.store.numbering import note_numbering
from shm.store.tables import SCHEMA


def upgrade(engine: Engine) -> None:
    """Brings an empty or older database to the present schema, in one transaction."""
    # Imported here because most commands only check, and alembic takes as long as all the rest.
    from alembic import command
    from alembic.config import Config
    from alembic.util import CommandError

    location = shown(engine.url)
    with writing(engine) as connection:
        _refuse_newer(_version(connection), location)
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
        seal(connection)
        note_numbering(connection)


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
