"""`shm db` and `shm archive`: check, backup, restore, copy, pruning; a file and PostgreSQL."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from shm.store import Store, Workspace
from shm.store.recordings import list_recordings
from shm.store.upkeep import list_copies
from tests.cli.conftest import Shm
from tests.helpers.postgres import Databases
from tests.helpers.workspaces import write_test


@pytest.fixture
def url(postgresql: Databases) -> Iterator[str]:
    """Yield an empty store in PostgreSQL, its URL with a password."""
    with postgresql.store() as url:
        yield url.replace("postgres@", "postgres:hush@")


def test_a_sound_store_and_archive_pass(on_copy: Shm, copied: Workspace) -> None:
    ended = on_copy("db", "check", "--archive", "--json")
    assert ended.code == 0
    assert ended.document["troubles"] == []
    rows = {each["table"]: each["rows"] for each in ended.document["tables"]}
    assert (rows["recordings"], rows["tests"], rows["alerts"]) == (3, 3, 2)
    assert ended.document["archive"]["whole"] == 3


def test_lost_and_changed_raw_files(on_copy: Shm, copied: Workspace) -> None:
    lost, changed, _ = sorted(copied.archive.folder.glob("??/*"))
    lost.unlink()
    changed.chmod(0o644)
    changed.write_bytes(b"other")
    (changed.parent / f"{'0' * 64}.csv").write_bytes(b"")
    assert on_copy("db", "check").code == 0
    ended = on_copy("db", "check", "--archive", "--json")
    assert ended.code == 5
    assert ended.document["archive"]["missing"] == [f"{lost.parent.name}/{lost.name}"]
    assert ended.document["archive"]["damaged"] == [f"{changed.parent.name}/{changed.name}"]
    assert len(ended.document["archive"]["unreferenced"]) == 1
    assert "is not in the archive" in ended.err


def test_what_is_wrong_is_told_a_line_each_after_a_summary(on_copy: Shm, copied: Workspace) -> None:
    """It was one paragraph, however much was wrong."""
    lost, changed, _ = sorted(copied.archive.folder.glob("??/*"))
    lost.unlink()
    changed.chmod(0o644)
    changed.write_bytes(b"other")
    with sqlite3.connect(copied.database) as connection:
        connection.execute("DELETE FROM watches")
        connection.execute("UPDATE journal SET test_id = 99 WHERE id = 3")
    call = ("db", "check", "--archive")
    summary, *lines = on_copy(*call).err.splitlines()
    assert summary.startswith("Error: 3 findings: 1 broken reference, 1 missing raw")
    assert [line.partition(": ")[0] for line in lines] == [
        "journal/3",
        f"archive/{lost.parent.name}/{lost.name}",
        f"archive/{changed.parent.name}/{changed.name}",
    ]
    assert all(line.endswith("`.") and ".." not in line for line in lines)
    found = on_copy(*call, "--json").document
    assert [each["where"] for each in found["findings"]] == [
        line.partition(": ")[0] for line in lines
    ]
    assert len(found["troubles"]) == 3


def test_lost_workspace_comes_back(on_copy: Shm, copied: Workspace, tmp_path: Path) -> None:
    file, copies = tmp_path / "safe" / "may.db", tmp_path / "safe" / "archive"
    call = ("db",)
    first = on_copy(*call, "backup", file, "--archive", copies, "--json").document
    assert (first["archive"]["copied"], first["newly_noted"]) == (3, 3)
    again = on_copy(*call, "backup", tmp_path / "june.db", "--archive", copies, "--json").document
    assert (again["archive"]["copied"], again["archive"]["present"]) == (0, 3)
    assert again["newly_noted"] == 0
    with copied.store() as store:
        noted = [(copy.recording_id, copy.folder) for copy in list_copies(store)]
    assert noted == [(number, str(copies)) for number in (1, 2, 3)]
    copied.database.unlink()
    shutil.rmtree(copied.archive.folder)
    ended = on_copy(*call, "restore", file, "--archive", copies)
    assert ended.code == 0
    assert "Raw files: 3 copied" in ended.out
    assert on_copy(*call, "check", "--archive").code == 0
    assert on_copy("drift", "--hanger", 3).code == 0


def test_backup_folder_per_night(shm: Shm, on_copy: Shm, copied: Workspace, tmp_path: Path) -> None:
    """As shm-backup.service calls it; the folder's copy is what a bare machine needs."""
    copies = tmp_path / "nights"
    (copied.folder / "loggers").mkdir()
    (copied.folder / "loggers" / "l.toml").write_text("")
    call = ("db", "backup", copies, "--archive", copies / "archive")
    refused = on_copy(*call, "--print-unit")
    assert refused.code == 2
    assert "Make a folder" in refused.err
    copies.mkdir()
    unit = on_copy(*call, "--print-unit").out
    assert f"\nReadWritePaths={copied.folder} {copies}\n" in unit
    assert "\nOnCalendar=" in on_copy(*call, "--print-timer").out
    assert [*copies.iterdir()] == []
    (line,) = (line for line in unit.splitlines() if line.startswith("ExecStart="))
    words = line.split(" shm ")[1].split()
    file = Path(on_copy(*words, "--json").document["file"])
    assert file.parent.parent == copies
    again = file.parent / "bridge"
    shutil.copytree(file.parent / "loggers", again / "loggers")
    assert shm("init", again, "--from", file.parent / "bridge.toml").code == 0
    call = ("--workspace", again, "db")
    assert shm(*call, "restore", file, "--archive", copies / "archive").code == 0
    assert shm(*call, "check", "--archive").code == 0


def test_raw_files_not_copied(on_copy: Shm, copied: Workspace, tmp_path: Path) -> None:
    lost = sorted(copied.archive.folder.glob("??/*"))[0]
    lost.unlink()
    call = ("db", "backup", tmp_path / "may.db")
    ended = on_copy(*call, "--archive", tmp_path / "copies", "--json")
    assert (ended.code, ended.document["newly_noted"]) == (5, 2)
    assert lost.name in ended.err
    with Store.open(tmp_path / "may.db") as backup:
        assert len(list_recordings(backup)) == 3


def test_restore_over_a_store(on_copy: Shm, copied: Workspace, tmp_path: Path) -> None:
    call = ("db",)
    on_copy(*call, "backup", tmp_path / "may.db")
    ended = on_copy(*call, "restore", tmp_path / "may.db")
    assert ended.code == 2
    assert "--replace" in ended.err
    ended = on_copy(*call, "restore", tmp_path / "may.db", "--replace", "--json")
    kept = Path(ended.document["kept"])
    assert kept.parent == copied.folder
    with Store.open(kept) as store:
        assert len(list_recordings(store)) == 3


def test_a_restore_waits_for_no_daemon(on_copy: Shm, copied: Workspace, tmp_path: Path) -> None:
    call = ("db",)
    with copied.lock():
        assert on_copy(*call, "backup", tmp_path / "may.db").code == 0
        for verb in (("restore", tmp_path / "may.db"), ("copy", "--to", tmp_path / "c.db")):
            ended = on_copy(*call, *verb)
            assert ended.code == 5
            assert "already ingests" in ended.err


def test_a_bridge_moves_to_a_server_and_back(
    on_copy: Shm, copied: Workspace, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = on_copy("db", "copy", "--to", url, "--json")
    assert there.code == 0
    monkeypatch.setenv("SHM_STORE", url)
    here = on_copy("db", "check", "--json")
    assert here.document["tables"] == there.document["tables"]
    write_test(copied.spool / "later.modes.json", copied, day=90, tension=0.8)
    assert on_copy("ingest", copied.spool / "later.modes.json").code == 0
    said = [here, on_copy("status"), on_copy("drift", "--hanger", 3)]
    said.append(on_copy("db", "backup", tmp_path / "may.db"))
    said.append(on_copy("db", "restore", tmp_path / "may.db"))
    assert [ended.code for ended in said] == [0, 0, 0, 0, 2]
    assert not any("hush" in ended.out + ended.err for ended in said)
    assert on_copy("db", "copy", "--to", tmp_path / "back.db").code == 0
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


def test_server_is_down(shm: Shm, empty: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHM_STORE", "postgresql://shm:hush@127.0.0.1:1/arch")
    for verb in (["status"], ["db", "check"], ["db", "upgrade"], ["ingest", __file__]):
        ended = shm("--workspace", empty.folder, *verb)
        assert ended.code == 5
        assert "cannot be reached" in ended.err
        assert "hush" not in ended.err


@pytest.fixture
def call(on_copy: Shm, monkeypatch: pytest.MonkeyPatch) -> Shm:
    """Return commands on a copy of the bridge with a history, in the far future."""
    later = datetime(2100, 1, 1, tzinfo=UTC)
    monkeypatch.setattr("shm_cli.archive.utc_now", lambda: later)
    return on_copy


def raw_files(tmp_path: Path) -> int:
    return len(list((tmp_path / "bridge" / "archive").glob("??/*")))


def test_pruning_says_what_would_go_then_takes_it_away(call: Shm, tmp_path: Path) -> None:
    ended = call("archive", "prune", "--keep-days", 400, "--json")
    assert ended.document["archive"]["kept"] == {"no copy is noted": 3}
    assert call("db", "backup", tmp_path / "b.db", "--archive", tmp_path / "copies").code == 0
    ended = call("archive", "prune", "--keep-days", 400, "--dry-run")
    assert "3 files would be removed" in ended.out
    assert raw_files(tmp_path) == 3
    ended = call("archive", "prune", "--keep-days", 400)
    assert "3 files removed, which freed" in ended.out
    assert raw_files(tmp_path) == 0
    checked = call("db", "check", "--archive")
    assert (checked.code, "3 removed" in checked.out) == (0, True)
    assert call("report", "--hanger", 3).code == 0
    assert call("db", "backup", tmp_path / "c.db", "--archive", tmp_path / "others").code == 0


def test_rerun_without_raw_file(call: Shm, tmp_path: Path) -> None:
    call("db", "backup", tmp_path / "b.db", "--archive", tmp_path / "copies")
    call("archive", "prune", "--keep-days", 400)
    before = call("status", "--of", "t1", "--json").document
    ended = call("ingest", "--again", "t1")
    assert ended.code == 4
    assert f"a copy lies in {tmp_path / 'copies'}" in ended.err
    assert "shm archive fetch 2" in ended.err
    assert call("status", "--of", "t1", "--json").document == before
    fetched = call("archive", "fetch", "t1")
    assert (fetched.code, raw_files(tmp_path)) == (0, 1)
    assert "is in the archive" in call("archive", "fetch", "t1").out


def test_young_files_stay(call: Shm, tmp_path: Path) -> None:
    call("db", "backup", tmp_path / "b.db", "--archive", tmp_path / "copies")
    assert "archive: 0 files removed" in call("archive prune --keep-days 36500").out
    assert raw_files(tmp_path) == 3
