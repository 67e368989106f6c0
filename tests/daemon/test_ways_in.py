"""Web interface and messages beside a daemon: what dies there stops nobody, and is not lost."""

from __future__ import annotations

import http.client
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import httpx
import pytest

from shm.documents import dump
from shm.errors import UsageError
from shm.modes_document import modes_document
from shm.store import Stage, Workspace
from shm.store.recordings import count_stages
from shm_daemon.web.address import Address
from shm_daemon.web.serving import web_with_daemon
from tests.helpers.brokers import a_broker
from tests.helpers.daemons import ROOT, quick_daemons, until_serving
from tests.helpers.slow import few_of
from tests.helpers.waiting import until
from tests.helpers.workspaces import make_workspace, modelled_test

ALONE = """
import sys, time
from pathlib import Path
from shm.store import Workspace
from shm_daemon.web.address import Address
from shm_daemon.web.serving import web_with_daemon
workspace, address = Workspace.open(sys.argv[1]), Address(port=int(sys.argv[2]))
with web_with_daemon(workspace, address, Path(sys.argv[3])):
    time.sleep(300)
"""
ENDED = """
import multiprocessing, os, signal
from shm_daemon.web.address import Address
from shm_daemon.web.serving import ending_in_order, make_server
held = multiprocessing.get_context("forkserver").Lock()
async def app(scope, receive, send):
    await receive()
    await send({"type": "lifespan.startup.complete"})
    os.kill(os.getpid(), signal.SIGTERM)
    await receive()
    await send({"type": "lifespan.shutdown.complete"})
with ending_in_order():
    make_server(app, Address(port=0)).run()
"""
ENVIRONMENT = {**os.environ, "PYTHONPATH": ".:daemon"}


def answers(port: int) -> bool:
    asked = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    with closing(asked):
        try:
            asked.request("GET", "/health")
            asked.getresponse()
        except (OSError, http.client.HTTPException):
            return False
    return True


def servers_of(workspace: Workspace) -> list[int]:
    """Return processes that serve the workspace's web interface."""
    mark = f"shm_daemon.web\0{workspace.folder}".encode()
    found = []
    for folder in Path("/proc").iterdir():
        try:
            command = (folder / "cmdline").read_bytes() if folder.name.isdigit() else b""
        except OSError:
            continue
        if mark in command:
            found.append(int(folder.name))
    return found


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="needs /proc")
def test_a_web_interface_that_dies_comes_again_and_ends_with_its_daemon(
    workspace: Workspace,
) -> None:
    taken = socket.create_server(("127.0.0.1", 0))
    port = taken.getsockname()[1]
    log = workspace.folder / "daemon.log"
    command = [sys.executable, "-c", ALONE, str(workspace.folder), str(port), str(log)]
    with taken, subprocess.Popen(command, cwd=ROOT, env=ENVIRONMENT) as owner:
        try:
            until(lambda: servers_of(workspace))
            until(lambda: not servers_of(workspace))  # it could not have the port
            taken.close()
            until(lambda: answers(port))
            assert owner.poll() is None
            web_log = workspace.folder / "daemon.web.log"
            until(lambda: "GET '/health'" in web_log.read_text())  # told after it is answered
        finally:
            owner.kill()
    until(lambda: not servers_of(workspace))


def test_what_its_processes_hold_is_given_back_when_it_is_ended() -> None:
    command = [sys.executable, "-c", ENDED]
    ended = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_it_does_not_open_to_others_without_a_token(workspace: Workspace) -> None:
    with (
        pytest.raises(UsageError, match="no token"),
        web_with_daemon(workspace, Address("0.0.0.0")),
    ):
        pass


@pytest.mark.slow
def test_messages_outlast_killed_daemons_and_each_is_stored_once(tmp_path: Path) -> None:
    messages, kills = 8, 2
    with a_broker() as broker:
        workspace = make_workspace(tmp_path / "bridge", settings={"mqtt_url": broker.url})
        hanger = workspace.bridge.hangers[0]
        with quick_daemons(workspace.folder) as daemons:
            until_serving(daemons.begin(), workspace.folder)
            time.sleep(1.0)  # the broker knows us from now on
            for number in range(messages):
                test = modelled_test(f"t{number}", hanger, day=number)
                content = dump(modes_document([test])).encode()
                broker.publish(f"shm/test-bridge/3/t{number}.modes.json", content)
                if number % 3 == 2 and number // 3 < kills:
                    pid = int((workspace.folder / "shm.lock").read_text())
                    assert daemons.kill(pid) == -signal.SIGKILL
                    until_serving(daemons.begin(), workspace.folder)
            with workspace.store() as store:
                until(lambda: count_stages(store)[Stage.DONE] == messages)
                assert sum(count_stages(store).values()) == messages
            daemons.kill(int((workspace.folder / "shm.lock").read_text()))


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize("page", few_of(["", "/static/shm.css"], 1))
def test_it_answers_within_seconds_of_work_and_sigterm_ends_it_without_a_word_of_python(
    workspace: Workspace, page: str
) -> None:
    """At the moment that `/health` answers, while pages are loaded, and once one was shown."""
    shm = "from shm_cli.main import main; main()"
    environment = {**os.environ, "PYTHONPATH": ".:daemon:cli"}
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ["--workspace", str(workspace.folder), "daemon", "--web", "--port", str(port)]
    daemon = subprocess.Popen(
        [sys.executable, "-c", shm, *words],
        cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    with daemon:
        try:
            until(lambda: answers(port))
            (server,) = servers_of(workspace)
            assert processor_s(server) < 5.0
            if page:
                httpx.get(f"http://127.0.0.1:{port}{page}", timeout=90, trust_env=False)
            lock = workspace.folder / "shm.lock"
            until(lambda: lock.exists() and lock.read_text())
        finally:
            daemon.terminate()
            said = daemon.communicate(timeout=60)[1]
    assert daemon.returncode == 0, said
    assert "Fatal" not in said
    assert "Traceback" not in said
    until(lambda: not servers_of(workspace))


def processor_s(process: int) -> float:
    """How long a process has been computing, in s."""
    told = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")
