"""Modes of a hanger with planted effects, as sensors and logger report them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.simulate.bar import Bar, bar_modes, bar_of
from shm.simulate.effects import PlantedEffect, TestConditions, planted
from shm.simulate.state import HangerState
from shm.values import FloatArray, Hanger


@dataclass(frozen=True)
class Deviations:
    """By which fractions a bar as made differs from its description.

    Bending stiffness goes with modulus and the square of the section (an area), mass with density
    and section; turnbuckles keep theirs. A longer bar ends farther from the deck.
    """

    section: float = 0.0
    density: float = 0.0
    length: float = 0.0
    modulus: float = 0.0


@dataclass(frozen=True, eq=False)
class PlantedModes:
    """What the logger reports without noise.

    `frequency_hz` (planes, modes), ascending; `shape` (planes, modes, places, 2): the transverse
    and longitudinal components at the sensors, the largest of each mode 1; `damping_ratio`
    (planes, modes).
    """

    frequency_hz: FloatArray
    shape: FloatArray
    damping_ratio: FloatArray


def planted_modes(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    conditions: TestConditions,
    modes: int,
    places_m: Sequence[float],
    *,
    deviations: Deviations | None = None,
) -> PlantedModes:
    """The lowest `modes` modes of each plane under the conditions of one test.

    Frequencies are right to 1e-5. Raises UsageError for an effect that cannot be.
    """
    bar = _as_made(bar_of(hanger, state), deviations or Deviations())
    bar = planted(bar, effects, conditions, hanger, places_m)
    found = bar_modes(bar, modes, places_m)
    return PlantedModes(
        np.array([own.angular_frequency_rad_s for own in found]) / (2 * np.pi) * bar.clock_factor,
        np.array([_seen(bar, own.at(places_m), places_m) for own in found]),
        np.array([bar.damping_ratio + own.added_damping_ratio for own in found]),
    )


def _as_made(bar: Bar, by: Deviations) -> Bar:
    bending = (1 + by.modulus) * (1 + by.section) ** 2
    mass = (1 + by.section) * (1 + by.density)
    own = bar.bending_stiffness_n_m2
    return replace(
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


def _seen(bar: Bar, moved: FloatArray, places_m: Sequence[float]) -> FloatArray:
    """Components at turned sensors, (modes, places, 2), of (places, planes, modes)."""
    if not len(places_m):
        return np.zeros((moved.shape[2], 0, 2))
    angle = np.array([bar.turn_rad(place) for place in places_m])[:, None]
    c, s = np.cos(angle), np.sin(angle)
    transverse, longitudinal = moved[:, 0], moved[:, 1]
    turned = np.stack([c * transverse + s * longitudinal, c * longitudinal - s * transverse], -1)
    flat = np.moveaxis(turned, 1, 0)
    largest = np.argmax(np.abs(flat).reshape(len(flat), -1), axis=1)
    scale = flat.reshape(len(flat), -1)[np.arange(len(flat)), largest]
    return np.asarray(flat / scale[:, None, None])
