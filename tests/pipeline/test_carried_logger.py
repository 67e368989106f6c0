"""A logger whose profile names one hanger is carried to another without a word."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from shm.pipeline.importing import Answers, keep_profile, look_into
from shm.read import write
from shm.simulate import HammerPlan, HangerState, hammer_test
from shm.store import Stage, Workspace
from shm.store.recordings import list_holds, list_recordings
from tests.helpers.flows import ingest
from tests.helpers.workspaces import START, make_workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Hanger 4 is 9 m long, hanger 3 has 12 m."""
    made = make_workspace(tmp_path / "bridge", hangers=(3, 4))
    path = made.folder / "bridge.toml"
    head, own = path.read_text().split("id = 4")
    path.write_text(f"{head}id = 4{own.replace('length_m = 12.0', 'length_m = 9.0')}")
    return made.reopened()


def record(path: Path, workspace: Workspace, hanger: int, day: float = 0.0) -> Path:
    """A hammer test of a hanger, in a file that names none."""
    plan = HammerPlan(hits=3, seconds_per_hit=8.0)
    state, rng = HangerState(tension_n=700e3), np.random.default_rng(hanger)
    time = START + timedelta(days=day)
    made = hammer_test(workspace.bridge.hanger(hanger), state, plan, rng, time=time)
    write(replace(made, hanger=None), path)
    return path


def imported(workspace: Workspace, path: Path, *, each_time: bool = False) -> None:
    found = look_into(path, workspace, Answers(hanger=3))
    assert found.is_ready
    keep_profile(found, workspace, each_time=each_time)


@pytest.mark.usefixtures("doubts_of_bars")
def test_modes_of_another_hanger_are_held_and_the_profile_is_named(workspace: Workspace) -> None:
    imported(workspace, record(workspace.folder / "first.csv", workspace, 3))
    record(workspace.spool / "second.csv", workspace, 3)
    record(workspace.spool / "third.csv", workspace, 4, day=-20_000.0)  # by a dead clock
    ingest(workspace)
    with workspace.store() as store:
        own, carried = list_recordings(store)
        assert (own.stage, own.hanger) == (Stage.DONE, 3)
        assert carried.stage is Stage.HELD
        (hold,) = list_holds(store, 3)
    early, doubt = [each for test in hold.tests for each in test.doubts]
    assert (early.check, doubt.check) == ("clock before the bridge", "right hanger")
    assert "fit hanger 4 rather than hanger 3" in doubt.state
    (profile,) = (workspace.folder / "loggers").iterdir()
    assert f"loggers/{profile.name} books all files of its logger to hanger 3" in doubt.why
