"""What may be wrong with a hanger and stands in no catalogue: the diagnosis should not know it.

A new one is a function with its ranges and one line of `UNLISTED`. They are planted as any other,
but never drawn among `PLANTED`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import replace

from shm.values import Hanger
from tests.worlds.simulated.bar.description import (
    Attached,
    Bar,
    Beyond,
    Mass,
    PartTime,
    Spring,
    Stretch,
)
from tests.worlds.simulated.bar.modes import bar_modes
from tests.worlds.simulated.effects.base import Plantable, Range, Scene, Where
from tests.worlds.simulated.effects.catalogue_laws import in_planes

Values = Mapping[str, float]

_MODES = 16  # judgement: of the second bar; twice the orders that tests see
_TUNED = (1.5, 5.5)  # orders between which a damper's frequency lies
_STILL = 1e-3  # of the largest deflection: a mode that hardly moves at the spacer
_LONG = 0.002  # of the length: the stretch that stands for the crack's hinge


def crack_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    own = hanger.length_m / hanger.bending_stiffness_n_m2
    return {
        "compliance_rad_n_m": Range(1e-4 * own, 0.3 * own, 0.0, logarithmic=True),
        "x_m": Range(0.03 * hanger.length_m, 0.97 * hanger.length_m),
        "opening_level": Range(0.2, 0.8, logarithmic=True),
    }


def crack(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A crack that the hit opens on one side of the swing, as a hinge with a compliance.

    It opens where the bending at the crack exceeds `opening_level` of what the mode that bends most
    there has at the reference level: each mode has its own level above which it falls. S. M. Cheng
    et al., J. Sound Vib. 225 (1999), a breathing crack as a bilinear spring.
    """
    long = _LONG * bar.length_m
    soft = 1 / (1 + values["compliance_rad_n_m"] * min(bar.bending_stiffness_n_m2) / long)
    start = values["x_m"] - long / 2
    opened = Stretch(start, start + long, in_planes(scene, soft, 1.0))
    level = values["opening_level"] / scene.conditions.amplitude
    breathing = PartTime(Beyond(values["x_m"], level, curvature=True), stretches=(opened,))
    return replace(bar, part_time=(*bar.part_time, breathing))


def guide_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    chord = hanger.nominal_tension_n / hanger.length_m
    return {
        "stiffness_n_m": Range(1e-3 * chord, 30 * chord, 0.0, logarithmic=True),
        "x_m": Range(0.05 * hanger.length_m, 0.95 * hanger.length_m),
        "gap_level": Range(0.3, 0.8, logarithmic=True),
    }


def guide(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A guide that the bar meets on both sides once its swing exceeds the gap.

    The gap is `gap_level` of the swing, at the guide and at the reference level, of the mode that
    swings most there. A. H. Nayfeh and D. T. Mook, Nonlinear Oscillations (1979), 3.3.
    """
    spring = Spring(values["x_m"], in_planes(scene, values["stiffness_n_m"], 0.0))
    level = values["gap_level"] / scene.conditions.amplitude
    met = PartTime(Beyond(values["x_m"], level, both_sides=True), springs=(spring,))
    return replace(bar, part_time=(*bar.part_time, met))


def pair_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    chord = hanger.nominal_tension_n / hanger.length_m
    return {
        "spacer_n_m": Range(1e-3 * chord, 100 * chord, 0.0, logarithmic=True),
        "x_m": Range(0.1 * hanger.length_m, 0.9 * hanger.length_m),
        "tension_ratio": Range(0.8, 0.97),
    }


def pair(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A second bar with less tension, joined by a spacer: the modes of both repel.

    C. Pierre, J. Sound Vib. 126 (1988), on the veering of weakly coupled, unequal parts. The second
    bar is its lowest modes, its ends held like this one's.
    """
    second = Bar(
        bar.deck_end_m,
        bar.arch_end_m,
        bar.tension_n * values["tension_ratio"],
        bar.bending_stiffness_n_m2,
        bar.mass_per_length_kg_m,
        bar.ends,
    )
    found = bar_modes(second, _MODES, (values["x_m"],))
    tied = tuple(
        Attached(values["x_m"], (plane,), values["spacer_n_m"], own)
        for plane in scene.where.planes
        if (own := _at_place(found[plane].angular_frequency_rad_s.tolist(),
                             found[plane].at((values["x_m"],))[0, plane].tolist()))
    )  # fmt: skip
    return replace(bar, attached=bar.attached + tied)


def _at_place(frequency: list[float], moved: list[float]) -> tuple[tuple[float, float], ...]:
    """(mass, square) of the modes that move at the spacer, 1 there."""
    least = _STILL * max(abs(each) for each in moved)
    return tuple(
        (1 / there**2, own**2)
        for own, there in zip(frequency, moved, strict=True)
        if abs(there) > least
    )


def damper_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    own = hanger.mass_per_length_kg_m * hanger.length_m
    lowest, highest = (_about_hz(hanger, order) for order in _TUNED)
    return {
        "mass_kg": Range(5e-6 * own, 0.05 * own, 0.0, logarithmic=True),
        "frequency_hz": Range(lowest, highest, logarithmic=True),
        "x_m": Range(0.15 * hanger.length_m, 0.85 * hanger.length_m),
    }


def _about_hz(hanger: Hanger, order: float) -> float:
    """A clamped bar's frequency, roughly: half a wave more than a hinged one's."""
    wave_number = (order + 0.5) * math.pi / hanger.length_m
    square = hanger.bending_stiffness_n_m2 * wave_number**4
    square += hanger.nominal_tension_n * wave_number**2
    return math.sqrt(square / hanger.mass_per_length_kg_m) / (2 * math.pi)


def damper(bar: Bar, values: Values, scene: Scene) -> Bar:
    """A mass on a spring: modes below its frequency fall, those above rise.

    J. P. Den Hartog, Mechanical Vibrations (1956), 3.2, without damping.
    """
    spring = values["mass_kg"] * (2 * math.pi * values["frequency_hz"]) ** 2
    tuned = Attached(values["x_m"], scene.where.planes, spring, ((values["mass_kg"], 0.0),))
    return replace(bar, attached=(*bar.attached, tuned))


def inertia_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    own = hanger.mass_per_length_kg_m * hanger.length_m**3
    return {
        "inertia_kg_m2": Range(1e-7 * own, 1e-3 * own, 0.0, logarithmic=True),
        "x_m": Range(0.15 * hanger.length_m, 0.85 * hanger.length_m),
    }


def inertia(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Rotary inertia at a place whose mass is known and in the description.

    It lowers the modes that slope there, as a mass does those that swing there. Lord Rayleigh, The
    Theory of Sound (1894), 8.186.
    """
    heavy = Mass(values["x_m"], 0.0, values["inertia_kg_m2"])
    return replace(bar, masses=(*bar.masses, heavy))


def between_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {"tension_change": Range(1e-5, 0.1, 0.0, logarithmic=True, signed=True)}


def between(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Traffic came or went between the hits along and across the bridge."""
    own = bar.tension_share
    return replace(bar, tension_share=(own[0], own[1] * (1 + values["tension_change"])))


def wandering_ranges(hanger: Hanger, where: Where) -> dict[str, Range]:
    return {
        "tension_scatter": Range(1e-5, 0.1, 0.0, logarithmic=True),
        "phase": Range(0.0, 1.0),
    }


def wandering(bar: Bar, values: Values, scene: Scene) -> Bar:
    """Each test finds another load on the bridge, whatever its temperature and level.

    The tests' names and `phase` decide where in a sine of `tension_scatter` root mean square each
    falls, so that the same campaign is the same again.
    """
    named = zlib.crc32(scene.conditions.test.encode()) / 2**32
    load = math.sqrt(2) * math.sin(2 * math.pi * (named + values["phase"]))
    return replace(bar, tension_n=bar.tension_n * (1 + values["tension_scatter"] * load))


_EVERYWHERE = ("everywhere",)
_BY_PLANE = (*_EVERYWHERE, "everywhere, transverse", "everywhere, longitudinal")
_ALL = (
    Plantable("breathing_crack", _BY_PLANE, crack_ranges, crack),
    Plantable("loose_guide", _BY_PLANE, guide_ranges, guide),
    Plantable("coupled_pair", _EVERYWHERE, pair_ranges, pair),
    Plantable("tuned_damper", _BY_PLANE, damper_ranges, damper),
    Plantable("rotary_coupling", _EVERYWHERE, inertia_ranges, inertia),
    Plantable("tension_between_planes", _EVERYWHERE, between_ranges, between),
    Plantable("wandering_tension", _EVERYWHERE, wandering_ranges, wandering),
)
UNLISTED = {each.name: each for each in _ALL}
