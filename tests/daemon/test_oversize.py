"""What is too large is neither read nor copied, on whatever way it comes; the heart goes on."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from shm.errors import TooLarge
from shm.pipeline.intake import receive
from shm.store import Stage
from shm.store.journal import list_events
from shm.store.recordings import list_recordings
from shm_daemon import run
from tests.helpers.flows import threads
from tests.helpers.workspaces import START, make_workspace, put, write_test

HUNDRED_GB = 100 * 10**9


def sparse(path: Path, size_bytes: int = HUNDRED_GB) -> Path:
    with path.open("wb") as file:
        file.truncate(size_bytes)
    os.utime(path, (1e9, 1e9))
    return path


def on_disk(folder: Path) -> int:
    return sum(path.lstat().st_blocks * 512 for path in folder.rglob("*"))


def test_a_hundred_sparse_gigabytes_go_to_the_quarantine_unread(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    sparse(workspace.spool / "huge.csv")
    put(workspace.spool / "huge.toml", "hanger = 3\n")
    write_test(workspace.spool / "good.modes.json", workspace)
    before = on_disk(workspace.folder)
    run(workspace, once=True, make_executor=threads)
    assert on_disk(workspace.folder) - before < 1_000_000
    assert list(workspace.spool.iterdir()) == []
    folder = workspace.quarantine.folder
    assert (folder / "huge.csv").stat().st_size == HUNDRED_GB
    assert (folder / "huge.toml").exists()
    reason = json.loads((folder / "huge.csv.reason.json").read_text())
    assert reason["message"] == f"{HUNDRED_GB} bytes are more than the 1000000000 that are taken."
    assert "max_file_bytes" in reason["remedy"]
    with workspace.store() as store:
        assert [each.stage for each in list_recordings(store)] == [Stage.DONE]
        assert [event.subject for event in list_events(store, "refused")] == ["huge.csv"]


def test_a_file_that_a_person_names_is_refused_unread_and_stays(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    huge = sparse(tmp_path / "huge.csv")
    with workspace.store() as store, pytest.raises(TooLarge, match="that are taken"):
        receive(huge, workspace, store, START)
    assert huge.exists()
    assert list(workspace.quarantine.folder.iterdir()) == []


def test_a_sidecar_that_is_too_large_takes_its_file_along(tmp_path: Path) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    put(workspace.spool / "h3.csv", "force,acc_1\n")
    sparse(workspace.spool / "h3.toml")
    run(workspace, once=True, make_executor=threads)
    lies = sorted(path.name for path in workspace.quarantine.folder.iterdir())
    assert lies == ["h3.csv", "h3.csv.reason.json", "h3.toml"]
    assert [path for path in workspace.archive.folder.rglob("*") if path.is_file()] == []
