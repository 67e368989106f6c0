from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from shm.store import Store


@pytest.fixture(scope="session")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("empty") / "shm.db"
    Store.create(path).close()
    return path


@pytest.fixture
def store(tmp_path: Path, empty_database: Path) -> Iterator[Store]:
    shutil.copyfile(empty_database, tmp_path / "shm.db")
    with Store.open(tmp_path / "shm.db") as store:
        yield store
