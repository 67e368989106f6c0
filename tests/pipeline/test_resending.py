"""An alert that a failing hook was given up for is sent again, once somebody asks for it."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from shm.store import DeliveryState, Workspace
from shm_cli.main import run
from tests.helpers.flows import Clock, Postman, a_flow, ingest
from tests.helpers.workspaces import START, make_workspace, write_loss

AT = START + timedelta(days=200)


@pytest.fixture
def given_up(tmp_path: Path) -> Workspace:
    """A bridge whose only hook fails at its only try, of two alerts."""
    workspace = make_workspace(
        tmp_path / "bridge", hooks={"mail": ["true"]}, settings={"hook_attempts": 1}
    )
    write_loss(workspace.spool, workspace)
    ingest(workspace, notifier=Postman(failures=9))
    return workspace


def states(workspace: Workspace) -> list[tuple[DeliveryState, int]]:
    with workspace.store() as store:
        return [(each.state, each.attempts) for each in store.alerts.list_deliveries()]


def test_what_was_given_up_waits_again_and_is_told_once(given_up: Workspace) -> None:
    assert states(given_up) == [(DeliveryState.GIVEN_UP, 1)] * 2
    with given_up.store() as store:
        first = store.alerts.list_all()[0]
        (owed,) = store.alerts.resend(first.id, AT)
    assert (owed.hook, owed.state, owed.attempts) == ("mail", DeliveryState.WAITING, 0)
    postman = Postman()
    with a_flow(given_up, clock=Clock(AT + timedelta(minutes=1)), notifier=postman) as flow:
        flow.drain()
        flow.drain()
    key = first.alert.key  # a notice, which the second alert has answered
    assert postman.told == [("mail", key), ("mail", f"{key}:resolved")]
    told, given = (DeliveryState.DELIVERED, 1), (DeliveryState.GIVEN_UP, 1)
    assert states(given_up) == [told, given, told]


def test_the_list_says_why_a_hook_was_not_told_and_the_command_sends_it_again(
    given_up: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    at = ["--workspace", str(given_up.folder), "alerts"]
    assert run(at) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "The hook mail was not notified: given up after one try, no answer" in said
    assert "`shm alerts resend 2`" in said
    assert run([*at, "resend", "2"]) == 0
    assert "Alert 2 is owed again to mail" in capsys.readouterr().out
    assert [state for state, _ in states(given_up)] == [
        DeliveryState.GIVEN_UP, DeliveryState.WAITING,
    ]  # fmt: skip
