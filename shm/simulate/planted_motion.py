"""What planted effects change of a hammer test: its modes, what sensors see, the logger's time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shm.errors import UsageError
from shm.simulate.bar import Bar, BarModes, bar_modes, bar_of
from shm.simulate.effects import PlantedEffect, TestConditions, planted
from shm.simulate.elements import PlaneModes, modes_below
from shm.simulate.state import HammerPlan, HangerState
from shm.values import FloatArray, Hanger

_MORE = 1.25  # times as many modes, while the highest is still too low


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
        modes.nodes_m,
        modes.deflection[plane],
        modes.rotation[plane],
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
