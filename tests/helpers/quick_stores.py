"""What hundreds of new stores need not do: run migrations, compile SQL, sync, make guesses dear.

The first two are the same each time: a new file is copied from one that the migrations made in this
process, and a statement that one store compiled serves the others. And no power fails here: who
cuts it begins processes of its own (`tests/helpers/power.py`).
"""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path
from typing import Any

import argon2
import pytest
from sqlalchemy.dialects.postgresql.psycopg import PGDialect_psycopg
from sqlalchemy.dialects.sqlite.pysqlite import SQLiteDialect_pysqlite
from sqlalchemy.engine import Engine
from sqlalchemy.util import LRUCache

from shm.store import database, schema

_upgrade, _create_engine = schema.upgrade, database.sa.create_engine
AS_SHIPPED = database._EVENTS["sqlite"]


def copy_new_stores(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """A store whose file is not there yet is copied; every other one is upgraded as ever."""
    template = folder / "template.db"

    def upgrade(engine: Engine) -> None:
        path = Path(engine.url.database or "")
        is_new = engine.dialect.name == "sqlite" and path.suffix and not path.exists()
        if is_new and path.parent.is_dir():
            if not template.exists():
                _make(template)
            try:
                shutil.copyfile(template, path)
            except OSError:  # the store says so in its own words
                path.unlink(missing_ok=True)
        if not is_new or not path.exists():
            _upgrade(engine)

    patch.setattr(schema, "upgrade", upgrade)


def _make(template: Path) -> None:
    engine = database.make_engine(template)
    _upgrade(engine)
    engine.dispose()  # the last one to close a file leaves no log beside it


def share_compiled_statements(patch: pytest.MonkeyPatch) -> None:
    """Of all engines of a kind of database: what is compiled depends on the kind alone."""
    compiled = LRUCache(2000)

    def create_engine(*arguments: object, **options: object) -> Engine:
        engine = _create_engine(*arguments, **options)
        engine.update_execution_options(compiled_cache=compiled)
        return engine

    patch.setattr(database.sa, "create_engine", create_engine)
    # A compiled statement is kept under its dialect, of which each engine has one.
    for dialect in (PGDialect_psycopg, SQLiteDialect_pysqlite):
        patch.setattr(dialect, "__hash__", lambda self: hash(type(self)))
        patch.setattr(dialect, "__eq__", lambda self, other: type(self) is type(other))


def wait_for_no_disk(patch: pytest.MonkeyPatch) -> None:
    """A commit of a file is left to the system: it outlasts a killed process all the same."""
    configure, begin = AS_SHIPPED

    def unsynced(connection: Any, record: Any) -> None:
        configure(connection, record)
        connection.execute("PRAGMA synchronous = OFF")

    patch.setitem(database._EVENTS, "sqlite", (unsynced, begin))


def hash_passwords_quickly(patch: pytest.MonkeyPatch) -> None:
    """How dear a guess is, is argon2's to test: 0.2 s for each user and each sign-in."""
    quick = partial(argon2.PasswordHasher, time_cost=1, memory_cost=8, parallelism=1)
    patch.setattr(argon2, "PasswordHasher", quick)
