"""What every command gives: JSON with --json, and an error that says what, where and what to do."""

from __future__ import annotations

import errno
import json
import re
import shutil
import sqlite3
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import pytest

from shm.store import Workspace
from shm_cli import main
from tests.cli.conftest import Ended, Shm
from tests.helpers.command_lines import commands, examples, words_of
from tests.helpers.no_room import no_room
from tests.helpers.workspaces import write_test

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


Spoil = Callable[[Workspace], None]


def _no_store(workspace: Workspace) -> None:
    workspace.database.unlink()


def _no_database(workspace: Workspace) -> None:
    workspace.database.write_bytes(b"hello, I am no database" * 100)


def _outdated_store(workspace: Workspace) -> None:
    workspace.database.write_bytes(b"")


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
        (_outdated_store, 5, "shm db upgrade"),
    ],
)
@pytest.mark.parametrize(
    "line",
    ["status", "report --hanger 3", "drift", "alerts", "gap adopted", "token list", "db check",
     "archive fetch 1", "export --hanger 3 --out e.npz", "alerts ack 1 --why x"],
)  # fmt: skip
def test_a_workspace_that_is_spoilt_is_told_with_the_way_out(
    on_empty: Shm, empty: Workspace, spoil: Spoil, code: int, remedy: str, line: str
) -> None:
    spoil(empty)
    ended = on_empty(line)
    assert_told(ended, {code})
    assert remedy in ended.said


def test_the_way_out_of_a_lost_store_works(shm: Shm, empty: Workspace, tmp_path: Path) -> None:
    backup = tmp_path / "backup.db"
    shutil.copy(empty.database, backup)
    _no_store(empty)
    assert shm("--workspace", empty.folder, "db", "restore", backup).code == 0
    assert shm("--workspace", empty.folder, "status").code == 0
    again = tmp_path / "anew"
    assert shm("init", again, "--from", empty.folder / "bridge.toml").code == 0


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


FOR_PEOPLE_ALONE = {"demo", "daemon", "web", "completion"}
"""They serve until they are ended, or print what a shell reads; `export` writes files."""
OF_FILES = {"export"}


def has_json(command: click.Command) -> bool:
    return any("--json" in parameter.opts for parameter in command.params)


@pytest.mark.parametrize("line", ["status", "alerts", "drift", "ingest --held"])
def test_reading_commands_read_on_a_full_disk(on_copy: Shm, line: str) -> None:
    expected = on_copy.done(line).told
    with no_room():
        ended = on_copy(line)
    assert (ended.code, ended.told) == (0, expected)
    assert ended.err.startswith("Nothing can be written: the store ")


def test_every_command_that_a_script_would_call_takes_json() -> None:
    lacking = {
        name
        for name, command in commands()
        if not has_json(command)
        and not (isinstance(command, click.Group) and not command.invoke_without_command)
    }
    assert lacking - OF_FILES == FOR_PEOPLE_ALONE


def parsed(text: str) -> Any:
    """One document; NaN and Infinity, which Python's parser would take, are refused."""

    def refused(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    return json.loads(text, parse_constant=refused)


SCHEMAS = {"status": "shm.status/1", "status --of 1": "shm.recording_stages/1"}
READING = (
    "alerts",
    "alerts --hanger 3",
    "archive prune --keep-days 1 --dry-run",
    "bridges",
    "db check",
    "db check --archive",
    "doctor",
    "drift",
    "drift --hanger 3",
    "drift --hanger 3 --all",
    "drift bridge",
    "gap adopted",
    "predict beam1 --hanger 3",
    "predict beam2 --hanger 3 --set log10_k1=8 --set log10_k2=8 --set log10_k3=8 --set log10_k4=8",
    "predict beam1 --hanger 3 --sweep theta_F=0.9:1.1:2",
    "report --hanger 3",
    "report --bridge",
    "status",
    "status --of 1",
    "token list",
    "user list",
    "audit",
)


@pytest.mark.parametrize("line", READING)
def test_reading_command_gives_one_json_document(on_bridge: Shm, on_empty: Shm, line: str) -> None:
    """With a schema first; the exit code is the same without --json."""
    ended = on_bridge(f"{line} --json")
    assert ended.code in (0, 1, 4), ended.err
    document = parsed(ended.out)
    expected = r"shm\.error/1" if ended.code == 4 else SCHEMAS.get(line, r"shm\.[a-z_-]+/\d")
    assert re.fullmatch(expected, document["schema"]), document["schema"]
    assert next(iter(document)) == "schema"
    assert on_empty(line).code == on_empty(f"{line} --json").code


def test_error_as_a_document(on_empty: Shm) -> None:
    ended = on_empty("report --hanger 3 --json")
    assert ended.code == 4
    assert ended.document == {
        "schema": "shm.error/1",
        "error": "nothing_there",
        "message": "no test of hanger 3 has been through updating yet.",
        "remedy": "Take recordings in with `shm ingest FILE`, or see `shm status`.",
        "exit_code": 4,
    }
    assert "shm ingest" in ended.err


def test_file_command_gives_one_document(shm: Shm, modes_file: Path, hanger_file: Path) -> None:
    for line in (
        f"ingest --peek {modes_file}",
        f"select {modes_file} --models beam1 --samples 200 --hanger-file {hanger_file}",
        f"update {modes_file} --model beam1 --samples 200 --hanger-file {hanger_file}",
    ):
        assert isinstance(parsed(shm.done(f"{line} --json").out), dict)


def test_writing_commands_say_what_they_did(
    on_empty: Shm, empty: Workspace, hanger_file: Path, tmp_path: Path
) -> None:
    def of(line: str) -> Any:
        return parsed(on_empty.done(f"{line} --json").out)

    assert Path(of(f"init {tmp_path / 'arch'}")["description"]).is_file()
    token = of("token create logger --scope write")
    assert token["name"] == "logger"
    assert token["token"]
    revoked = {"schema": "shm.token_revoke/1", "name": "logger", "revoked": True}
    assert of("token revoke logger") == revoked
    assert of("db upgrade")["upgraded"] is True
    made = of(f"simulate --hanger-file {hanger_file} --hits 1 --out {tmp_path / 'made'}")
    assert all(Path(file).is_file() for file in made["files"])
    write_test(tmp_path / "t1.modes.json", empty)
    of(f"ingest {tmp_path / 't1.modes.json'}")
    fetched = {"schema": "shm.archive_fetch/1", "recording": 1, "file": "t1.modes.json"}
    assert of("archive fetch 1") == {**fetched, "from": None}
