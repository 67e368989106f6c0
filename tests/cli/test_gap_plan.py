"""`shm gap plan` on files: a table, a document, the owner's hours and a budget."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shm.documents import dump
from shm.modes_document import modes_document
from shm.simulate import HangerState, PlantedEffect
from tests.cli.conftest import Shm
from tests.helpers.effects import all_but
from tests.helpers.hangers import HANGER_3
from tests.worlds.simulated.campaign import CampaignPlan, campaign

SHORT = [
    word
    for name in all_but("bending_stiffness", "distributed_mass")
    for word in ("--without", name)
]
SOFTER = PlantedEffect("bending_stiffness", "everywhere", {"stiffness_change": -0.2})
ONE_PLANE = CampaignPlan(
    ("transverse",), 5, shapes=False, temperatures_c=(10.0,), amplitudes=(1.0,), mass_share=0.0
)


@pytest.fixture
def modes(tmp_path: Path) -> Path:
    rng = np.random.default_rng(1)
    tests = campaign(HANGER_3, HangerState(711e3), (SOFTER,), ONE_PLANE, rng)
    path = tmp_path / "t1.modes.json"
    path.write_text(dump(modes_document(tests)))
    return path


@pytest.mark.slow
def test_a_plan_goes_by_the_owners_hours_within_the_budget(
    shm: Shm, modes: Path, hanger_file: Path, tmp_path: Path
) -> None:
    own = tmp_path / "own.toml"
    own.write_text(f"{hanger_file.read_text()}\n[measurement_hours]\nknown_mass = 7\n")
    ended = shm("gap", "plan", modes, "--hanger-file", own, *SHORT, "--budget", 9, "--json")
    assert ended.code == 0, ended.err
    steps = ended.document["steps"]
    assert {step["hours"] for step in steps if step["kind"] == "known mass"} <= {7.0}
    assert steps[-1]["hours_in_all"] == sum(step["hours"] for step in steps) <= 9
    assert all(step["promised_log_odds"] > 0 for step in steps)


def test_a_plan_is_shown_as_a_table(shm: Shm, modes: Path, hanger_file: Path) -> None:
    ended = shm("gap", "plan", modes, "--hanger-file", hanger_file, *SHORT, "--baseline", "beam1")
    assert ended.code == 0, ended.err
    assert "known mass of" in ended.out
    assert "promised log odds" in ended.out
