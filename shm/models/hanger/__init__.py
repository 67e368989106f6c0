"""The general model of a hanger: any physical term that the catalogue of effects knows."""

from __future__ import annotations

from shm.models.hanger.physical import (
    HangerModes,
    LateralSpring,
    ModeLaw,
    PhysicalHanger,
    PointMass,
    Zone,
)
from shm.models.hanger.reduced import Modes, ReducedBar
from shm.models.hanger.solution import NormalModes, normal_modes, solve
