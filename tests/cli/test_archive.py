"""`shm archive`: raw files with a copy may go and come back; a re-run says where they are."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest

from shm.store import Workspace
from tests.cli.conftest import Ended, Shm

Call = Callable[..., Ended]


@pytest.fixture
def call(shm: Shm, bridge: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """Commands on a copy of the bridge with a history, in the far future."""
    folder = tmp_path / "bridge"
    shutil.copytree(bridge.folder, folder)
    later = datetime(2100, 1, 1, tzinfo=UTC)
    monkeypatch.setattr("shm_cli.archive.utc_now", lambda: later)

    def on_the_copy(*arguments: object) -> Ended:
        return shm("--workspace", folder, *arguments)

    return on_the_copy


def raw_files(tmp_path: Path) -> int:
    return len(list((tmp_path / "bridge" / "archive").glob("??/*")))


def test_pruning_says_what_would_go_then_takes_it_away(call: Call, tmp_path: Path) -> None:
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


def test_a_rerun_says_where_the_raw_file_is_and_supersedes_nothing(
    call: Call, tmp_path: Path
) -> None:
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


def test_young_files_stay_and_something_must_be_asked_for(call: Call, tmp_path: Path) -> None:
    call("db", "backup", tmp_path / "b.db", "--archive", tmp_path / "copies")
    assert "archive: 0 files removed" in call("archive", "prune", "--keep-days", 36500).out
    assert raw_files(tmp_path) == 3
    assert call("archive", "prune").code == 2
