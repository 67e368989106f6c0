"""A threshold judges the stored tests at once; one that is put back takes back its alert."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.pipeline.watching import differences
from shm.store import Stage, StoredAlert, Workspace
from shm.store.recordings import count_stages
from shm.store.tests import list_waiting_tests
from shm.store.watch import find_latest_watches
from tests.helpers.flows import Clock, Postman, a_flow, ingest, receive_all
from tests.helpers.workspaces import make_workspace, write_loss, write_slow_loss, write_test

KEY = "hanger.3.thresholds.tension_shift_fraction"


def changed(
    workspace: Workspace, key: str, value: float | None, postman: Postman | None = None
) -> tuple[StoredAlert, ...]:
    """The alerts of changes after a setting has changed and the flow has gone on with it."""
    with a_flow(workspace, clock=Clock(), notifier=postman) as flow:
        workspace.change_setting(flow.store, key, value, flow.clock(), "Meier")
        flow.use(workspace.reopened())
        flow.drain()
        counts = count_stages(flow.store)
        assert sum(counts.values()) == counts[Stage.DONE]
        return tuple(
            each
            for each in flow.store.alerts.list_all()
            if "repeat the test" not in each.alert.kinds
        )


@pytest.mark.parametrize("write", [write_loss, write_slow_loss])
def test_a_lower_threshold_raises_at_once_and_put_back_closes_it(
    workspace: Workspace, write: object
) -> None:
    assert callable(write)
    write(workspace.spool, workspace)
    with workspace.store() as store:
        workspace.change_setting(store, KEY, 0.5, Clock()(), "Meier")
    ingest(workspace.reopened())
    postman = Postman()
    before = {each.id for each in changed(workspace, KEY, 0.45) if not each.resolution}
    *_, raised = changed(workspace, KEY, 0.05, postman)
    assert raised.id not in before
    assert "beyond threshold" in raised.alert.kinds
    assert "judged again" in raised.alert.message
    assert ("mail", raised.alert.key) in postman.told
    after = changed(workspace, KEY, 0.5)
    closed = {each.id: each.resolution for each in after}[raised.id]
    assert closed is not None
    assert closed.why.startswith("judged again with the thresholds in force (tension 50 %")
    again = changed(workspace, KEY, 0.05)
    standing = [each for each in again if not each.resolution and each.id not in before]
    assert len(standing) == 1


def test_all_hangers_are_judged_again_new_tests_too_and_a_kill_loses_nothing(
    tmp_path: Path,
) -> None:
    bridge = make_workspace(tmp_path / "bridge", hangers=(1, 2))
    for hanger in (1, 2):
        for number in range(4):
            path = bridge.spool / f"h{hanger}-{number}.modes.json"
            write_test(path, bridge, hanger=hanger, day=number)
    ingest(bridge)
    with bridge.store() as store:
        bridge.change_setting(store, "settings.false_call_years", 50.0, Clock()(), "Meier")
    bridge = bridge.reopened()

    with a_flow(bridge) as killed:
        killed.advance()
        waiting = list_waiting_tests(killed.store)
        assert [test.hanger for test in waiting] == [1] * 3 + [2] * 3  # but the baselines'
    with a_flow(bridge) as flow:
        write_test(bridge.spool / "h2-4.modes.json", bridge, hanger=2, day=9)
        receive_all(flow)
        flow.drain()
        settings, stored = bridge.settings, find_latest_watches(flow.store)
        assert len(flow.store.watch.list_all(2)) == 4
        for hanger in bridge.bridge.hangers:
            assert not list(differences(stored[hanger.id], hanger, settings))
            assert all(
                each.watched.change.limit_years == 50.0
                for each in flow.store.watch.list_all(hanger.id)
            )
        assert not list_waiting_tests(flow.store)
