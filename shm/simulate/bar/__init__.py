"""A bar on its ends by finite elements that shear, sag, carry masses and move with their ends."""

from __future__ import annotations

from shm.simulate.bar.description import Bar, BarEnd, bar_of
from shm.simulate.bar.modes import bar_modes
from shm.simulate.bar.parts import Mass, Spring, Stretch
from shm.simulate.bar.shapes import BarModes

__all__ = ["Bar", "BarEnd", "BarModes", "Mass", "Spring", "Stretch", "bar_modes", "bar_of"]
