"""Modes of a hanger with planted effects, as the simulator has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from shm.simulate import HangerState, PlantedEffect
from shm.values import Hanger
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.planted import PlantedModes, bar_under, modes_under
from tests.worlds.simulated.reality import SensorError


def planted_modes(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    conditions: TestConditions,
    modes: int,
    places_m: Sequence[float],
    sensors: Sequence[SensorError] = (),
    **how: Any,
) -> PlantedModes:
    """The lowest `modes` modes of each plane under the conditions of one test."""
    bar = bar_under(hanger, state, effects, conditions, places_m, sensors=sensors, **how)
    return modes_under(bar, modes, places_m, sensors)
