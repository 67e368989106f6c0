"""When, where and how hard the hammer strikes, and from when to when the record runs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shm.simulate.state import HammerPlan
from shm.values import NAN, Hanger, Plane


@dataclass(frozen=True)
class Strike:
    """One hit: a half sine of `peak_n` over `seconds`, from `start_s` on.

    `damping_ratio` is that of the hanger from this hit up to the next; NaN means its own. Where
    the hammer bounces, it strikes again `rebound_s` later with `rebound_share` of the force.
    """

    start_s: float
    peak_n: float
    seconds: float
    x_m: float
    angle_deg: float
    damping_ratio: float = NAN
    rebound_s: float = NAN
    rebound_share: float = 0.0

    @property
    def blows(self) -> tuple[Strike, ...]:
        """The hit, and the blow of a bouncing hammer after it."""
        first = replace(self, rebound_s=NAN, rebound_share=0.0)
        if not self.rebound_share:
            return (first,)
        peak_n = self.peak_n * self.rebound_share
        return first, replace(first, start_s=self.start_s + self.rebound_s, peak_n=peak_n)

    def share(self, plane: Plane) -> float:
        """Part of the force that acts in a plane."""
        angle = math.radians(self.angle_deg)
        return math.cos(angle) if plane == "transverse" else math.sin(angle)


@dataclass(frozen=True)
class Schedule:
    """All hits, by time, and the part of the planned record that is kept."""

    strikes: tuple[Strike, ...]
    begin_s: float
    end_s: float


def draw_schedule(hanger: Hanger, plan: HammerPlan, rng: np.random.Generator) -> Schedule:
    """The hits of a plan with their scatter of time and level, one a slot."""
    late = rng.uniform(0, 1, plan.hits) * plan.hit_time_scatter_s
    level = plan.peak_force_n * np.exp(plan.peak_force_scatter * rng.standard_normal(plan.hits))
    slots = np.arange(plan.hits) * plan.samples_per_hit / plan.sampling_rate_hz
    starts = slots + plan.pre_trigger_s + late
    x_m, angle = plan.hammer_place_m(hanger), plan.hammer_angle_deg
    strikes = tuple(
        Strike(float(start), float(peak), plan.pulse_seconds, x_m, angle)
        for start, peak in zip(starts, level, strict=True)
    )
    return Schedule(strikes, 0.0, plan.samples / plan.sampling_rate_hz)
