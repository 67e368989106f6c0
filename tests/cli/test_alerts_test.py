"""`shm alerts test`: the same way as every alert, marked, kept nowhere."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from shm.store import Workspace
from tests.cli.conftest import Shm
from tests.helpers.listeners import Answer, Listener, a_listener
from tests.helpers.workspaces import make_workspace


@pytest.fixture
def listener() -> Iterator[Listener]:
    with a_listener() as listener:
        yield listener


@pytest.fixture
def hooked(tmp_path: Path, listener: Listener) -> Workspace:
    """Return a workspace with a command hook `mail` and a webhook `ops`."""
    workspace = make_workspace(
        tmp_path / "bridge", hooks={"mail": ["tee", "told.json"], "none": ["/no/such/program"]}
    )
    described = Path(workspace.bridge.source)
    hook = f'\n[[hook]]\nname = "ops"\nurl = "{listener.url}"\nsecret_file = "secret"\n'
    described.write_text(described.read_text() + hook)
    (workspace.folder / "secret").write_text("not for everyone")
    return workspace


def test_a_test_alert_says_that_it_is_one(shm: Shm, hooked: Workspace) -> None:
    ended = shm("--workspace", hooked.folder, "alerts", "test", "--hook", "mail")
    assert ended.code == 0
    assert "The hook mail took the test alert in" in ended.out
    told = json.loads((hooked.folder / "told.json").read_text())
    assert re.fullmatch(r"test:mail:20\d\d-\d\d-\d\dT[\d:.]+Z", told["key"])
    assert (told["kinds"], told["drifts"]) == (["test"], [])
    assert "This is a test of the hook mail of Test bridge." in told["message"]
    assert "Nothing has happened" in told["message"]


def test_a_test_alert_leaves_nothing_in_the_store(shm: Shm, hooked: Workspace) -> None:
    before = (hooked.folder / "shm.db").read_bytes()
    shm("--workspace", hooked.folder, "alerts", "test", "--hook", "mail")
    assert (hooked.folder / "shm.db").read_bytes() == before
    assert shm("--workspace", hooked.folder, "alerts", "--json").document["alerts"] == []


def test_a_webhook_is_tested_while_the_daemon_holds_the_workspace(
    shm: Shm, hooked: Workspace, listener: Listener
) -> None:
    with hooked.lock():
        ended = shm("alerts", "test", "--hook", "ops", "--json", "--workspace", hooked.folder)
    assert ended.code == 0
    assert (ended.document["kind"], ended.document["answer"]) == ("webhook", "200 OK")
    assert listener.told[0].headers["Idempotency-Key"] == ended.document["key"]


@pytest.mark.parametrize(("status", "remedy"), [(503, "its server runs"), (401, "its secret")])
def test_a_hook_that_does_not_take_the_test_gives_an_error_with_a_remedy(
    shm: Shm, hooked: Workspace, listener: Listener, status: int, remedy: str
) -> None:
    listener.answer = lambda told: Answer(status, b"not today")
    ended = shm("--workspace", hooked.folder, "alerts", "test", "--hook", "ops", "--json")
    assert (ended.code, ended.document["error"]) == (1, "failed")
    assert f"answered {status}: not today" in ended.err
    assert remedy in ended.err
    assert len(listener.told) == 1  # tried once


def test_a_program_that_is_not_there_is_an_error(shm: Shm, hooked: Workspace) -> None:
    ended = shm("--workspace", hooked.folder, "alerts", "test", "--hook", "none")
    assert ended.code == 1
    assert "Check its path." in ended.err


def test_a_hook_that_is_not_described_is_named_with_those_that_are(
    shm: Shm, hooked: Workspace
) -> None:
    ended = shm("--workspace", hooked.folder, "alerts", "test", "--hook", "pager")
    assert ended.code == 2
    assert "no hook pager (known: mail, none, ops)" in ended.err
    assert shm("--workspace", hooked.folder, "alerts", "test").code == 2


def test_alerts_takes_the_workspace_before_and_after_its_name(shm: Shm, hooked: Workspace) -> None:
    for call in (
        ("--workspace", hooked.folder, "alerts"),
        ("alerts", "--workspace", hooked.folder),
    ):
        assert shm(*call).out.strip() == "No alert has been raised."
