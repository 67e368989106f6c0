"""Hooks that refuse or hang: what becomes of the delivery, and of the daemon."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from shm.bridge import Hook
from shm.store import Delivery, DeliveryState, Stage, Workspace
from shm.store.recordings import count_stages
from shm.values import Alert
from shm_daemon import Wakeup, run
from tests.helpers.flows import a_flow, threads
from tests.helpers.listeners import Answer, a_listener, a_silent_listener
from tests.helpers.outboxes import make_baseline, raise_alerts
from tests.helpers.workspaces import make_workspace


def with_webhook(folder: Path, url: str, **settings: object) -> Workspace:
    """Return a workspace whose hook `ops`, which posts to `url`, is owed an alert."""
    workspace = make_workspace(folder, settings=settings)
    described = Path(workspace.bridge.source)
    hook = f'\n[[hook]]\nname = "ops"\nurl = "{url}"\nsecret_file = "secret"\n'
    described.write_text(described.read_text() + hook)
    (workspace.folder / "secret").write_text("not for everyone")
    make_baseline(workspace)
    raise_alerts(workspace, [1], ["ops"])
    return workspace.reopened()


def outbox(workspace: Workspace) -> Delivery:
    with workspace.store() as store:
        (delivery,) = store.alerts.list_deliveries()
    return delivery


@pytest.mark.parametrize(
    ("status", "state"), [(404, DeliveryState.GIVEN_UP), (503, DeliveryState.WAITING)]
)
def test_what_a_server_refuses_is_given_up_at_once_and_what_may_pass_waits(
    tmp_path: Path, status: int, state: DeliveryState
) -> None:
    with a_listener(lambda told: Answer(status, b"no such topic")) as listener:
        workspace = with_webhook(tmp_path / "bridge", listener.url)
        run(workspace, once=True, make_executor=threads)
    delivery = outbox(workspace)
    assert (delivery.state, delivery.attempts) == (state, 1)
    assert f"answered {status}: no such topic." in delivery.last_error.replace("topic ", "topic. ")
    assert "not for everyone" not in delivery.last_error


def test_a_server_that_hangs_holds_up_neither_the_files_nor_the_end(tmp_path: Path) -> None:
    wakeup = Wakeup()
    with a_silent_listener() as url:
        workspace = with_webhook(tmp_path / "bridge", url)
        daemon = threading.Thread(
            target=run,
            args=(workspace,),
            kwargs={"wakeup": wakeup, "make_executor": threads},
        )
        daemon.start()
        for file in range(2):
            (workspace.spool / f"{file}.csv").write_text(f"nothing,{file}\n")
            until_refused(workspace, file + 1)
        assert any(thread.name.startswith("hook") for thread in threading.enumerate())
        wakeup.stop()
        daemon.join(120)
        assert not daemon.is_alive()
        assert not [t for t in threading.enumerate() if t.name.startswith("hook") and busy(t)]
    left = outbox(workspace)
    assert (left.state, left.attempts) == (DeliveryState.WAITING, 0)


def test_a_hook_that_hangs_leaves_room_for_the_others(tmp_path: Path) -> None:
    told, release = [], threading.Event()

    def notifier(hook: Hook, alert: Alert) -> None:
        if hook.name == "dead":
            release.wait(120)
        else:
            told.append(alert.key)

    hooks = {"dead": ["true"], "mail": ["true"]}
    workspace = make_workspace(tmp_path / "bridge", hooks=hooks)
    make_baseline(workspace)
    raise_alerts(workspace, range(1, 21), list(hooks))
    with a_flow(workspace, notifier=notifier) as flow:
        end = time.monotonic() + 120
        while len(told) < 20 and time.monotonic() < end:
            flow.advance()
            time.sleep(0.01)
        assert len(told) == 20
        release.set()


def until_refused(workspace: Workspace, number: int) -> None:
    end = time.monotonic() + 120
    while time.monotonic() < end:
        with workspace.store() as store:
            if count_stages(store)[Stage.REFUSED] == number:
                return
        time.sleep(0.05)
    raise TimeoutError(f"{number} files are not refused")


def busy(thread: threading.Thread) -> bool:
    """Whether a thread of the couriers is still there, given a moment."""
    thread.join(120)
    return thread.is_alive()
