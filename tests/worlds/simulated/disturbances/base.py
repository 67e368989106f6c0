"""What a disturbance is: its name and what it does at one stage of a simulated test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from shm.simulate.response import Line, Pulse, Schedule, Strike
from shm.simulate.state import HammerPlan, HangerState
from shm.values import NAN, Channel, FloatArray, Hanger
from tests.worlds.simulated.bar.description import Bar
from tests.worlds.simulated.elements import PlaneModes

T = TypeVar("T")
Lines = tuple[Line, ...]
Channels = tuple[Channel, ...]


@dataclass(frozen=True)
class Planted:
    """The truth of one disturbance: the hits (counted from 0) and channels that it is in.

    `frequency_hz` is that of a tone or of a foreign resonance, `acceleration_m_s2` the largest
    amplitude of its ringing at the sensor that moves most.
    """

    disturbance: str
    hits: tuple[int, ...] = ()
    channels: tuple[str, ...] = ()
    frequency_hz: float = NAN
    acceleration_m_s2: float = NAN


@dataclass(frozen=True, eq=False)
class Scene:
    """The test that a disturbance strikes; `schedule` as the stages so far have left it.

    `bar` is the hanger with planted effects, None where none are; `plan` is in true seconds.
    """

    hanger: Hanger
    state: HangerState
    plan: HammerPlan
    schedule: Schedule
    bar: Bar | None = None

    @property
    def strikes(self) -> Sequence[Strike]:
        return self.schedule.strikes

    @property
    def rate_hz(self) -> float:
        return self.plan.sampling_rate_hz


@dataclass(frozen=True, eq=False)
class Motion:
    """How the hanger moves: `accelerations` (planes, sensors, samples) under `pulses`.

    `modes` are those of each plane.
    """

    modes: tuple[PlaneModes, ...]
    pulses: tuple[Pulse, ...]
    accelerations: FloatArray


class Verb(Protocol[T]):
    """Changes what one stage makes, and says where it did."""

    def __call__(self, made: T, scene: Scene, rng: np.random.Generator) -> tuple[T, Planted]: ...


@dataclass(frozen=True)
class Disturbance:
    """One thing that goes wrong in a test, at one stage of it.

    `schedule`: the blows and the record's ends; `motion`: of the hanger, before the sensors;
    `lines`: the sensors' signals before the logger; `channels`: what the logger wrote. One
    that does not need hits may go with `noise_only`.
    """

    name: str
    help: str
    schedule: Verb[Schedule] | None = None
    motion: Verb[Motion] | None = None
    lines: Verb[Lines] | None = None
    channels: Verb[Channels] | None = None
    needs_hits: bool = True
