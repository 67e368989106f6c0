"""A recording as a logger writes it goes through the real reader, identifier and sampler.

Problem: a clamped hanger under 690 kN is hit four times; nothing but the file is known.
Solution: the tension planted by the simulation, which shares no code with the model class.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shm.read import write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Stage
from shm.store.recordings import list_recordings
from shm.store.tests import load_frequency_response
from tests.helpers.flows import ingest
from tests.helpers.slow import few_of
from tests.helpers.workspaces import START, make_workspace


@pytest.mark.usefixtures("real_sampler")
@pytest.mark.parametrize("suffix", few_of([".csv", ".uff"], 1))
def test_a_recording_gives_the_tension_that_was_planted(tmp_path: Path, suffix: str) -> None:
    workspace = make_workspace(tmp_path / "bridge", settings={"samples": 500})
    hanger = workspace.bridge.hanger(3)
    plan = HammerPlan(hits=4, seconds_per_hit=10.0)
    state = HangerState(tension_n=690e3, damping_ratio=0.002)
    recording = hammer_test(hanger, state, plan, np.random.default_rng(5), time=START)
    write(replace(recording, hanger=3), workspace.spool / f"hanger3{suffix}")
    ingest(workspace)
    assert list(workspace.spool.iterdir()) == []
    with workspace.store() as store:
        (stored,) = list_recordings(store)
        assert (stored.stage, stored.hanger) == (Stage.DONE, 3)
        (test,) = store.tests.list_all(3)
        assert (test.test.id, test.time) == ("hanger3", START)
        low, high = np.quantile(store.posteriors.get(3).tension_n, [0.005, 0.995])
        assert low < 690e3 < high
        assert (high - low) / 690e3 < 0.1
        response = load_frequency_response(store, test)
        assert response is not None
        assert len(response.points) == 4
