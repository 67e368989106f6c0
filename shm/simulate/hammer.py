"""A hammer test from the chosen state of a hanger to the recording that the crew brings home."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from shm.errors import UsageError
from shm.models.classes.base import Conditions
from shm.models.hanger import PhysicalHanger
from shm.simulate.effects import PlantedEffect, plant_effects
from shm.simulate.modes import make_bar, plane_modes
from shm.simulate.response import (
    Line,
    accelerations,
    draw_schedule,
    force_of,
    logged,
    pulse_of,
)
from shm.simulate.state import HammerPlan, HangerState, check
from shm.values import NAN, PLANES, FloatArray, Hanger, Recording


def hammer_test(
    hanger: Hanger,
    state: HangerState,
    plan: HammerPlan,
    rng: np.random.Generator,
    *,
    time: datetime | None = None,
    temperature_c: float = NAN,
    source: str = "simulated",
    effects: Sequence[PlantedEffect] = (),
    conditions: Conditions | None = None,
) -> Recording:
    """Return one continuous recording of all hits.

    Its channels are `force`, then `acc_1` (transverse) and `acc_2` (longitudinal) of the first
    sensor, `acc_3`, `acc_4` of the second, and so on. The logger filters force and accelerations
    alike (linear phase, flat to 0.4 of the sampling rate, -100 dB from 0.5), so nothing is aliased
    and their ratio is the true accelerance. Modes up to twice the sampling rate take part; those
    above half of it are not excited and only add their quasi-static share. The hanger is at rest
    before the first hit. The same generator state gives the same recording. `effects` are planted
    under the `conditions` of the test; the peak force is the plan's whatever their level. Raises
    UsageError for a state, plan or effect that cannot be.
    """
    check(hanger, state, plan)
    bar = _plant(hanger, state, plan, effects, conditions or Conditions())
    fast = float(bar.clock_factor[0])
    timed = _time_by_logger(plan, fast)
    schedule = draw_schedule(hanger, timed, rng)
    rate_hz = timed.sampling_rate_hz
    pulses = tuple(pulse_of(hit, rate_hz) for strike in schedule.strikes for hit in strike.hits)
    places = plan.sensor_places_m(hanger)
    moved = np.array([
        accelerations(modes, plane, state.damping_ratio, pulses, places, rate_hz, plan.samples)
        for modes, plane in zip(plane_modes(bar, 2 * rate_hz), PLANES, strict=True)
    ])  # fmt: skip
    moved = turn_sensors(moved, bar.sensor_turn_rad[0])
    lines = sensor_lines(hanger, timed, force_of(pulses, plan.samples), moved)
    channels = tuple(logged(line, plan.adc_bits, rng) for line in lines)
    stated_rate_hz = rate_hz * fast
    return Recording(
        source, channels, stated_rate_hz, hanger.id, time=time, temperature_c=temperature_c
    )


def _plant(
    hanger: Hanger,
    state: HangerState,
    plan: HammerPlan,
    effects: Sequence[PlantedEffect],
    conditions: Conditions,
) -> PhysicalHanger:
    """Return the bar with its effects; raises UsageError where the hammer has no bar to hit."""
    places = plan.sensor_places_m(hanger)
    bar = make_bar(hanger, state, len(places))
    bar = plant_effects(bar, effects, conditions, hanger, places)
    if not bar.deck_end_m[0] < plan.hammer_place_m(hanger) < bar.arch_end_m[0]:
        raise UsageError(
            "the hammer hits beyond the end of the planted bar.", remedy="Hit it farther up."
        )
    return bar


def _time_by_logger(plan: HammerPlan, fast: float) -> HammerPlan:
    """Return the plan in true seconds of a logger whose clock is `fast` times as fast."""
    return replace(
        plan,
        sampling_rate_hz=plan.sampling_rate_hz / fast,
        seconds_per_hit=plan.seconds_per_hit * fast,
    )


def turn_sensors(moved: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Return accelerations (planes, sensors, samples) as sensors turned by angles see them."""
    if not np.any(angle_rad):
        return moved
    c, s = np.cos(angle_rad)[:, None], np.sin(angle_rad)[:, None]
    transverse, longitudinal = moved
    return np.array([c * transverse + s * longitudinal, c * longitudinal - s * transverse])


def sensor_lines(
    hanger: Hanger, plan: HammerPlan, force: FloatArray, moved: FloatArray
) -> tuple[Line, ...]:
    """Return the cables of the hammer and of all sensors, without the logger's noise."""
    lines = [
        Line("force", "force", force, None, plan.hammer_place_m(hanger),
             plan.force_noise_n, plan.force_range_n)
    ]  # fmt: skip
    for index, x_m in enumerate(plan.sensor_places_m(hanger)):
        for number, plane in enumerate(PLANES):
            lines.append(
                Line(f"acc_{2 * index + number + 1}", "acceleration", moved[number, index], plane,
                     x_m, plan.acceleration_noise_m_s2, plan.acceleration_range_m_s2)
            )  # fmt: skip
    return tuple(lines)
