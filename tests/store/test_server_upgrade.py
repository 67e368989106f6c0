"""A store in PostgreSQL of every released schema upgrades to what a file of it upgrades to."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.config import Config

from shm.resources import migrations_folder
from shm.store import Store
from shm.store.database import make_engine, reading, writing
from shm.store.tables import SCHEMA
from tests.helpers.contents import held
from tests.helpers.postgres import Databases
from tests.helpers.slow import few_of

OLDER = [
    path
    for path in sorted(Path(__file__).parent.glob("data/schema_*.db"))
    if path.stem != f"schema_{SCHEMA}"
]


@pytest.fixture
def database(postgresql: Databases) -> Iterator[str]:
    with postgresql.database() as url:
        yield url


@pytest.mark.parametrize("released", few_of(OLDER, 2), ids=lambda path: path.stem)
def test_a_server_upgrades_as_a_file_does(released: Path, database: str, tmp_path: Path) -> None:
    path = as_of(released, database, tmp_path)
    for location in (path, database):
        Store.upgrade(location)
    with Store.open(path) as of_file, Store.open(database) as of_server:
        assert held(of_server) == held(of_file)
        assert sum(each.rows for each in held(of_file)) > 10


def as_of(released: Path, url: str, folder: Path) -> Path:
    """Makes an empty database one of a released schema; a copy of the file that filled it."""
    path = Path(shutil.copyfile(released, folder / "released.db"))
    _make_as_of(released.stem.removeprefix("schema_"), url)
    _fill_from(path, url)
    return path


def _make_as_of(schema: str, url: str) -> None:
    engine = make_engine(url)
    with writing(engine) as connection:
        config = Config()
        config.set_main_option("script_location", str(migrations_folder()))
        config.attributes["connection"] = connection
        command.upgrade(config, schema)
    engine.dispose()


def _fill_from(path: Path, url: str) -> None:
    """Copies the rows of a file as that schema had them, the tables referred to first."""
    source, target = make_engine(path), make_engine(url)
    here, there = sa.MetaData(), sa.MetaData()
    here.reflect(source)
    there.reflect(target)
    with reading(source) as rows, writing(target) as connection:
        for table in there.sorted_tables:
            if table.name == "alembic_version":
                continue
            found = rows.execute(sa.select(here.tables[table.name])).mappings().all()
            for row in found:
                values = {name: _zoned(value) for name, value in row.items()}
                connection.execute(sa.insert(table).values(values))
    source.dispose()
    target.dispose()


def _zoned(value: Any) -> Any:
    return value.replace(tzinfo=UTC) if isinstance(value, datetime) else value
