"""`shm ingest` and `shm daemon` as they are run: in a process of their own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from shm.store import Workspace
from shm.store.posteriors import list_history
from shm.store.recordings import list_recordings
from shm_cli.main import run
from tests.cli.conftest import Shm
from tests.helpers.workspaces import make_workspace, write_test

PROGRAM = [sys.executable, "-c", "from shm_cli.main import main; main()"]


def shm_process(*arguments: object) -> subprocess.CompletedProcess[str]:
    words = [str(argument) for argument in arguments]
    return subprocess.run(
        [*PROGRAM, *words], capture_output=True, text=True, check=False, timeout=120,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip


@pytest.fixture(scope="module")
def taken_in(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Workspace, Path, subprocess.CompletedProcess[str]]:
    """Drop a baseline, two tests with a fifth less tension, an empty file, and a copy."""
    folder = tmp_path_factory.mktemp("ingest")
    workspace = make_workspace(folder / "bridge")
    write_test(folder / "a.modes.json", workspace)
    write_test(folder / "b.modes.json", workspace, day=59, tension=0.8)
    write_test(folder / "c.modes.json", workspace, day=60, tension=0.8)
    (folder / "empty.csv").write_text("")
    shutil.copy(folder / "a.modes.json", folder / "again.modes.json")
    names = ("a.modes.json", "b.modes.json", "c.modes.json", "empty.csv", "again.modes.json")
    files = (folder / name for name in names)
    ended = shm_process("--workspace", workspace.folder, "ingest", *files, "--json")
    return workspace, folder, ended


def test_ingest_does_the_whole_job_and_reports_each_file(
    taken_in: tuple[Workspace, Path, subprocess.CompletedProcess[str]],
) -> None:
    _, _, ended = taken_in
    document = json.loads(ended.stdout)
    told = [(row["file"], row["outcome"], row["stage"]) for row in document["files"]]
    assert told[:4] == [
        ("a.modes.json", "taken in", "done"),
        ("b.modes.json", "taken in", "done"),
        ("c.modes.json", "taken in", "done"),
        ("empty.csv", "refused", "refused"),
    ]
    assert [(alert["test"], alert["kinds"]) for alert in document["alerts"]] == [
        ("b", ["repeat the test"]),
        ("c", ["beyond threshold"]),
    ]


def test_a_refused_file_makes_exit_code_3_and_is_given_its_reason(
    taken_in: tuple[Workspace, Path, subprocess.CompletedProcess[str]],
) -> None:
    workspace, _, ended = taken_in
    assert ended.returncode == 3
    (row,) = [row for row in json.loads(ended.stdout)["files"] if row["file"] == "empty.csv"]
    assert "the file is empty" in row["reason"]
    assert list(workspace.quarantine.folder.glob("*.reason.json"))


def test_ingested_files_stay_where_they_are(
    taken_in: tuple[Workspace, Path, subprocess.CompletedProcess[str]],
) -> None:
    _, folder, _ = taken_in
    assert (folder / "a.modes.json").is_file()


def test_a_file_that_is_known_is_said_to_be_known_and_not_stored_twice(
    taken_in: tuple[Workspace, Path, subprocess.CompletedProcess[str]],
) -> None:
    workspace, _, ended = taken_in
    (row,) = [row for row in json.loads(ended.stdout)["files"] if row["outcome"] == "known already"]
    assert (row["file"], row["known_as"]) == ("again.modes.json", "a.modes.json")
    with workspace.store() as store:
        assert len(list_recordings(store)) == 4


def test_while_a_daemon_serves_the_workspace_ingest_says_what_to_do(
    shm: Shm, empty: Workspace, tmp_path: Path
) -> None:
    write_test(tmp_path / "a.modes.json", empty)
    with empty.lock():
        ended = shm("--workspace", empty.folder, "ingest", tmp_path / "a.modes.json")
    assert ended.code == 5
    assert "spool/" in ended.err


@pytest.mark.slow
def test_the_daemon_empties_the_spool_once_and_ends(empty: Workspace) -> None:
    write_test(empty.spool / "a.modes.json", empty)
    ended = shm_process("--workspace", empty.folder, "daemon", "--once")
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == ""
    assert "watching" in ended.stderr
    with empty.store() as store:
        assert len(list_history(store, 3)) == 1


def test_peek_shows_what_is_in_a_file_and_takes_nothing_in(
    shm: Shm, empty: Workspace, hanger_file: Path, tmp_path: Path
) -> None:
    out = tmp_path / "made"
    call = ["simulate", "--hanger-file", str(hanger_file), "--hits", "1", "--seconds", "2"]
    assert run([*call, "--out", str(out)]) == 0
    (path,) = out.iterdir()
    ended = shm("--workspace", empty.folder, "ingest", "--peek", path)
    assert ended.code == 0
    assert "hanger 3" in ended.out
    assert "acc_4" in ended.out
    (look,) = shm("ingest", "--peek", path, "--json").document["files"]
    assert look["sampling_rate_hz"] == 512
    assert look["channels"][0]["quantity"] == "force"
    with empty.store() as store:
        assert list_recordings(store) == ()


def test_peek_goes_on_after_a_file_it_cannot_read(
    shm: Shm, tmp_path: Path, modes_file: Path
) -> None:
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("")
    ended = shm("ingest", "--peek", wrong, modes_file)
    assert ended.code == 3
    assert "the file is empty" in ended.err
    assert "t9: 12 modes" in ended.out


def test_a_refusal_names_line_and_channel(shm: Shm, empty: Workspace, tmp_path: Path) -> None:
    rows = "\n".join("0.0,0.1" for _ in range(40))
    head = "# hanger: 3\n# sampling_rate_hz: 512\n# unit: N, furlong\nforce,acc_1\n"
    (tmp_path / "unit.csv").write_text(f"{head}{rows}\n")
    ended = shm("--workspace", empty.folder, "ingest", tmp_path / "unit.csv")
    assert ended.code == 3
    assert "unit.csv: line 3: channel acc_1: the unit 'furlong'" in ended.err
