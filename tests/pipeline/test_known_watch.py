"""States over time rest on what the watch has said, and are those of a watch that begins anew."""

from __future__ import annotations

import numpy as np
import pytest

from shm.pipeline.reporting import hanger_states
from shm.store import Workspace
from shm.watch.watcher import Watcher
from tests.helpers.flows import ingest
from tests.helpers.workspaces import write_slow_loss


def test_no_stored_test_is_judged_again_for_the_states(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_slow_loss(workspace.spool, workspace)
    ingest(workspace)
    with workspace.store() as store:
        hanger, baseline = workspace.bridge.hanger(3), store.watch.baseline(3)
        with monkeypatch.context() as patch:
            patch.setattr(store.watch, "list_all", lambda *_: ())
            anew = hanger_states(workspace, store, hanger, baseline)
        monkeypatch.setattr(Watcher, "after", None)  # who calls it fails
        known = hanger_states(workspace, store, hanger, baseline)
    assert known.changes == anew.changes
    assert known.changes
    assert np.array_equal(known.outlier, anew.outlier)
    for ours, other in zip(known.quantities, anew.quantities, strict=True):
        assert np.array_equal(ours.smoothed.middle, other.smoothed.middle, equal_nan=True)
