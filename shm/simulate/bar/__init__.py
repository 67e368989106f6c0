"""A bar on its ends by finite elements that shear, sag, carry masses and move with their ends."""

from __future__ import annotations

from shm.simulate.bar.description import Bar, Mass, Spring, Stretch, bar_of
from shm.simulate.bar.modes import BarModes, bar_modes

__all__ = ["Bar", "BarModes", "Mass", "Spring", "Stretch", "bar_modes", "bar_of"]
