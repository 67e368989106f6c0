"""The bar and the sensors as they are, beside what is written of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shm.simulate.bar.description import Bar
from shm.simulate.bar.parts import Pair, Profile
from shm.simulate.reality import Reality
from shm.values import FloatArray

_POINTS = 33  # of the bar's section along its length


@dataclass(frozen=True)
class Deviations:
    """By which fractions a bar as made differs from its description.

    Bending stiffness goes with modulus and the square of the section (an area), mass with density
    and section; turnbuckles keep theirs. A longer bar ends farther from the deck. `section_waves`
    are amplitudes of the section's cosines along the bar, a half, two halves ... of a wave long.
    """

    section: float = 0.0
    density: float = 0.0
    length: float = 0.0
    modulus: float = 0.0
    section_waves: tuple[float, ...] = ()


GLOBAL = ("section", "density", "length", "modulus")
"""The deviations that a hanger's `Scatter` states."""


@dataclass(frozen=True)
class SensorError:
    """How the sensor said to sit at `x_m` errs, in all tests of a campaign.

    It sits `off_m` farther up, its axes (transverse, longitudinal) report `gain` times what they
    see, and it is turned about the bar from transverse to longitudinal.
    """

    x_m: float
    off_m: float = 0.0
    gain: Pair = (1.0, 1.0)
    turn_rad: float = 0.0


def wave_sd(reality: Reality) -> float:
    """Of the amplitude of each wave of the section: a cosine's mean square is a half."""
    return reality.section_sd * math.sqrt(2 / reality.section_waves)


def drawn_waves(reality: Reality, rng: np.random.Generator) -> tuple[float, ...]:
    """Amplitudes of the section's waves."""
    return tuple(
        float(wave_sd(reality) * drawn) for drawn in rng.standard_normal(reality.section_waves)
    )


def drawn_sensors(
    reality: Reality, places_m: tuple[float, ...], rng: np.random.Generator
) -> tuple[SensorError, ...]:
    """An error of each sensor."""
    gain = 1 + reality.gain_sd * rng.standard_normal((len(places_m), 2))
    off = reality.place_sd_m * rng.standard_normal(len(places_m))
    turn = reality.turn_sd_rad * rng.standard_normal(len(places_m))
    return tuple(
        SensorError(place, float(off[i]), (float(gain[i, 0]), float(gain[i, 1])), float(turn[i]))
        for i, place in enumerate(places_m)
    )


def as_made(bar: Bar, by: Deviations) -> Bar:
    """The bar with its deviations."""
    bending = (1 + by.modulus) * (1 + by.section) ** 2
    mass = (1 + by.section) * (1 + by.density)
    own = bar.bending_stiffness_n_m2
    made = replace(
        bar,
        arch_end_m=bar.deck_end_m + bar.length_m * (1 + by.length),
        bending_stiffness_n_m2=(own[0] * bending, own[1] * bending),
        mass_per_length_kg_m=bar.mass_per_length_kg_m * mass,
        stretches=tuple(
            replace(
                each,
                stiffness_factor=(
                    each.stiffness_factor[0] / bending,
                    each.stiffness_factor[1] / bending,
                ),
                mass_factor=each.mass_factor / mass,
            )
            for each in bar.stretches
        ),
    )
    return replace(made, profiles=(_wavy(made, by.section_waves),)) if by.section_waves else made


def _wavy(bar: Bar, waves: tuple[float, ...]) -> Profile:
    share = np.linspace(0, 1, _POINTS)
    order = np.arange(1, len(waves) + 1)
    section: FloatArray = 1 + np.cos(np.pi * np.outer(share, order)) @ np.array(waves)
    return Profile(
        tuple(bar.deck_end_m + bar.length_m * share),
        tuple((float(each**2), float(each**2)) for each in section),
        tuple(float(each) for each in section),
    )
