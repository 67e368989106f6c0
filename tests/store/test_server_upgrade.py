"""A store in PostgreSQL of each released schema upgrades to what a file of it upgrades to."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from shm.store import Store
from shm.store.database import make_engine, reading, writing
from shm.store.tables import SCHEMA
from tests.helpers.contents import held
from tests.helpers.postgres import Databases

OLDER = [
    path
    for path in sorted(Path(__file__).parent.glob("data/schema_*.db"))
    if path.stem != f"schema_{SCHEMA}"
]


@pytest.fixture
def database(postgresql: Databases) -> Iterator[str]:
    with postgresql.database() as url:
        yield url


@pytest.mark.parametrize("released", OLDER, ids=lambda path: path.stem)
def test_a_server_upgrades_as_a_file_does(released: Path, database: str, tmp_path: Path) -> None:
    path = as_of(released, database, tmp_path)
    for location in (path, database):
        Store.upgrade(location)
    with Store.open(path) as of_file, Store.open(database) as of_server:
        assert held(of_server) == held(of_file)
        assert sum(each.rows for each in held(of_file)) > 10
        of_server.journal.note(datetime.now(UTC), "note written", "it numbers on")


def as_of(released: Path, url: str, folder: Path) -> Path:
    """Make an empty database one of a released schema; return a copy of the file that filled it."""
    path = Path(shutil.copyfile(released, folder / "released.db"))
    _copy_to_server(path, url)
    return path


def _copy_to_server(path: Path, url: str) -> None:
    source, target = make_engine(path), make_engine(url)
    tables = sa.MetaData()
    tables.reflect(source)
    for table in tables.tables.values():
        for column in table.columns:
            if isinstance(column.type, sa.DateTime):
                column.type = sa.DateTime(timezone=True)
            if isinstance(column.type, sa.BLOB):
                column.type = sa.LargeBinary()
            if isinstance(column.type, sa.Float):
                column.type = sa.Double()
            column.server_default = None
        for index in table.indexes:
            where = index.dialect_options["sqlite"]["where"]
            index.dialect_options["postgresql"]["where"] = where
    with reading(source) as rows, writing(target) as connection:
        tables.create_all(connection)
        for table in tables.sorted_tables:
            for row in rows.execute(sa.select(table)).mappings().all():
                values = {name: _zoned(value) for name, value in row.items()}
                connection.execute(sa.insert(table).values(values))
    source.dispose()
    target.dispose()


def _zoned(value: Any) -> Any:
    return value.replace(tzinfo=UTC) if isinstance(value, datetime) else value
