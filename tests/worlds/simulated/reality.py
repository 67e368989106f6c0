"""What a hanger really is beside what is written of it: as it is built, as the bar and the sensors
are, as a campaign departs from the textbook, so that nobody inverts his own model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from shm.simulate.state import HangerState
from shm.values import FloatArray, Hanger
from tests.worlds.simulated.bar.description import Bar, Pair, Profile, bar_of
from tests.worlds.simulated.bar.modes import bar_modes

if TYPE_CHECKING:
    from tests.worlds.simulated.campaign import CampaignPlan

_HIT = 0.16  # of the length, where a hammer reaches
_LEAST_SD, _MOST_SD = 0.5, 4.0
_MERGED = 0.004  # of the frequency: peaks so close overlap, twice the bandwidth at 0.1 % damping
_POINTS = 33  # of the bar's section along its length
GLOBAL = ("section", "density", "length", "modulus")
"""The deviations that a hanger's `Scatter` states."""


@dataclass(frozen=True)
class Reality:
    """What no description of a hanger and no textbook effect holds.

    - `own_laws`: effects follow laws of their own (`effects.alternative_laws`), not
      the catalogue's, with parameters that mean the same.
    - `section_sd`: the bar's area varies along it, rms as a fraction: hot-rolled rounds of 100 mm
      may be off by 1.3 mm of diameter (EN 10060), mostly the same all along a bar; 0.1 % of the
      area is 0.05 mm of diameter. It is a sum of `section_waves` cosines along the bar.
    - `gain_sd`: calibration of each channel, constant in a campaign: accelerometers are calibrated
      to 1 % with a coverage of 2 standard deviations (ISO 16063-21).
    - `place_sd_m`: along the bar, of each sensor: what a tape and a magnet's width give.
    - `turn_sd_deg`: about the bar's axis, of each sensor: what a bubble level on a round bar gives.
    - `sd_freedom`: identification estimates its standard deviations with so many degrees of
      freedom, those of some five hits in four channels.
    - `plane_correlation`: of the errors of two planes' frequencies that coincide, whose peaks
      overlap in both axes of each sensor; less the farther they are apart.

    Standard deviations differ by mode, larger where hammer or sensors sit near a node.
    """

    own_laws: bool = True
    section_sd: float = 0.001
    section_waves: int = 4
    gain_sd: float = 0.005
    place_sd_m: float = 0.003
    turn_sd_deg: float = 0.3
    sd_freedom: int = 20
    plane_correlation: float = 0.3

    @property
    def turn_sd_rad(self) -> float:
        return math.radians(self.turn_sd_deg)

    def correlation(self, frequency_hz: FloatArray) -> FloatArray:
        """Of the errors of both planes' frequencies (planes, modes), (modes,)."""
        apart = (frequency_hz[0] - frequency_hz[1]) / (_MERGED * frequency_hz.mean(axis=0))
        return np.asarray(self.plane_correlation / (1 + apart**2))


@lru_cache(maxsize=64)
def sd_factors(hanger: Hanger, state: HangerState, plan: CampaignPlan) -> FloatArray:
    """Each mode's standard deviations over the plan's, (planes, modes); all 1 without a reality.

    The median is about 1: in proportion to what the modes of the bar as described move at the
    hammer and, in the root mean square, at the sensors.
    """
    if plan.reality is None:
        return np.ones((2, plan.modes))
    length = state.effective_length_m(hanger)
    places = (_HIT * length, *(place for place in plan.places_m(hanger) if place < length))
    found = bar_modes(bar_of(hanger, state), plan.modes, places)
    moved = np.array([own.at(places)[:, plane] for plane, own in enumerate(found)])
    seen = np.abs(moved[:, 0]) * np.sqrt(np.mean(moved[:, 1:] ** 2, axis=1))
    least = np.median(seen) / _MOST_SD
    factors = np.median(seen) / np.maximum(seen, least)
    return np.asarray(np.clip(factors, _LEAST_SD, _MOST_SD))


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
