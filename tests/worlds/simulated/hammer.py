"""Hammer tests of finite elements, with planted effects of any kind and with disturbances."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from shm.errors import UsageError
from shm.simulate import PlantedEffect
from shm.simulate.hammer import sensor_lines
from shm.simulate.response import (
    Strike,
    accelerations,
    draw_schedule,
    force_of,
    logged,
    pulse_of,
)
from shm.simulate.state import HammerPlan, HangerState, check
from shm.values import NAN, PLANES, FloatArray, Hanger, Recording
from tests.worlds.simulated.bar.description import Bar
from tests.worlds.simulated.disturbances.base import (
    Channels,
    Disturbance,
    Lines,
    Motion,
    Planted,
    Scene,
    T,
    Verb,
)
from tests.worlds.simulated.disturbances.registry import DISTURBANCES
from tests.worlds.simulated.effects.base import TestConditions
from tests.worlds.simulated.elements import PlaneModes, modes_below, plane_modes
from tests.worlds.simulated.planted import (
    by_logger,
    planted_bar,
    planted_plane_modes,
    seen_by_turned,
    shifted,
)


@dataclass(frozen=True, eq=False)
class SimulatedTest:
    """A recording and its truth: each disturbance, and the hits in seconds of the recording."""

    recording: Recording
    planted: tuple[Planted, ...]
    strikes: tuple[Strike, ...]


def hammer_test(
    hanger: Hanger,
    state: HangerState,
    plan: HammerPlan,
    rng: np.random.Generator,
    *,
    time: datetime | None = None,
    temperature_c: float = NAN,
    source: str = "simulated",
    disturbances: Sequence[str] = (),
    effects: Sequence[PlantedEffect] = (),
    conditions: TestConditions | None = None,
) -> Recording:
    """One continuous recording of all hits: `force`, then `acc_1` (transverse), `acc_2`
    (longitudinal) of the first sensor, `acc_3`, `acc_4` of the second, and so on.

    The logger filters force and accelerations alike (linear phase, flat to 0.4 of the sampling
    rate, -100 dB from 0.5), so nothing is aliased and their ratio is the true accelerance. Modes
    up to twice the sampling rate take part; those above half of it are not excited and only add
    their quasi-static share. The hanger is at rest before the first hit. `disturbances` are names
    of `DISTURBANCES`. The same generator state gives the same recording, and a disturbance leaves
    hits and noise as they are without it. `effects` are planted under the `conditions` of the test,
    a level that stands for itself: the peak force is the plan's. Raises UsageError for a state,
    plan or effect that cannot be.
    """
    made = simulated_test(
        hanger,
        state,
        plan,
        rng,
        disturbances=disturbances,
        effects=effects,
        conditions=conditions,
    )
    return replace(made.recording, source=source, time=time, temperature_c=temperature_c)


def simulated_test(
    hanger: Hanger,
    state: HangerState,
    plan: HammerPlan,
    rng: np.random.Generator,
    *,
    disturbances: Sequence[str] = (),
    effects: Sequence[PlantedEffect] = (),
    conditions: TestConditions | None = None,
) -> SimulatedTest:
    """The same with what was planted where."""
    bar = planted_bar(hanger, state, plan, effects, conditions or TestConditions())
    return struck(hanger, state, plan, rng, bar, disturbances=disturbances)


def struck(
    hanger: Hanger,
    state: HangerState,
    plan: HammerPlan,
    rng: np.random.Generator,
    bar: Bar | None,
    *,
    disturbances: Sequence[str] = (),
    shifts: FloatArray | None = None,
) -> SimulatedTest:
    """A hammer test of a bar in which everything is planted; None is that of the state alone.

    `shifts` (planes, modes) are fractions by which the lowest modes' frequencies differ in this
    test from the bar's.
    """
    check(hanger, state, plan)
    stages = _Stages(disturbances, rng)
    plan = by_logger(plan, bar)
    scene = Scene(hanger, state, plan, draw_schedule(hanger, plan, rng), bar)
    scene = replace(scene, schedule=stages.run("schedule", scene.schedule, scene))
    modes = _modes(scene) if shifts is None else shifted(_modes(scene), shifts)
    motion = stages.run("motion", _motion(scene, modes), scene)
    lines = stages.run("lines", _lines(motion, scene), scene)
    channels: Channels = tuple(logged(line, plan.adc_bits, rng) for line in lines)
    channels = stages.run("channels", channels, scene)
    return _kept(channels, scene, tuple(stages.planted))


class _Stages:
    """Runs the disturbances of each stage and collects what they planted.

    Each draws from a generator of its own, seeded from a copy of the test's: the test's own draws
    are the same with and without it.
    """

    def __init__(self, names: Sequence[str], rng: np.random.Generator):
        _refuse_unless_hit(names)
        root = int(copy.deepcopy(rng).integers(2**62))
        self._disturbances = [_of_name(name) for name in names]
        self._generators = [np.random.default_rng([root, place]) for place in range(len(names))]
        self.planted: list[Planted] = []

    def run(self, stage: str, made: T, scene: Scene) -> T:
        for disturbance, rng in zip(self._disturbances, self._generators, strict=True):
            verb: Verb[T] | None = getattr(disturbance, stage)
            if verb:
                made, planted = verb(made, scene, rng)
                self.planted.append(planted)
        return made


def _of_name(name: str) -> Disturbance:
    if name not in DISTURBANCES:
        raise UsageError(
            f"{name!r} is no disturbance.", remedy=f"Use one of {', '.join(DISTURBANCES)}."
        )
    return DISTURBANCES[name]


def _refuse_unless_hit(names: Sequence[str]) -> None:
    idle = [name for name in names if _of_name(name).needs_hits]
    if "noise_only" in names and idle:
        raise UsageError(
            f"{idle[0]} needs hits, and noise_only has none.", remedy="Leave out one of them."
        )


def _motion(scene: Scene, modes: tuple[PlaneModes, ...]) -> Motion:
    """Modes, pulses and noise-free accelerations."""
    plan, state = scene.plan, scene.state
    pulses = tuple(
        pulse_of(blow, scene.rate_hz) for strike in scene.strikes for blow in strike.hits
    )
    places = plan.sensor_places_m(scene.hanger)
    moved = [
        accelerations(own, plane, state.damping_ratio, pulses, places, scene.rate_hz, plan.samples)
        for own, plane in zip(modes, PLANES, strict=True)
    ]
    return Motion(modes, pulses, seen_by_turned(scene.bar, np.array(moved), places))


def _modes(scene: Scene) -> tuple[PlaneModes, ...]:
    hanger, state, highest_hz = scene.hanger, scene.state, 2 * scene.rate_hz
    if scene.bar is not None:
        return planted_plane_modes(scene.bar, hanger, state, scene.plan, highest_hz)
    count = modes_below(hanger, state, highest_hz)
    return tuple(plane_modes(hanger, state, plane, count) for plane in PLANES)


def _lines(motion: Motion, scene: Scene) -> Lines:
    force = force_of(motion.pulses, scene.plan.samples)
    return sensor_lines(scene.hanger, scene.plan, force, motion.accelerations)


def _kept(channels: Channels, scene: Scene, planted: tuple[Planted, ...]) -> SimulatedTest:
    """What lies within the ends of the record."""
    schedule = scene.schedule
    first = math.ceil(schedule.begin_s * scene.rate_hz)
    part = slice(first, round(schedule.end_s * scene.rate_hz))
    cut = tuple(replace(channel, values=channel.values[part]) for channel in channels)
    fast = 1.0 if scene.bar is None else scene.bar.clock_factor
    recording = Recording("simulated", cut, scene.rate_hz * fast, scene.hanger.id)
    shift_s = first / scene.rate_hz
    strikes = tuple(replace(s, start_s=(s.start_s - shift_s) / fast) for s in schedule.strikes)
    return SimulatedTest(recording, planted, strikes)
