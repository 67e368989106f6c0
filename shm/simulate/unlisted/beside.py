"""What vibrates beside the hanger and is tied to it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from shm.simulate.bar.description import Attached, Bar
from shm.simulate.bar.modes import bar_modes
from shm.simulate.effects.base import Range, Scene, Where
from shm.values import Hanger

Values = Mapping[str, float]
_MODES = 16  # of the second bar
_TUNED = (1.5, 5.5)  # orders between which a damper's frequency lies
_STILL = 1e-3  # of the largest deflection: a mode that hardly moves at the spacer


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
