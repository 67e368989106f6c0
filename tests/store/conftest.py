from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from shm.store import Store
from tests.helpers.postgres import Databases
from tests.store.make_released_database import fill


@pytest.fixture(scope="session")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("empty") / "shm.db"
    Store.create(path).close()
    return path


@pytest.fixture
def sqlite(tmp_path: Path, empty_database: Path) -> Path:
    """An empty store that is a file."""
    return Path(shutil.copyfile(empty_database, tmp_path / "shm.db"))


@pytest.fixture
def server(request: pytest.FixtureRequest) -> Iterator[str]:
    """An empty store in PostgreSQL, whose server is begun only where a test needs it."""
    with request.getfixturevalue("postgresql").store() as url:
        yield url


@pytest.fixture(params=["sqlite", pytest.param("server", marks=pytest.mark.slow)])
def location(request: pytest.FixtureRequest) -> str | Path:
    """Where an empty store is, of either kind: what holds of one must hold of the other.

    `make test` meets the server in `test_server.py`, in the daemon's `test_server_store.py` and in
    the faults; all of these on a server run with the slow tests.
    """
    found: str | Path = request.getfixturevalue(request.param)
    return found


@pytest.fixture
def store(location: str | Path) -> Iterator[Store]:
    with Store.open(location) as store:
        yield store


@pytest.fixture
def file_store(sqlite: Path) -> Iterator[Store]:
    with Store.open(sqlite) as store:
        yield store


@pytest.fixture
def server_store(server: str) -> Iterator[Store]:
    with Store.open(server) as store:
        yield store


@pytest.fixture
def filled(store: Store) -> Store:
    """A store of either kind with something in every corner."""
    fill(store)
    return store


@pytest.fixture(params=["file", pytest.param("database", marks=pytest.mark.slow)])
def empty(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str | Path]:
    """Where a store of either kind may be made."""
    if request.param == "file":
        yield tmp_path / "empty.db"
    else:
        databases: Databases = request.getfixturevalue("postgresql")
        with databases.database() as url:
            yield url


@pytest.fixture(scope="session")
def filled_file(tmp_path_factory: pytest.TempPathFactory, empty_database: Path) -> Path:
    path = Path(shutil.copyfile(empty_database, tmp_path_factory.mktemp("filled") / "shm.db"))
    with Store.open(path) as store:
        fill(store)
    return path


@pytest.fixture
def filled_copy(filled_file: Path, tmp_path: Path) -> Iterator[Store]:
    """A file with something in every corner, for who may change it."""
    with Store.open(shutil.copyfile(filled_file, tmp_path / "filled.db")) as store:
        yield store
