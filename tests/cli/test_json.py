"""`--json` is there wherever a script would call, and what it gives is JSON."""

from __future__ import annotations

import json
import re
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


@pytest.mark.parametrize(
    ("line", "schema"), [("status", "shm.status/1"), ("status --of 1", "shm.recording_stages/1")]
)
def test_status_has_a_schema_per_shape(shm: Shm, bridge: Workspace, line: str, schema: str) -> None:
    ended = shm("--workspace", bridge.folder, *line.split(), "--json")
    assert parsed(ended.out)["schema"] == schema


@pytest.mark.parametrize("line", READING)
def test_a_reading_command_gives_one_json_document(shm: Shm, bridge: Workspace, line: str) -> None:
    ended = shm("--workspace", bridge.folder, *line.split(), "--json")
    assert ended.code in (0, 1, 4), ended.err
    document = parsed(ended.out)
    expected = r"shm\.error/1" if ended.code == 4 else r"shm\.[a-z_-]+/\d"
    assert re.fullmatch(expected, document["schema"]), document["schema"]
    assert next(iter(document)) == "schema"


WRONG = (
    ("report --hanger 99", 4, "nothing_there"),
    ("drift --hanger 99", 4, "nothing_there"),
    ("alerts ack 99 --why x", 4, "nothing_there"),
    ("stream export h9 2026-05-01 2026-05-02 {}/x.csv", 4, "nothing_there"),
    ("report --hanger 4", 4, "nothing_there"),
    ("report --hanger three", 2, "usage"),
    ("report --since tomorrow --hanger 3", 2, "usage"),
    ("drift rebaseline --hanger 3 --since tomorrow --why x", 2, "usage"),
    ("gap adopt --hanger 3 --effect nonsense --why x", 2, "usage"),
    ("db restore {}/notes.txt", 3, "bad_input"),
    ("db restore {}/none.db", 4, "nothing_there"),
    ("ingest {}/none.csv", 2, "usage"),
)


@pytest.mark.parametrize(("line", "code", "kind"), WRONG)
def test_error_is_document_of_same_exit_code(
    shm: Shm, bridge: Workspace, tmp_path: Path, line: str, code: int, kind: str
) -> None:
    (tmp_path / "notes.txt").write_text("buy milk")
    words = ("--workspace", bridge.folder, *line.format(tmp_path).split())
    assert shm(*words).code == code
    ended = shm(*words, "--json")
    document = parsed(ended.out)
    assert (ended.code, document["exit_code"], document["error"]) == (code, code, kind)
    assert document["schema"] == "shm.error/1"
    assert len(document["message"]) > 8
    assert len(document["remedy"]) > 8
    assert " ".join(document["message"].split())[:20] in " ".join(ended.err.split())


@pytest.mark.parametrize("line", READING)
def test_exit_code_is_the_same_with_json(shm: Shm, empty: Workspace, line: str) -> None:
    words = ("--workspace", empty.folder, *line.split())
    assert shm(*words).code == shm(*words, "--json").code


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
    assert of("token", "revoke", "logger") == {
        "schema": "shm.token_revoke/1",
        "name": "logger",
        "revoked": True,
    }
    assert of("db", "upgrade")["upgraded"] is True
    simulated = of(
        "simulate", "--hanger-file", hanger_file, "--hits", 1, "--out", tmp_path / "made"
    )
    assert all(Path(file).is_file() for file in simulated["files"])
    write_test(tmp_path / "t1.modes.json", empty)
    of("ingest", tmp_path / "t1.modes.json")
    fetched = of("archive", "fetch", 1)
    assert fetched == {
        "schema": "shm.archive_fetch/1",
        "recording": 1,
        "file": "t1.modes.json",
        "from": None,
    }
