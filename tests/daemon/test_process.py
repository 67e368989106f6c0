"""The daemon as its owner begins it: a process of its own, ended by signals."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.store import Stage, Workspace
from shm.store.recordings import count_stages
from shm_daemon.__main__ import main
from tests.helpers.daemons import quick_daemons, real_daemon
from tests.helpers.waiting import until
from tests.helpers.workspaces import write_test


def log_of(workspace: Workspace) -> str:
    return (workspace.folder / "daemon.log").read_text()


def done(workspace: Workspace) -> int:
    with workspace.store() as store:
        return count_stages(store)[Stage.DONE]


def processes_of(workspace: Workspace) -> list[int]:
    """Living processes whose environment names the workspace: the daemon and all it began."""
    mark, found = f"SHM_TEST={workspace.folder}".encode(), []
    for folder in Path("/proc").iterdir():
        try:
            environment = (folder / "environ").read_bytes() if folder.name.isdigit() else b""
        except OSError:
            continue
        if mark in environment:
            found.append(int(folder.name))
    return found


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc to find processes")
def test_sigterm_ends_it_cleanly_and_a_kill_leaves_no_process_behind(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHM_TEST", str(workspace.folder))
    for day in range(4):
        write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
    with real_daemon(workspace.folder) as daemon:
        until(lambda: "identify 1: done" in log_of(workspace))  # and the next one is under way
        daemon.terminate()
        assert daemon.wait(10) == 0
    until(lambda: not processes_of(workspace))
    assert log_of(workspace).splitlines()[-1].endswith("ended")
    assert "Traceback" not in log_of(workspace)

    with real_daemon(workspace.folder) as daemon:
        until(lambda: len(processes_of(workspace)) > 2)  # itself, a helper, a worker
        daemon.kill()
        assert daemon.wait(10) == -9
    until(lambda: not processes_of(workspace))

    with quick_daemons(workspace.folder) as daemons:
        daemons.begin(once=True)
        assert daemons.ended() == 0
    assert done(workspace) == 4


@pytest.mark.parametrize(("arguments", "code"), [([], 2), (["/no/such/workspace"], 3)])
def test_a_wrong_call_says_what_to_do(
    arguments: list[str], code: int, caplog: pytest.LogCaptureFixture
) -> None:
    assert main(arguments) == code
    assert "workspace" in caplog.text.lower()
