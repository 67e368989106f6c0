"""What goes wrong is told with what, where and what to do: by every command, with no traceback."""

from __future__ import annotations

import errno
import shutil
import sqlite3
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from shm.store import Workspace
from shm_cli import main
from tests.cli.conftest import Ended, Shm
from tests.helpers.command_lines import commands, examples, words_of

NEEDS_NO_WORKSPACE = {
    "init", "demo", "completion", "manual", "notices", "settings", "gap effects",
}  # fmt: skip
"""They make one, or do without; `doctor` ends with a finding, which is its answer."""
FINDS = {"doctor"}
RUNNABLE = {
    name: command
    for name, command in commands()
    if not isinstance(command, click.Group) or command.invoke_without_command
}


def assert_told(ended: Ended, codes: set[int], *, as_json: bool = False) -> None:
    """Check exit code, stdout and a message of at least two sentences.

    Stdout is empty; with --json it holds the error as a document.
    """
    assert ended.code in codes, ended.err
    if as_json:
        assert ended.document["schema"] == "shm.error/1"
        assert ended.document["exit_code"] == ended.code
    else:
        assert ended.out == ""
    for word in ("Traceback", "Unexpected", "Errno"):
        assert word not in ended.err
    assert "Error" in ended.err
    assert "--help" in ended.err or ended.err.strip().count(". ") >= 1, ended.err


@pytest.mark.parametrize("name", sorted(RUNNABLE.keys() - NEEDS_NO_WORKSPACE - FINDS))
def test_every_command_says_that_there_is_no_workspace_or_file(
    shm: Shm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    words = words_of(examples(RUNNABLE[name])[0])
    assert_told(shm(*words), {2, 3}, as_json="--json" in words)


def test_a_missing_workspace_is_named(shm: Shm, tmp_path: Path) -> None:
    ended = shm("--workspace", tmp_path / "arhc", "status")
    assert ended.code == 3
    assert str(tmp_path / "arhc") in ended.err
    (tmp_path / "file").touch()
    assert_told(shm("--workspace", tmp_path / "file", "status"), {3})


def _no_store(workspace: Workspace) -> None:
    workspace.database.unlink()


def _no_database(workspace: Workspace) -> None:
    workspace.database.write_bytes(b"hello, I am no database" * 100)


def _newer_store(workspace: Workspace) -> None:
    with sqlite3.connect(workspace.database) as connection:
        connection.execute("UPDATE alembic_version SET version_num = 'z999'")


def _wrong_setting(workspace: Workspace) -> None:
    described = Path(workspace.bridge.source)
    described.write_text(described.read_text().replace("samples = 100", "samples = 'many'"))


@pytest.mark.parametrize(
    ("spoil", "code", "remedy"),
    [
        (_no_store, 4, "shm db restore"),
        (_no_database, 5, "backup"),
        (_newer_store, 5, "Install the shm that wrote it"),
        (_wrong_setting, 3, "Give a whole number from 100"),
    ],
)
@pytest.mark.parametrize(
    "line",
    ["status", "report --hanger 3", "drift", "alerts", "gap adopted", "token list", "db check",
     "archive fetch 1", "export --hanger 3 --out e.npz", "alerts ack 1 --why x"],
)  # fmt: skip
def test_a_workspace_that_is_spoilt_is_told_with_the_way_out(
    shm: Shm,
    empty: Workspace,
    spoil: Callable[[Workspace], None],
    code: int,
    remedy: str,
    line: str,
) -> None:
    spoil(empty)
    ended = shm("--workspace", empty.folder, *line.split())
    assert_told(ended, {code})
    assert remedy in " ".join(ended.err.split())


def test_the_way_out_of_a_lost_store_works(shm: Shm, empty: Workspace, tmp_path: Path) -> None:
    backup = tmp_path / "backup.db"
    shutil.copy(empty.database, backup)
    _no_store(empty)
    assert shm("--workspace", empty.folder, "db", "restore", backup).code == 0
    assert shm("--workspace", empty.folder, "status").code == 0
    again = tmp_path / "anew"
    assert shm("init", again, "--from", empty.folder / "bridge.toml").code == 0


@pytest.mark.parametrize(
    "line",
    ["export --hanger 3 --out {}/e.npz", "report --hanger 3 --format json --out {}/r.json",
     "report --bridge --format text --out {}/r.txt", "gap diagnose --hanger 99 --html {}/g.html"],
)  # fmt: skip
def test_a_place_that_cannot_be_written_is_told_before_anything_is_done(
    shm: Shm, bridge: Workspace, tmp_path: Path, line: str
) -> None:
    nowhere = tmp_path / "no" / "such"
    ended = shm("--workspace", bridge.folder, *line.format(nowhere).split())
    assert_told(ended, {3})
    assert str(nowhere) in ended.err


@pytest.mark.parametrize(
    "line",
    ["predict beam1 --hanger 3 --set theta_F=-1", "predict beam1 --hanger 3 --set theta_F=nan",
     "predict beam1 --hanger 3 --sweep theta_F=0.9:1.1:0",
     "predict beam1 --hanger 3 --sweep theta_F=0.9:1.1:100000000",
     "predict beam77 --hanger 3", "gap adopt --hanger 3 --effect nonsense --why x",
     "alerts test --hook nope"],
)  # fmt: skip
def test_a_value_that_means_nothing_is_a_wrong_call(shm: Shm, bridge: Workspace, line: str) -> None:
    assert_told(shm("--workspace", bridge.folder, *line.split()), {2})


@pytest.mark.parametrize(
    "line",
    ["alerts ack 1", "drift rebaseline --hanger 3 --since 2026-05-01", "gap drop --hanger 3",
     "gap adopt --hanger 3 --effect point_mass"],
)  # fmt: skip
def test_nothing_goes_on_record_without_a_reason(shm: Shm, bridge: Workspace, line: str) -> None:
    ended = shm("--workspace", bridge.folder, *line.split(), "--why", " ")
    assert_told(ended, {2})
    assert "it is empty" in ended.err


def test_the_dashboard_is_not_announced_where_it_cannot_begin(shm: Shm, empty: Workspace) -> None:
    assert_told(shm("--workspace", empty.folder, "web", "--host", "192.0.2.1"), {2})


def test_an_answer_that_finds_no_room_is_no_fault_of_shm(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full:
        """A stream whose disk is full."""

        def write(self, _: str) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

        def flush(self) -> None:
            """Nothing is held back."""

    monkeypatch.setattr(sys, "stdout", Full())
    assert main.run(["settings", "--json"]) == 3
    told = capsys.readouterr().err
    assert "no room is left where the answer goes" in told
