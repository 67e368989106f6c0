"""Worlds are an independent truth: they share no physics with the product."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers.imports import imported_names

WORLDS = Path(__file__).parent
FOREIGN = sorted(path for path in WORLDS.glob("*.py") if not path.name.startswith("test_"))
OURS = sorted(
    path for path in (WORLDS / "simulated").rglob("*.py") if not path.name.startswith("test_")
)
SHARED = (
    "shm.errors",
    "shm.simulate.HammerPlan",
    "shm.simulate.HangerState",
    "shm.simulate.PlantedEffect",
    "shm.simulate.hammer.sensor_lines",
    "shm.simulate.response",
    "shm.simulate.state",
    "shm.values",
)
"""Nouns, plans, hits and what a logger makes of a signal: none of it knows how a bar moves."""


@pytest.mark.parametrize("path", FOREIGN, ids=lambda path: path.name)
def test_a_foreign_world_imports_nothing_of_the_product(path: Path) -> None:
    assert not {each for each in imported_names(path) if each.split(".")[0].startswith("shm")}


def test_our_own_world_takes_no_physics_from_the_product() -> None:
    assert len(OURS) > 15
    for path in OURS:
        found = {each for each in imported_names(path) if each.startswith("shm")}
        assert not {each for each in found if not each.startswith(SHARED)}, path
