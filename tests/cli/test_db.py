"""`shm db`: check, backup, restore and copy, of a store in a file and of one in PostgreSQL."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest

from shm.store import Store, Workspace
from shm.store.recordings import list_recordings
from shm.store.upkeep import list_copies
from tests.cli.conftest import Shm
from tests.helpers.postgres import Databases
from tests.helpers.workspaces import write_test


@pytest.fixture
def copied(bridge: Workspace, tmp_path: Path) -> Workspace:
    """Return a bridge with a short history, to be changed at will."""
    folder = Path(shutil.copytree(bridge.folder, tmp_path / "bridge"))
    return Workspace.open(folder)


@pytest.fixture
def url(postgresql: Databases) -> Iterator[str]:
    """Yield an empty store in PostgreSQL, its URL with a password."""
    with postgresql.store() as url:
        yield url.replace("postgres@", "postgres:hush@")


def test_a_sound_store_and_archive_pass(shm: Shm, copied: Workspace) -> None:
    ended = shm("--workspace", copied.folder, "db", "check", "--archive", "--json")
    assert ended.code == 0
    assert ended.document["troubles"] == []
    rows = {each["table"]: each["rows"] for each in ended.document["tables"]}
    assert (rows["recordings"], rows["tests"], rows["alerts"]) == (3, 3, 2)
    assert ended.document["archive"]["whole"] == 3


def test_raw_files_that_are_lost_or_changed_are_found(shm: Shm, copied: Workspace) -> None:
    lost, changed, _ = sorted(copied.archive.folder.glob("??/*"))
    lost.unlink()
    changed.chmod(0o644)
    changed.write_bytes(b"other")
    (changed.parent / f"{'0' * 64}.csv").write_bytes(b"")
    assert shm("--workspace", copied.folder, "db", "check").code == 0
    ended = shm("--workspace", copied.folder, "db", "check", "--archive", "--json")
    assert ended.code == 5
    assert ended.document["archive"]["missing"] == [f"{lost.parent.name}/{lost.name}"]
    assert ended.document["archive"]["damaged"] == [f"{changed.parent.name}/{changed.name}"]
    assert len(ended.document["archive"]["unreferenced"]) == 1
    assert "is not in the archive" in ended.err


def test_what_is_wrong_is_told_a_line_each_after_a_summary(shm: Shm, copied: Workspace) -> None:
    """It was one paragraph, however much was wrong."""
    lost, changed, _ = sorted(copied.archive.folder.glob("??/*"))
    lost.unlink()
    changed.chmod(0o644)
    changed.write_bytes(b"other")
    with sqlite3.connect(copied.database) as connection:
        connection.execute("DELETE FROM watches")
        connection.execute("UPDATE journal SET test_id = 99 WHERE id = 3")
    call = ("--workspace", copied.folder, "db", "check", "--archive")
    summary, *lines = shm(*call).err.splitlines()
    assert summary.startswith("Error: 3 findings: 1 broken reference, 1 missing raw")
    assert [line.partition(": ")[0] for line in lines] == [
        "journal/3",
        f"archive/{lost.parent.name}/{lost.name}",
        f"archive/{changed.parent.name}/{changed.name}",
    ]
    assert all(line.endswith("`.") and ".." not in line for line in lines)
    found = shm(*call, "--json").document
    assert [each["where"] for each in found["findings"]] == [
        line.partition(": ")[0] for line in lines
    ]
    assert len(found["troubles"]) == 3


def test_a_lost_workspace_comes_back_from_its_backup(
    shm: Shm, copied: Workspace, tmp_path: Path
) -> None:
    file, copies = tmp_path / "safe" / "may.db", tmp_path / "safe" / "archive"
    call = ("--workspace", copied.folder, "db")
    first = shm(*call, "backup", file, "--archive", copies, "--json").document
    assert (first["archive"]["copied"], first["newly_noted"]) == (3, 3)
    again = shm(*call, "backup", tmp_path / "june.db", "--archive", copies, "--json").document
    assert (again["archive"]["copied"], again["archive"]["present"]) == (0, 3)
    assert again["newly_noted"] == 0
    with copied.store() as store:
        noted = [(copy.recording_id, copy.folder) for copy in list_copies(store)]
    assert noted == [(number, str(copies)) for number in (1, 2, 3)]
    copied.database.unlink()
    shutil.rmtree(copied.archive.folder)
    ended = shm(*call, "restore", file, "--archive", copies)
    assert ended.code == 0
    assert "Raw files: 3 copied" in ended.out
    assert shm(*call, "check", "--archive").code == 0
    assert shm("--workspace", copied.folder, "drift", "--hanger", 3).code == 0


def test_each_night_has_a_folder_of_its_own_in_the_folder_of_backups(
    shm: Shm, copied: Workspace, tmp_path: Path
) -> None:
    """As shm-backup.service calls it; the folder's copy is what a bare machine needs."""
    copies = tmp_path / "nights"
    (copied.folder / "loggers").mkdir()
    (copied.folder / "loggers" / "l.toml").write_text("")
    call = ("--workspace", copied.folder, "db", "backup", copies, "--archive", copies / "archive")
    refused = shm(*call, "--print-unit")
    assert refused.code == 2
    assert "Make a folder" in refused.err
    copies.mkdir()
    unit = shm(*call, "--print-unit").out
    assert f"\nReadWritePaths={copied.folder} {copies}\n" in unit
    assert "\nOnCalendar=" in shm(*call, "--print-timer").out
    assert [*copies.iterdir()] == []
    (line,) = (line for line in unit.splitlines() if line.startswith("ExecStart="))
    words = line.split(" shm ")[1].split()
    file = Path(shm("--workspace", copied.folder, *words, "--json").document["file"])
    assert file.parent.parent == copies
    again = file.parent / "bridge"
    shutil.copytree(file.parent / "loggers", again / "loggers")
    assert shm("init", again, "--from", file.parent / "bridge.toml").code == 0
    call = ("--workspace", again, "db")
    assert shm(*call, "restore", file, "--archive", copies / "archive").code == 0
    assert shm(*call, "check", "--archive").code == 0


def test_raw_files_that_cannot_be_copied_are_told_and_not_noted(
    shm: Shm, copied: Workspace, tmp_path: Path
) -> None:
    lost = sorted(copied.archive.folder.glob("??/*"))[0]
    lost.unlink()
    call = ("--workspace", copied.folder, "db", "backup", tmp_path / "may.db")
    ended = shm(*call, "--archive", tmp_path / "copies", "--json")
    assert (ended.code, ended.document["newly_noted"]) == (5, 2)
    assert lost.name in ended.err
    with Store.open(tmp_path / "may.db") as backup:
        assert len(list_recordings(backup)) == 3


def test_a_restore_over_a_store_is_refused_or_keeps_the_old_one(
    shm: Shm, copied: Workspace, tmp_path: Path
) -> None:
    call = ("--workspace", copied.folder, "db")
    shm(*call, "backup", tmp_path / "may.db")
    ended = shm(*call, "restore", tmp_path / "may.db")
    assert ended.code == 2
    assert "--replace" in ended.err
    ended = shm(*call, "restore", tmp_path / "may.db", "--replace", "--json")
    kept = Path(ended.document["kept"])
    assert kept.parent == copied.folder
    with Store.open(kept) as store:
        assert len(list_recordings(store)) == 3


def test_a_restore_waits_for_no_daemon(shm: Shm, copied: Workspace, tmp_path: Path) -> None:
    call = ("--workspace", copied.folder, "db")
    with copied.lock():
        assert shm(*call, "backup", tmp_path / "may.db").code == 0
        for verb in (("restore", tmp_path / "may.db"), ("copy", "--to", tmp_path / "c.db")):
            ended = shm(*call, *verb)
            assert ended.code == 5
            assert "already ingests" in ended.err


def test_a_bridge_moves_to_a_server_and_back(
    shm: Shm, copied: Workspace, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    call = ("--workspace", copied.folder)
    there = shm(*call, "db", "copy", "--to", url, "--json")
    assert there.code == 0
    monkeypatch.setenv("SHM_STORE", url)
    here = shm(*call, "db", "check", "--json")
    assert here.document["tables"] == there.document["tables"]
    write_test(copied.spool / "later.modes.json", copied, day=90, tension=0.8)
    assert shm(*call, "ingest", copied.spool / "later.modes.json").code == 0
    said = [here, shm(*call, "status"), shm(*call, "drift", "--hanger", 3)]
    said.append(shm(*call, "db", "backup", tmp_path / "may.db"))
    said.append(shm(*call, "db", "restore", tmp_path / "may.db"))
    assert [ended.code for ended in said] == [0, 0, 0, 0, 2]
    assert not any("hush" in ended.out + ended.err for ended in said)
    assert shm(*call, "db", "copy", "--to", tmp_path / "back.db").code == 0
    with Store.open(tmp_path / "back.db") as store:
        assert [test.test.id for test in store.tests.list_all(3)] == ["t0", "t1", "t2", "later"]
    with Store.open(copied.database) as store:
        assert len(store.tests.list_all(3)) == 3


def test_a_new_bridge_is_made_on_a_server(
    shm: Shm, postgresql: Databases, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with postgresql.database() as url:
        monkeypatch.setenv("SHM_STORE", url)
        assert shm("init", tmp_path / "arch").code == 0
        call = ("--workspace", tmp_path / "arch")
        assert not (tmp_path / "arch" / "shm.db").exists()
        assert shm(*call, "status", "--json").document["recordings"]["done"] == 0
        assert shm(*call, "db", "upgrade").code == 0


def test_a_server_that_is_down_is_told_with_exit_code_5(
    shm: Shm, empty: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHM_STORE", "postgresql://shm:hush@127.0.0.1:1/arch")
    for verb in (["status"], ["db", "check"], ["db", "upgrade"], ["ingest", __file__]):
        ended = shm("--workspace", empty.folder, *verb)
        assert ended.code == 5
        assert "cannot be reached" in ended.err
        assert "hush" not in ended.err
