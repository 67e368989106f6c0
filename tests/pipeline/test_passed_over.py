"""What was compared with nothing is no quiet, and what was discarded is no alarm."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from shm.pipeline import utc_now
from shm.pipeline.bridge_reporting import hanger_summaries
from shm.report.hanger_status import HangerMessage, Status
from shm.store import Workspace
from shm.store.recordings import find_recording
from tests.helpers import quick_update
from tests.helpers.flows import ingest
from tests.helpers.taken_in import with_a_slow_loss
from tests.helpers.workspaces import START, make_workspace, write_test


def message(workspace: Workspace) -> HangerMessage:
    with workspace.store() as store:
        (line,) = hanger_summaries(workspace, store, utc_now(), [workspace.bridge.hanger(3)])
    return line.message


def test_a_test_of_a_maintenance_window_leaves_the_hanger_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick_update.stand_in(monkeypatch.setattr)
    workspace = make_workspace(tmp_path / "bridge")
    for number in range(3):
        write_test(workspace.spool / f"t{number}.modes.json", workspace, day=10 * number)
    ingest(workspace)
    assert message(workspace).status is Status.STEADY
    now = utc_now()
    period = (START + timedelta(days=25), now + timedelta(days=9))
    with workspace.store() as store:
        store.silences.make(3, period, "Ada", "new joints", now, is_maintenance=True)
    write_test(workspace.spool / "works.modes.json", workspace, day=30, tension=0.9)
    ingest(workspace)
    found = message(workspace)
    assert found.status is Status.CHECK
    assert found.lead.state.endswith("and is not compared with the baseline.")
    assert found.urgency == "week"


def test_the_alert_of_a_discarded_test_ends(tmp_path: Path) -> None:
    workspace = with_a_slow_loss(tmp_path / "bridge")
    with workspace.store() as store:
        (alert,) = store.alerts.list_all(3, standing=True)
        recording, _ = find_recording(store, alert.alert.test)
        store.recordings.exclude(recording, "Ada", "of another hanger", utc_now())
        assert store.alerts.list_all(3, standing=True) == ()
        ended = store.alerts.get(alert.id).resolution
    assert ended is not None
    assert "test discarded by Ada: of another hanger" in str(ended)
    assert message(workspace).status is not Status.ALERT
