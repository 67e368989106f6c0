"""Effects of the catalogue planted in a hanger: read by name and place, applied to its model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.models.classes.base import Conditions
from shm.models.effects import EFFECTS, Case, Effect, Survey, Variant
from shm.models.hanger import PhysicalHanger, PointMass
from shm.values import PLANES, AddedMass, FloatArray, Hanger


@dataclass(frozen=True)
class PlantedEffect:
    """A truth to plant: an effect's name, where it acts, and all its parameters by name.

    `at` is `everywhere`, `deck end`, `arch end`, `both ends`, `all sensors`, `sensor at 3.60 m`,
    `all tests` or `test t3`; `, transverse` or `, longitudinal` appended means that plane alone.
    """

    name: str
    at: str
    values: Mapping[str, float]


def plant_effects(
    bar: PhysicalHanger,
    effects: Sequence[PlantedEffect],
    conditions: Conditions,
    hanger: Hanger,
    places_m: Sequence[float],
) -> PhysicalHanger:
    """Return the bar with the effects, one after the other, and the test's known mass.

    Raises UsageError for an effect, place or parameter that does not exist.
    """
    for planted in effects:
        survey = _survey_everything(planted.at, places_m)
        effect = _find_effect(planted.name)
        variant = _find_variant(effect, planted.at, hanger, survey)
        values = _order_values(planted, effect, hanger, variant)
        bar = effect.act(bar, values, Case(hanger, variant, conditions))
    added = conditions.added_mass
    return bar if added is None else _clamp_mass_on(bar, added)


def plantable_effects() -> tuple[str, ...]:
    """Return the names of the effects that a simulated recording can show."""
    return tuple(name for name, effect in EFFECTS.items() if not effect.of_readings)


def _survey_everything(at: str, places_m: Sequence[float]) -> Survey:
    """Return a survey in which every effect can be seen, with these sensors and the named test."""
    tests = ("", at.removeprefix("test ")) if at.startswith("test ") else ("",)
    return Survey(tests, PLANES, tuple(places_m), True, (0.0, 20.0), (0.5, 1.0), ())


def _find_effect(name: str) -> Effect:
    if name not in plantable_effects():
        raise UsageError(
            f"{name!r} is no effect.", remedy=f"Use one of {', '.join(plantable_effects())}."
        )
    return EFFECTS[name]


def _find_variant(effect: Effect, at: str, hanger: Hanger, survey: Survey) -> Variant:
    variants = {each.at: each for each in effect.variants(hanger, survey)}
    if at not in variants:
        raise UsageError(
            f"{effect.name} does not act at {at!r}.", remedy=f"Use one of: {'; '.join(variants)}."
        )
    return variants[at]


def _order_values(
    planted: PlantedEffect, effect: Effect, hanger: Hanger, variant: Variant
) -> FloatArray:
    """Return the parameters as the effect takes them, (1, parameters)."""
    names = [each.name for each in effect.parameters(hanger, variant)]
    if set(planted.values) != set(names):
        raise UsageError(
            f"{planted.name} at {planted.at!r} has {', '.join(planted.values) or 'no parameter'}.",
            remedy=f"Give {', '.join(names)}.",
        )
    values = [planted.values[name] for name in names]
    if any(math.isnan(value) for value in values):
        raise UsageError(f"{planted.name}: a parameter is no number.", remedy="Give a number.")
    return np.array([values])


def _clamp_mass_on(bar: PhysicalHanger, added: AddedMass) -> PhysicalHanger:
    """Return the bar with a known mass: a point where no radius is stated, as it is planted."""
    radius_m = added.radius_of_gyration_m
    turning = np.array([radius_m]) if radius_m else None
    mass = PointMass(np.array([added.x_m]), np.array([added.mass_kg]), turning)
    return replace(bar, masses=(*bar.masses, mass))
