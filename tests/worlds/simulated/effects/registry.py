"""What can be planted in a hanger; a new one is a function and one line of `PLANTED`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.simulate import PlantedEffect
from shm.values import PLANES, Hanger
from tests.worlds.simulated.bar.description import Bar
from tests.worlds.simulated.effects import catalogue_laws as laws
from tests.worlds.simulated.effects.alternative_laws import LAWS
from tests.worlds.simulated.effects.base import (
    Plantable,
    Range,
    Scene,
    TestConditions,
    Where,
    where_of,
)

__all__ = [
    "LAWS",
    "PLANTED",
    "PlantedEffect",
    "TestConditions",
    "choices",
    "drawn",
    "planted",
    "ranges_of",
    "where_of",
]

_AT_ENDS = ("deck end", "arch end", "both ends")
_BY_PLANE = tuple(f", {plane}" for plane in PLANES)
_AT_ENDS_BY_PLANE = tuple(end + plane for end in _AT_ENDS for plane in ("", *_BY_PLANE))
_ONE_END_AND_PLANE = tuple(
    end + plane for end in _AT_ENDS if end != "both ends" for plane in _BY_PLANE
)
_EVERYWHERE = ("everywhere",)
_ONE_PLANE = tuple(f"everywhere{plane}" for plane in _BY_PLANE)
_ALL = (
    Plantable("rotational_end_flexibility", _AT_ENDS_BY_PLANE, laws.turning_ranges, laws.turning),
    Plantable("translational_end_flexibility", _AT_ENDS_BY_PLANE, laws.moving_ranges, laws.moving),
    Plantable("effective_length", _AT_ENDS, laws.length_ranges, laws.length),
    Plantable("bending_stiffness", _EVERYWHERE, laws.stiffness_ranges, laws.stiffness, _ONE_PLANE),
    Plantable("distributed_mass", _EVERYWHERE, laws.heaviness_ranges, laws.heaviness),
    Plantable("point_mass", _EVERYWHERE, laws.clamp_ranges, laws.clamp),
    Plantable("section_loss", _EVERYWHERE, laws.loss_ranges, laws.loss),
    Plantable("stiff_end_zones", _AT_ENDS_BY_PLANE, laws.zone_ranges, laws.zone),
    Plantable("shear_and_rotary_inertia", _EVERYWHERE, laws.shear_ranges, laws.shear),
    Plantable("sag", _ONE_PLANE, laws.sag_ranges, laws.sag),
    Plantable("intermediate_support", _EVERYWHERE + _ONE_PLANE, laws.brace_ranges, laws.brace),
    Plantable("support_motion", _ONE_END_AND_PLANE, laws.support_ranges, laws.support),
    Plantable("temperature_tension", _EVERYWHERE, laws.warmth_ranges, laws.warmth),
    Plantable("geometric_hardening", _EVERYWHERE, laws.hardening_ranges, laws.hardening),
    Plantable("joint_softening", _AT_ENDS, laws.joint_ranges, laws.joint),
    Plantable("sensor_mass", ("all sensors",), laws.sensor_ranges, laws.sensor),
    Plantable("sensor_misalignment", ("all sensors", "sensor"), laws.turn_ranges, laws.turn),
    Plantable("skewed_principal_axes", _AT_ENDS, laws.skew_ranges, laws.skew),
    Plantable("timebase", ("all tests", "test"), laws.clock_ranges, laws.clock),
    Plantable("section_size", _EVERYWHERE, laws.size_ranges, laws.size),
    Plantable("partial_mass", _EVERYWHERE, laws.coat_ranges, laws.coat),
)
PLANTED = {each.name: each for each in _ALL}


def planted(
    bar: Bar,
    effects: Sequence[PlantedEffect],
    conditions: TestConditions,
    hanger: Hanger,
    places_m: Sequence[float],
    *,
    own_laws: bool = False,
) -> Bar:
    """The bar with the effects, one after the other, and the test's known mass.

    With `own_laws` they follow those of `LAWS`, where there is one. Raises UsageError for an
    effect, place or parameter that does not exist.
    """
    scene = Scene(Where(), conditions, hanger, tuple(places_m))
    for effect in effects:
        if _vanishes(effect, ranges_of(effect, hanger)):
            continue
        own = replace(scene, where=where_of(effect.at))
        law = LAWS.get(effect.name) if own_laws else None
        bar = (law or _known(effect.name).apply)(bar, effect.values, own)
    if conditions.added_mass is not None:
        known = {"mass_kg": conditions.added_mass.mass_kg, "x_m": conditions.added_mass.x_m}
        bar = laws.clamp(bar, known, scene)
    return bar


def ranges_of(effect: PlantedEffect, hanger: Hanger) -> dict[str, Range]:
    """The ranges of an effect's parameters, in order; raises UsageError where it is not right."""
    where = where_of(effect.at)
    known = _known(effect.name)
    places = known.places + known.only_if_not_round
    if effect.at not in places and effect.at.split(" ")[0] not in places:
        raise UsageError(
            f"{effect.name} does not act at {effect.at!r}.",
            remedy=f"Use one of: {'; '.join(places)}.",
        )
    ranges = known.ranges(hanger, where)
    if set(effect.values) != set(ranges):
        raise UsageError(
            f"{effect.name} at {effect.at!r} has {', '.join(effect.values) or 'no parameter'}.",
            remedy=f"Give {', '.join(ranges)}.",
        )
    if any(math.isnan(value) for value in effect.values.values()):
        raise UsageError(f"{effect.name}: a parameter is no number.", remedy="Give a number.")
    return ranges


def _vanishes(effect: PlantedEffect, ranges: Mapping[str, Range]) -> bool:
    return all(effect.values[name] == each.zero for name, each in ranges.items() if each.is_size)


def choices(
    name: str, places_m: Sequence[float], tests: Sequence[str], *, round_bar: bool = True
) -> tuple[str, ...]:
    """Everywhere that an effect may act: its `at` strings for these sensors and tests.

    A round bar bends alike in both planes.
    """
    found: list[str] = []
    known = _known(name)
    for kind in known.places if round_bar else known.places + known.only_if_not_round:
        if kind == "sensor":
            found += [f"sensor at {place:.2f} m" for place in places_m]
        elif kind == "test":
            found += [f"test {test}" for test in tests]
        else:
            found.append(kind)
    return tuple(found)


def drawn(name: str, at: str, hanger: Hanger, rng: np.random.Generator) -> PlantedEffect:
    """An effect whose parameters are drawn from their physical ranges."""
    values = {}
    for parameter, known in _known(name).ranges(hanger, where_of(at)).items():
        sign = rng.choice([-1.0, 1.0]) if known.signed else 1.0
        values[parameter] = float(sign * known.value(rng.uniform()))
    return PlantedEffect(name, at, values)


def _known(name: str) -> Plantable:
    if name not in PLANTED:
        raise UsageError(f"{name!r} is no effect.", remedy=f"Use one of {', '.join(PLANTED)}.")
    return PLANTED[name]
