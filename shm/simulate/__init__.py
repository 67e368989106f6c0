"""Hammer tests of a hanger in the time domain, by a discretisation of their own.

Beam finite elements and modal superposition; no code is shared with `shm.models`, so that what is
planted here and found there agrees only if both are right.
"""

from __future__ import annotations

from shm.simulate.ambient import AmbientPlan, ambient_test
from shm.simulate.disturbances import DISTURBANCES, Planted
from shm.simulate.elements import natural_frequencies
from shm.simulate.hammer import SimulatedTest, hammer_test, simulated_test
from shm.simulate.state import HammerPlan, HangerState, spread_places_m

__all__ = [
    "DISTURBANCES",
    "AmbientPlan",
    "HammerPlan",
    "HangerState",
    "Planted",
    "SimulatedTest",
    "ambient_test",
    "hammer_test",
    "natural_frequencies",
    "simulated_test",
    "spread_places_m",
]
