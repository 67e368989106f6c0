"""Modes of a hanger with planted effects, as sensors and logger report them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.simulate.bar import Bar, bar_modes, bar_of
from shm.simulate.effects import PlantedEffect, TestConditions, planted
from shm.simulate.manufacture import Deviations, SensorError, as_made
from shm.simulate.state import HangerState
from shm.values import FloatArray, Hanger


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


def bar_under(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    conditions: TestConditions,
    places_m: Sequence[float],
    *,
    deviations: Deviations | None = None,
    sensors: Sequence[SensorError] = (),
    own_laws: bool = False,
) -> Bar:
    """The bar under the conditions of one test, as made, with effects and turned sensors.

    Raises UsageError for an effect that cannot be.
    """
    bar = as_made(bar_of(hanger, state), deviations or Deviations())
    bar = planted(bar, effects, conditions, hanger, places_m, own_laws=own_laws)
    turned = tuple((each.x_m, each.turn_rad) for each in sensors)
    return replace(bar, turned_rad=bar.turned_rad + turned)


def planted_modes(
    hanger: Hanger,
    state: HangerState,
    effects: Sequence[PlantedEffect],
    conditions: TestConditions,
    modes: int,
    places_m: Sequence[float],
    *,
    deviations: Deviations | None = None,
    sensors: Sequence[SensorError] = (),
    own_laws: bool = False,
) -> PlantedModes:
    """The lowest `modes` modes of each plane under the conditions of one test.

    `sensors` are the errors of all sensors in the order of the places, or none; with `own_laws`
    effects follow other laws than the catalogue's. Frequencies are right to 1e-5. Raises UsageError
    for an effect that cannot be.
    """
    bar = bar_under(
        hanger, state, effects, conditions, places_m,
        deviations=deviations, sensors=sensors, own_laws=own_laws,
    )  # fmt: skip
    true = [each.x_m + each.off_m for each in sensors] or places_m
    gain = np.array([each.gain for each in sensors] or 1.0)
    found = bar_modes(bar, modes, true)
    return PlantedModes(
        np.array([own.angular_frequency_rad_s for own in found]) / (2 * np.pi) * bar.clock_factor,
        np.array([_seen(bar, own.at(true), places_m, gain) for own in found]),
        np.array([bar.damping_ratio + own.added_damping_ratio for own in found]),
    )


def _seen(bar: Bar, moved: FloatArray, places_m: Sequence[float], gain: FloatArray) -> FloatArray:
    """Components at turned sensors, (modes, places, 2), of (places, planes, modes)."""
    if not len(places_m):
        return np.zeros((moved.shape[2], 0, 2))
    angle = np.array([bar.turn_rad(place) for place in places_m])[:, None]
    c, s = np.cos(angle), np.sin(angle)
    transverse, longitudinal = moved[:, 0], moved[:, 1]
    turned = np.stack([c * transverse + s * longitudinal, c * longitudinal - s * transverse], -1)
    flat = np.moveaxis(turned, 1, 0) * gain
    largest = np.argmax(np.abs(flat).reshape(len(flat), -1), axis=1)
    scale = flat.reshape(len(flat), -1)[np.arange(len(flat)), largest]
    return np.asarray(flat / scale[:, None, None])
