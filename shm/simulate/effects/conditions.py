"""What depends on the test: temperature, level, sensors and the logger's clock."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Bar, Mass
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger

Values = Mapping[str, float]
_STEEL_1_K = 1.2e-5  # EN 1993-1-1, 3.2.6


def warmth_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    held = hanger.elastic_modulus_pa * hanger.area_m2 * _STEEL_1_K
    return {"tension_per_kelvin_n_k": Range(1e-5 * held, held, 0.0, logarithmic=True, signed=True)}


def warmth(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Bridge and hanger expand differently."""
    shift = values["tension_per_kelvin_n_k"] * scene.conditions.temperature_shift_k
    return replace(bar, tension_n=bar.tension_n + shift)


def hardening_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"hardening": Range(1e-6, 0.05, 0.0, logarithmic=True)}


def hardening(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A large swing stretches the bar: tension grows with the amplitude's square."""
    raised = 1 + values["hardening"] * scene.conditions.amplitude**2
    return replace(bar, tension_n=bar.tension_n * raised)


def sensor_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"mass_kg": Range(0.01, 20.0, 0.0, logarithmic=True)}


def sensor(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Accelerometers weigh, with their clamps and cables."""
    added = tuple(Mass(place, values["mass_kg"]) for place in scene.where.chosen(scene.places_m))
    return replace(bar, masses=bar.masses + added)


def turn_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"angle_deg": Range(0.05, 60.0, 0.0, logarithmic=True, signed=True)}


def turn(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Sensors are clamped on askew."""
    angle = math.radians(values["angle_deg"])
    added = tuple((place, angle) for place in scene.where.chosen(scene.places_m))
    return replace(bar, turned_rad=bar.turned_rad + added)


def clock_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"clock_error": Range(1e-6, 0.05, 0.0, logarithmic=True, signed=True)}


def clock(bar: Bar, values: Values, scene: Scene) -> Bar:
    """The logger's clock runs slow: it reports too high frequencies."""
    if scene.where.test not in ("", scene.conditions.test):
        return bar
    return replace(bar, clock_factor=bar.clock_factor * (1 + values["clock_error"]))
