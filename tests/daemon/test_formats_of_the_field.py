"""Files of the field's loggers and programs go from the spool through a daemon to a tension."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shm_daemon
from shm.read.base import PeekChannel
from shm.read.sidecar import write_sidecar
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Stage
from shm.store.recordings import list_recordings
from tests.helpers.flows import Clock, threads
from tests.helpers.workspaces import START, make_workspace
from tests.helpers.written import write


@pytest.mark.parametrize("suffix", [".tob3", ".json"])
def test_daemon_reads_formats_of_field(tmp_path: Path, suffix: str) -> None:
    workspace = make_workspace(tmp_path / "bridge", settings={"samples": 200, "workers": 1})
    plan = HammerPlan(hits=3, seconds_per_hit=6.0)
    state = HangerState(tension_n=690e3, damping_ratio=0.002)
    hanger = workspace.bridge.hanger(3)
    made = hammer_test(hanger, state, plan, np.random.default_rng(5), time=START)
    made = replace(made, hanger=3)
    path = workspace.spool / f"hanger3{suffix}"
    if suffix == ".tob3":  # a Campbell table knows neither planes nor places
        said = [PeekChannel(c.name, c.quantity, "", c.plane, c.x_m) for c in made.channels]
        write_sidecar(made, said, np.nan, path)
    write(made, path)

    shm_daemon.run(workspace, clock=Clock(), once=True, make_executor=threads)

    assert list(workspace.spool.iterdir()) == []
    with workspace.store() as store:
        (stored,) = list_recordings(store)
        assert (stored.stage, stored.hanger) == (Stage.DONE, 3), stored
        (test,) = store.tests.list_all(3)
        assert (test.test.id, test.time) == ("hanger3", START)
        low, high = np.quantile(store.posteriors.get(3).tension_n, [0.005, 0.995])
    assert low < 690e3 < high
    assert (high - low) / 690e3 < 0.15
