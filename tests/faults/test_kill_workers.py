"""Workers that are killed at work refuse no healthy file; the long form is a benchmark."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import pytest

from shm.pipeline import flow
from shm.store import Stage
from tests.helpers.worker_killing import kill_workers, stage_counts
from tests.helpers.workspaces import make_workspace


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="uses the process numbers of workers")
def test_healthy_files_outlive_the_kills_of_their_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flow, "_FIRST_PAUSE_S", 0.1)  # the pauses before each next try
    workspace = make_workspace(tmp_path / "bridge", settings={"workers": 2})
    struck = kill_workers(workspace, files=3, kills=6, rng=random.Random(1), most_s=300)
    assert struck == 6
    assert stage_counts(workspace) == {Stage.DONE: 3}
    assert list(workspace.quarantine.folder.iterdir()) == []
