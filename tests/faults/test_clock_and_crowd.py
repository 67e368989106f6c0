"""The clock jumps back, files come by the thousand, the file system tells nothing."""

from __future__ import annotations

import os
from datetime import timedelta
from pathlib import Path

import pytest

from shm.store import Stage, Workspace
from shm.store.journal import list_steps
from shm.store.posteriors import list_history
from shm.store.recordings import count_stages
from shm_daemon.spool import FileStabilityTracker, scan
from tests.helpers import quick_update
from tests.helpers.flows import Clock, a_flow, receive_all
from tests.helpers.workspaces import make_workspace, write_test


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    quick_update.stand_in(monkeypatch.setattr)
    return make_workspace(tmp_path / "bridge")


def test_a_clock_that_jumps_back_holds_nothing_up(workspace: Workspace) -> None:
    clock = Clock()
    with a_flow(workspace, clock=clock) as flow:
        for day in range(3):
            write_test(workspace.spool / f"t{day}.modes.json", workspace, day=day)
            receive_all(flow)
            clock.now -= timedelta(days=1)
            flow.drain()
        assert count_stages(flow.store)[Stage.DONE] == 3
        assert [test.test.id for test, _ in list_history(flow.store, 3)] == ["t0", "t1", "t2"]
        stages = [step.kind for step in list_steps(flow.store, 3)]
    assert stages == ["archived", "received", *2 * ["identified"], *2 * ["updated"],
                      "watched", "done"]  # fmt: skip


def test_ten_thousand_files_are_seen_at_once_and_come_in_the_order_of_their_age(
    tmp_path: Path,
) -> None:
    for number in range(10_000):
        (tmp_path / f"{number:05}.csv").write_bytes(b"1")
    now = 0.0
    tracker = FileStabilityTracker(2.0, lambda: now)
    assert tracker.whole(scan(tmp_path)) == []
    os.utime(tmp_path / "09999.csv", ns=(0, 0))
    tracker.whole(scan(tmp_path))
    now = 3.0
    found = tracker.whole(scan(tmp_path))
    assert len(found) == 10_000
    assert found[0].name == "09999.csv"
    assert tracker.watching
