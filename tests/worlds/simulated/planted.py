"""What planted effects change: the modes as sensors and logger report them, the motion under the
hammer, the logger's time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shm.errors import UsageError
from shm.simulate import PlantedEffect
from shm.simulate.state import HammerPlan, HangerState
from shm.values import FloatArray, Hanger
from tests.worlds.simulated.bar.description import Bar, bar_of
from tests.worlds.simulated.bar.modes import BarModes, bar_modes
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.effects.registry import planted
from tests.worlds.simulated.elements import PlaneModes, modes_below
from tests.worlds.simulated.reality import Deviations, SensorError, as_made

_MORE = 1.25  # times as many modes, while the highest is still too low


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

    With `own_laws` effects follow other laws than the catalogue's. Raises UsageError for an effect
    that cannot be.
    """
    bar = as_made(bar_of(hanger, state), deviations or Deviations())
    bar = planted(bar, effects, conditions, hanger, places_m, own_laws=own_laws)
    turned = tuple((each.x_m, each.turn_rad) for each in sensors)
    return replace(bar, turned_rad=bar.turned_rad + turned)


def modes_under(
    bar: Bar, modes: int, places_m: Sequence[float], sensors: Sequence[SensorError] = ()
) -> PlantedModes:
    """The lowest `modes` modes of each plane of a bar; frequencies are right to 1e-5.

    `sensors` are the errors of all sensors in the order of the places, or none.
    """
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


def planted_bar(
    hanger: Hanger,
    state: HangerState,
    plan: HammerPlan,
    effects: Sequence[PlantedEffect],
    conditions: TestConditions,
) -> Bar | None:
    """The bar with its effects and known mass; None where there are none.

    Raises UsageError for an effect that cannot be, or that leaves the hammer no bar to hit.
    """
    if not effects and conditions.added_mass is None:
        return None
    bar = planted(bar_of(hanger, state), effects, conditions, hanger, plan.sensor_places_m(hanger))
    if not bar.deck_end_m < plan.hammer_place_m(hanger) < bar.arch_end_m:
        raise UsageError(
            "the hammer hits beyond the end of the planted bar.", remedy="Hit it farther up."
        )
    return bar


def by_logger(plan: HammerPlan, bar: Bar | None) -> HammerPlan:
    """The plan as the logger carries it out by its own clock, in true seconds."""
    if bar is None:
        return plan
    return replace(
        plan,
        sampling_rate_hz=plan.sampling_rate_hz / bar.clock_factor,
        seconds_per_hit=plan.seconds_per_hit * bar.clock_factor,
    )


def planted_plane_modes(
    bar: Bar, hanger: Hanger, state: HangerState, plan: HammerPlan, frequency_hz: float
) -> tuple[PlaneModes, PlaneModes]:
    """At least all modes below a frequency, supports' own among them, in each plane.

    Where an end couples the planes, the modes of both stand in each. Nodes are at sensors and
    hammer, where alone the modes may be asked for.
    """
    places = (*plan.sensor_places_m(hanger), plan.hammer_place_m(hanger))
    count = modes_below(hanger, state, frequency_hz)
    found = bar_modes(bar, count, places, with_supports=True)
    while min(own.angular_frequency_rad_s[-1] for own in found) < 2 * np.pi * frequency_hz:
        count = int(_MORE * count) + 1
        found = bar_modes(bar, count, places, with_supports=True)
    if bar.coupled:
        transverse, longitudinal = (_of_plane(_joined(*found), plane) for plane in (0, 1))
        return (
            replace(transverse, other=longitudinal),
            replace(longitudinal, other=transverse),
        )
    return _of_plane(found[0], 0), _of_plane(found[1], 1)


def shifted(modes: Sequence[PlaneModes], by: FloatArray) -> tuple[PlaneModes, ...]:
    """The modes of each plane with the lowest frequencies changed by fractions (planes, modes).

    Where both planes hold the same modes, those of the first plane count.
    """
    return tuple(
        _shifted(own, by[0 if own.other is not None else plane]) for plane, own in enumerate(modes)
    )


def _shifted(modes: PlaneModes, by: FloatArray) -> PlaneModes:
    factor = np.ones(len(modes.angular_frequency_rad_s))
    factor[: len(by)] += by[: len(factor)]
    other = None if modes.other is None else _shifted(modes.other, by)
    return replace(
        modes, angular_frequency_rad_s=modes.angular_frequency_rad_s * factor, other=other
    )


def seen_by_turned(
    bar: Bar | None, accelerations: FloatArray, places_m: Sequence[float]
) -> FloatArray:
    """Accelerations (planes, sensors, samples) as turned sensors see them."""
    if bar is None or not bar.turned_rad:
        return accelerations
    angle = np.array([bar.turn_rad(place) for place in places_m])[:, None]
    c, s = np.cos(angle), np.sin(angle)
    transverse, longitudinal = accelerations
    return np.array([c * transverse + s * longitudinal, c * longitudinal - s * transverse])


def _of_plane(modes: BarModes, plane: int) -> PlaneModes:
    return PlaneModes(
        modes.angular_frequency_rad_s,
        lambda x_m: modes.at(x_m)[:, plane],
        modes.added_damping_ratio,
    )


def _joined(first: BarModes, second: BarModes) -> BarModes:
    """The modes of both, ascending."""
    frequency = np.concatenate([first.angular_frequency_rad_s, second.angular_frequency_rad_s])
    order = np.argsort(frequency)
    return BarModes(
        frequency[order],
        first.nodes_m,
        np.concatenate([first.deflection, second.deflection], axis=2)[:, :, order],
        np.concatenate([first.rotation, second.rotation], axis=2)[:, :, order],
        np.concatenate([first.added_damping_ratio, second.added_damping_ratio])[order],
    )
