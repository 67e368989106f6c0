"""`shm db upgrade` of every released schema, through the command, also beside a daemon at work."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from shm.store import Store, Workspace
from shm.store.backups import check_store, copy_store
from shm.store.tables import SCHEMA
from tests.cli.conftest import Shm
from tests.helpers.contents import held, quiet
from tests.helpers.postgres import Databases
from tests.helpers.slow import few_of
from tests.store.test_server_upgrade import as_of

RELEASED = sorted((Path(__file__).parents[1] / "store" / "data").glob("schema_*.db"))
OLDER = [path for path in RELEASED if path.stem != f"schema_{SCHEMA}"]


def of_a_release(released: Path, empty: Workspace) -> Workspace:
    """Return a workspace whose store a former shm has made."""
    for ending in ("-wal", "-shm"):
        empty.database.with_name(empty.database.name + ending).unlink(missing_ok=True)
    shutil.copyfile(released, empty.database)
    return empty


@pytest.mark.parametrize("released", few_of(RELEASED, 3), ids=lambda path: path.stem)
def test_file_of_schema_upgrades_twice(shm: Shm, empty: Workspace, released: Path) -> None:
    workspace = of_a_release(released, empty)
    for _ in range(2):
        ended = shm("--workspace", workspace.folder, "db", "upgrade", "--json")
        assert (ended.code, ended.document["upgraded"]) == (0, True)
    for verb in (["status"], ["db", "check"], ["alerts"]):
        assert shm("--workspace", workspace.folder, *verb).code == 0
    # Nothing watched yet, or by a class that has other parameters by now.
    said = shm("--workspace", workspace.folder, "drift", "--hanger", 3)
    assert said.code == 0 or "Unexpected" not in said.err


@pytest.mark.parametrize("released", [OLDER[0], OLDER[-1]], ids=lambda path: path.stem)
def test_a_server_upgrades_through_the_command(
    shm: Shm,
    empty: Workspace,
    released: Path,
    postgresql: Databases,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with postgresql.database() as url:
        as_of(released, url, tmp_path)
        monkeypatch.setenv("SHM_STORE", url)
        assert shm("--workspace", empty.folder, "status").code == 5
        assert shm("--workspace", empty.folder, "db", "upgrade").code == 0
        assert shm("--workspace", empty.folder, "db", "check").code == 0


def content(database: Path) -> list[str]:
    """All of it as statements: to look for changed settings may set the file's journal mode."""
    with closing(sqlite3.connect(database)) as connection:
        return list(connection.iterdump())


@pytest.mark.parametrize("released", few_of(OLDER, 2), ids=lambda path: path.stem)
def test_no_upgrade_beside_a_daemon(shm: Shm, empty: Workspace, released: Path) -> None:
    workspace = of_a_release(released, empty)
    before = content(workspace.database)
    with workspace.lock():
        ended = shm("--workspace", workspace.folder, "db", "upgrade")
    assert ended.code == 5
    assert "already ingests" in ended.err
    assert content(workspace.database) == before
    assert shm("--workspace", workspace.folder, "db", "upgrade").code == 0
    with Store.open(workspace.database) as store:
        assert check_store(store, quiet).troubles == ()


def test_upgraded_store_is_copied(shm: Shm, empty: Workspace, tmp_path: Path) -> None:
    workspace = of_a_release(OLDER[0], empty)
    assert shm("--workspace", workspace.folder, "db", "upgrade").code == 0
    with workspace.store() as store:
        assert copy_store(store, tmp_path / "copy.db", quiet) == held(store)
