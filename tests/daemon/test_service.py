"""The daemon as a service of systemd: its unit, and the signs of life that it gives."""

from __future__ import annotations

import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from shm.resources import unit_file
from shm.store import Workspace
from shm_cli.main import cli
from shm_cli.services import unit_text
from shm_daemon import Wakeup, run
from tests.helpers.flows import threads
from tests.helpers.workspaces import make_workspace

SYSTEMD = shutil.which("systemd-analyze")
UNITS = ["shm.service", "shm-web.service", "shm-backup.service"]
needs_systemd = pytest.mark.skipif(SYSTEMD is None, reason="systemd-analyze is not installed")


def verified(unit: Path) -> tuple[int, str]:
    assert SYSTEMD is not None
    ended = subprocess.run(
        [SYSTEMD, "verify", unit], capture_output=True, text=True, check=False, timeout=60
    )
    return ended.returncode, ended.stdout + ended.stderr


@needs_systemd
@pytest.mark.parametrize("name", [*UNITS, "shm-dask-worker.service", "shm-backup.timer"])
def test_the_units_pass_systemds_own_check(name: str) -> None:
    assert verified(unit_file(name)) == (0, "")


@needs_systemd
def test_the_printed_unit_passes_too_with_our_paths(tmp_path: Path) -> None:
    unit = tmp_path / "shm.service"
    words = ["daemon", "--web", "--port", "8400"]
    unit.write_text(unit_text("shm.service", tmp_path, Path("/opt/arch"), words))
    assert verified(unit) == (0, "")
    lines = unit.read_text().splitlines()
    assert "ExecStart=/usr/bin/env shm daemon --web --port 8400" in lines
    assert f"ReadWritePaths={tmp_path}" in lines
    assert "Environment=PATH=/opt/arch/bin:/usr/local/bin:/usr/bin:/bin" in lines
    assert f"User={tmp_path.owner()}" in lines


@pytest.mark.parametrize("owner", ["root", "ann"])
@pytest.mark.parametrize("verb", ["daemon", "web"])
def test_print_unit_warns_of_root(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, owner: str, verb: str
) -> None:
    workspace = make_workspace(tmp_path / "bridge")
    monkeypatch.setattr(Path, "owner", lambda _: owner)
    words = ["--workspace", str(workspace.folder), verb, "--print-unit"]
    ended = CliRunner().invoke(cli, words)

    assert ended.exit_code == 0
    assert f"\nUser={owner}\n" in ended.stdout
    is_root = owner == "root"
    assert ("\n# The workspace belongs to root: better give it" in ended.stdout) == is_root
    assert ("chown -R shm" in ended.stderr) == is_root


def test_what_confines_the_daemon_confines_all() -> None:
    first, *others = ({*unit_file(name).read_text().splitlines()} for name in UNITS)
    confining = {line for line in first if line.startswith(("Protect", "Restrict", "NoNew", "Cap"))}
    assert len(confining) >= 15
    assert all(confining <= other for other in others)


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """Where systemd would listen."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
        line.bind(str(tmp_path / "notify"))
        line.settimeout(120)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        yield line


def hear(systemd: socket.socket) -> list[str]:
    return systemd.recv(4096).decode().splitlines()


def hear_until(systemd: socket.socket, word: str) -> list[str]:
    """Return the first message that holds a word."""
    end = time.monotonic() + 120
    while word not in (said := hear(systemd)):
        assert time.monotonic() < end, f"{word} never came"
    return said


def test_the_daemon_says_that_it_is_ready_lives_and_ends(
    tmp_path: Path, systemd: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though it scans its spool once an hour, it gives a sign thrice in the watchdog's time."""
    monkeypatch.setenv("WATCHDOG_USEC", "600000")
    workspace = make_workspace(tmp_path / "bridge", settings={"spool_scan_seconds": 3600.0})
    wakeup = Wakeup()
    thread = threading.Thread(
        target=run, args=(workspace,), kwargs={"wakeup": wakeup, "make_executor": threads}
    )
    thread.start()
    try:
        first = hear(systemd)
        assert {"READY=1", "WATCHDOG=1", f"STATUS=watching {workspace.spool}"} <= set(first)
        for _ in range(5):
            assert "WATCHDOG=1" in hear(systemd)
    finally:
        wakeup.stop()
        thread.join(120)
    assert "STOPPING=1" in hear_until(systemd, "STOPPING=1")


def test_a_daemon_that_fails_says_that_it_ends(
    workspace: Workspace, systemd: socket.socket
) -> None:
    workspace.database.unlink()
    with pytest.raises(Exception, match="no store"):
        run(workspace, make_executor=threads)
    assert "STOPPING=1" in hear(systemd)
