"""`--json` is there wherever a script would call, and what it gives is JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import pytest

from shm.store import Workspace
from tests.cli.conftest import Shm
from tests.helpers.command_lines import commands
from tests.helpers.workspaces import write_test

FOR_PEOPLE_ALONE = {"demo", "daemon", "web", "completion"}
"""They serve until they are ended, or print what a shell reads; `export` writes files."""
OF_FILES = {"export"}


def has_json(command: click.Command) -> bool:
    return any("--json" in parameter.opts for parameter in command.params)


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
def test_a_reading_command_gives_one_json_document(shm: Shm, bridge: Workspace, line: str) -> None:
    ended = shm("--workspace", bridge.folder, *line.split(), "--json")
    assert ended.code in (0, 1, 4), ended.err
    if ended.code == 4:
        assert ended.out == ""
    else:
        assert isinstance(parsed(ended.out), dict)


@pytest.mark.parametrize("line", ["ingest --peek {}", "select {} --models beam1 --samples 200",
                                  "update {} --model beam1 --samples 200"])  # fmt: skip
def test_a_command_on_a_file_gives_one_json_document(
    shm: Shm, modes_file: Path, hanger_file: Path, line: str
) -> None:
    words = line.format(modes_file).split()
    described = [] if "--peek" in words else ["--hanger-file", hanger_file]
    ended = shm(*words, *described, "--json")
    assert ended.code == 0, ended.err
    assert isinstance(parsed(ended.out), dict)


def test_writing_commands_say_what_they_did(
    shm: Shm, empty: Workspace, hanger_file: Path, tmp_path: Path
) -> None:
    def of(*words: object) -> Any:
        ended = shm("--workspace", empty.folder, *words, "--json")
        assert ended.code == 0, ended.err
        return parsed(ended.out)

    made = of("init", tmp_path / "arch")
    assert Path(made["description"]).is_file()
    token = of("token", "create", "logger", "--scope", "write")
    assert token["name"] == "logger"
    assert token["token"]
    assert of("token", "revoke", "logger") == {"name": "logger", "revoked": True}
    assert of("db", "upgrade")["upgraded"] is True
    simulated = of(
        "simulate", "--hanger-file", hanger_file, "--hits", 1, "--out", tmp_path / "made"
    )
    assert all(Path(file).is_file() for file in simulated["files"])
    write_test(tmp_path / "t1.modes.json", empty)
    of("ingest", tmp_path / "t1.modes.json")
    fetched = of("archive", "fetch", 1)
    assert fetched == {"recording": 1, "file": "t1.modes.json", "from": None}
