"""Hold the documents of store, flow and daemon, their schemas and exit codes.

Golden files are by `write_store_golden.py`. Keys, types, names, counts and numbers of rows are
compared as they are; clocks, paths, versions, measured numbers and words are not.

`shm db check` promises: SQLite's own check of its file, no row that refers to one that is not
there, raw files with the SHA-256 that they are named by, and the schema that the migrations make;
each fault is a finding with its place, and exit code 5.
"""

from __future__ import annotations

import shutil
import sqlite3
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shm.read.chunk_document import parse_chunk
from shm.store import Workspace
from tests.contracts import store_calls as calls
from tests.contracts.inference_calls import call

NAMES = (*calls.VERBS, "alert", "api", "paths", "reason")


@pytest.fixture(scope="module")
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    return calls.make_bridge(tmp_path_factory.mktemp("contract"))


@pytest.fixture(scope="module")
def made(bridge: Workspace) -> dict[str, Any]:
    return calls.run_all(bridge)


@pytest.fixture
def copied(bridge: Workspace, tmp_path: Path) -> Workspace:
    return Workspace.open(Path(shutil.copytree(bridge.folder, tmp_path / "bridge")))


@pytest.mark.parametrize("name", NAMES)
def test_a_document_is_that_of_the_golden_file(made: dict[str, Any], name: str) -> None:
    assert made[name] == calls.golden(name)


def test_golden_files_hold_what_was_made() -> None:
    """Look at the golden files: a wrong document would be held for ever."""
    status = calls.golden("status")["document"]
    assert status["recordings"] == {
        "received": 0, "identified": 0, "updated": 0, "watched": 0, "done": 3, "refused": 1,
        "held": 1, "discarded": 0,
    }  # fmt: skip
    assert calls.golden("alert")[0]["kinds"] == ["held"]
    assert {each["schema"] for each in calls.golden("alert")} == {"shm.alert/1"}
    (reason,) = calls.golden("reason")
    assert (reason["schema"], reason["file"]) == ("shm.reason/1", "bad.modes.json")
    checked = calls.golden("check")
    assert (checked["exit_code"], checked["document"]["findings"]) == (0, [])
    assert calls.golden("api")["/api/operation"]["recordings"] == status["recordings"]


# ---------------------------------------------------------------- db check


def break_file(workspace: Workspace) -> None:
    """Write other bytes into the middle of each page but the first."""
    with workspace.database.open("r+b") as file:
        for page in range(4096, workspace.database.stat().st_size, 4096):
            file.seek(page + 2)
            file.write(b"\xff" * 6)


def lose_referred_row(workspace: Workspace) -> None:
    """Delete a test from which a posterior was made."""
    with sqlite3.connect(workspace.database) as connection:
        connection.execute("DELETE FROM tests WHERE name = 't2'")


def change_schema(workspace: Workspace) -> None:
    """Drop an index that the migrations made."""
    with sqlite3.connect(workspace.database) as connection:
        query = "SELECT name FROM sqlite_master WHERE type = 'index' AND sql IS NOT NULL"
        (name,) = connection.execute(query).fetchone()
        connection.execute(f"DROP INDEX {name}")


def change_raw_file(workspace: Workspace) -> None:
    """Write other bytes into a raw file."""
    path = min(workspace.archive.folder.glob("??/*"))
    path.chmod(0o644)
    path.write_bytes(b"other")


@pytest.mark.parametrize("harm", [break_file, lose_referred_row, change_schema, change_raw_file])
def test_db_check_finds(copied: Workspace, harm: Any) -> None:
    harm(copied)
    ended = call("--workspace", copied.folder, "db", "check", "--archive", "--json")
    assert ended.code == 5, ended.err
    assert ended.err


# ---------------------------------------------------------------- chunks


def test_a_chunk_is_read() -> None:
    samples = struct.pack("<6f", 0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    chunk = parse_chunk(calls.CHUNK.encode() + b"\n" + samples)
    assert (chunk.stream, chunk.sequence, chunk.channels) == ("h3", 17, ("acc_1", "acc_2"))
    assert (chunk.sampling_rate_hz, chunk.temperature_c) == (200.0, 11.5)
    np.testing.assert_array_equal(chunk.values, [[0, 2, 4], [1, 3, 5]])


# ---------------------------------------------------------------- exit codes


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (4, ("alerts", "--hanger", 9)),
        (4, ("status", "--of", "nothing")),
        (4, ("ingest", "--confirm", 99)),
        (4, ("ingest", "--discard", 99, "--why", "a slip")),
        (2, ("ingest", "--discard", "t2")),
        (4, ("ingest", "--again", 99, "--from", "updated")),
        (4, ("alerts", "ack", 99, "--why", "seen")),
        (2, ("db", "check", "--unknown")),
    ],
)
def test_a_command_ends_with_its_exit_code(
    bridge: Workspace, code: int, words: tuple[object, ...]
) -> None:
    ended = call("--workspace", bridge.folder, *words)
    assert (ended.code, ended.out) == (code, ""), ended.err
    assert ended.err


def test_without_a_workspace(tmp_path: Path) -> None:
    assert call("--workspace", tmp_path, "status").code == 3
