"""Simulate hammer tests and ambient records of a hanger of known truth, by `shm.models`.

The independent truth of the trials, finite elements that share no code with `shm.models`, stands
in `tests/worlds`.
"""

from __future__ import annotations

from shm.simulate.ambient import AmbientPlan, ambient_test
from shm.simulate.effects import PlantedEffect
from shm.simulate.hammer import hammer_test
from shm.simulate.state import HammerPlan, HangerState, spread_places_m
