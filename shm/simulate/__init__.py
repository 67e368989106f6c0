"""Hammer tests of a hanger in the time domain, by a discretisation of their own.

Beam finite elements and modal superposition; no code is shared with `shm.models`, so that what is
planted here and found there agrees only if both are right.
"""

from __future__ import annotations

from shm.simulate.elements import natural_frequencies
from shm.simulate.hammer import hammer_test
from shm.simulate.state import HammerPlan, HangerState

__all__ = ["HammerPlan", "HangerState", "hammer_test", "natural_frequencies"]
