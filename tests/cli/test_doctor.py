"""`shm doctor` and what an operator sees at a glance in `shm status`."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from shm.store import Workspace
from shm_daemon.heartbeat import beat
from tests.cli.conftest import Shm


def test_without_a_fault_the_exit_code_is_0(shm: Shm, empty: Workspace) -> None:
    ended = shm("--workspace", empty.folder, "doctor")
    assert ended.code == 0
    assert "warning  hooks" in ended.out
    assert "-> See docs/alerts.md." in ended.out
    assert ended.out.splitlines()[-1].startswith("faults: 0, warnings: ")


def test_a_store_that_cannot_be_used_is_exit_code_5(shm: Shm, empty: Workspace) -> None:
    empty.database.write_bytes(b"")
    ended = shm("--workspace", empty.folder, "doctor", "--json")
    assert (ended.code, ended.err) == (5, "")
    assert ended.document["worst"] == "fault"
    (store,) = [each for each in ended.document["findings"] if each["check"] == "store"]
    assert store["level"] == "fault"
    assert store["remedy"] == "Run `shm db upgrade`."


@pytest.mark.parametrize("harm", ["no description", "no folder", "no archive"])
def test_another_fault_is_exit_code_1(shm: Shm, empty: Workspace, harm: str) -> None:
    if harm == "no description":
        (empty.folder / "bridge.toml").unlink()
    else:
        shutil.rmtree(empty.folder if harm == "no folder" else empty.folder / "archive")
    ended = shm("--workspace", empty.folder, "doctor")
    assert (ended.code, ended.err) == (1, "")
    assert "fault" in ended.out


def test_a_bridge_with_a_history_is_examined(shm: Shm, bridge: Workspace) -> None:
    ended = shm("--workspace", bridge.folder, "doctor", "--json")
    levels = {each["check"]: each["level"] for each in ended.document["findings"]}
    assert (ended.code, levels["store"], levels["raw files"]) == (0, "ok", "ok")


def test_status_shows_the_daemon_the_queue_and_what_is_open(shm: Shm, empty: Workspace) -> None:
    call = ("--workspace", empty.folder, "status")
    document = shm(*call, "--json").document
    assert document["daemon"] == {"active": None, "seen_at": None, "failed": None}
    assert (document["under_way"], document["open_alerts"]) == (0, 0)
    assert document["disk_free_bytes"] > 0
    assert "daemon: none active, never seen" in shm(*call).out
    with empty.lock():
        beat(empty)
        assert shm(*call, "--json").document["daemon"]["active"].startswith("process ")
        assert " ago" in shm(*call).out


def test_status_counts_open_alerts_of_each_hanger(shm: Shm, bridge: Workspace) -> None:
    document = shm("--workspace", bridge.folder, "status", "--json").document
    assert document["open_alerts"] == 2
    assert [row["open_alerts"] for row in document["hangers"]] == [2, 0]
    assert document["hangers"][0]["baseline_since"] is not None


def test_the_daemon_prints_its_unit_and_does_not_begin(shm: Shm, empty: Workspace) -> None:
    ended = shm("--workspace", empty.folder, "daemon", "--standby", "--workers", 2, "--print-unit")
    assert ended.code == 0
    assert ended.out == ended.out.rstrip() + "\n"  # as a file is kept
    assert "ExecStart=/usr/bin/env shm daemon --standby --workers 2" in ended.out.splitlines()
    assert f"Environment=SHM_WORKSPACE={empty.folder}" in ended.out.splitlines()
    assert not (empty.folder / "daemon.heartbeat").exists()


def test_the_daemon_logs_to_a_file_that_is_named(
    shm: Shm, empty: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[tuple[object, ...]] = []
    monkeypatch.setattr("shm_daemon.logs.begin_logging", lambda *given: begun.append(given))
    monkeypatch.setattr("shm_daemon.loop.run", lambda *given, **named: None)
    monkeypatch.setenv("SHM_LOG_FORMAT", "json")
    log = tmp_path / "shm.log"
    assert shm("--workspace", empty.folder, "daemon", "--log-file", log).code == 0
    ((settings, file),) = begun
    assert (getattr(settings, "log_format", None), file) == ("json", log)
