"""When, where and how hard the hammer strikes, from when to when the record runs, and the pulses as
an anti-aliased logger sees them, on a grid finer than its samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import cast

import numpy as np
import scipy

from shm.simulate.state import HammerPlan
from shm.values import NAN, FloatArray, Hanger, IntArray, Plane

# From 32 times the sampling rate 1/((2 f T)^2 - 1) of a half sine of T folds back: 6e-5 of 4 ms at
# 512 Hz. Simpson's rule over 16 steps a pulse errs by (pi/16)^4/180, 1e-5.
_LEAST_STEPS, _STEPS_PER_PULSE = 32, 16
_PASS, _STOP = 0.4, 0.5  # of the sampling rate
_STOP_BAND_DB = 100.0


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
    def hits(self) -> tuple[Strike, ...]:
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


@dataclass(frozen=True, eq=False)
class Pulse:
    """A blow in the record: `fine_n` (samples, steps + 1) holds its force at the steps of each
    sample interval.

    `first` is the sample of the recording at which the first row begins; it may lie before 0.
    """

    strike: Strike
    first: int
    fine_n: FloatArray


def pulse_of(strike: Strike, sampling_rate_hz: float) -> Pulse:
    """The force of a blow, low-passed by the logger."""
    steps = _steps(strike.seconds * sampling_rate_hz)
    taps = _filter(steps)
    half = len(taps) // 2
    rate = sampling_rate_hz * steps
    origin = math.floor(strike.start_s * sampling_rate_hz)
    rows = math.ceil(strike.seconds * sampling_rate_hz) + 1
    phase = ((origin * steps + np.arange(rows * steps)) / rate - strike.start_s) / strike.seconds
    raw = strike.peak_n * np.where((phase >= 0) & (phase <= 1), np.sin(np.pi * phase), 0.0)
    fine = np.append(np.convolve(raw, taps), 0.0)
    first_of_rows = np.arange(0, len(fine) - steps, steps)
    return Pulse(
        strike, origin - half // steps, fine[first_of_rows[:, None] + np.arange(steps + 1)]
    )


def samples_of(pulse: Pulse, samples: int) -> tuple[IntArray, FloatArray]:
    """Which of the recording's samples a pulse touches, and the force at them."""
    places = pulse.first + np.arange(len(pulse.fine_n))
    inside = (places >= 0) & (places < samples)
    return places[inside], pulse.fine_n[inside, 0]


def force_of(pulses: Sequence[Pulse], samples: int) -> FloatArray:
    """The force over time, (samples,)."""
    force = np.zeros(samples)
    for pulse in pulses:
        places, values = samples_of(pulse, samples)
        force[places] += values
    return force


def _steps(samples: float) -> int:
    """Fine steps a sample, an even number: enough for the filter and for the pulse's shape."""
    return max(_LEAST_STEPS, 2 * math.ceil(_STEPS_PER_PULSE / samples / 2))


@cache
def _filter(steps: int) -> FloatArray:
    """Linear-phase low-pass of the logger: flat to 0.4, closed from 0.5 of the sampling rate."""
    count, beta = scipy.signal.kaiserord(_STOP_BAND_DB, (_STOP - _PASS) * 2 / steps)
    half = math.ceil(count / (2 * steps)) * steps
    cutoff = (_PASS + _STOP) / steps
    return cast(FloatArray, scipy.signal.firwin(2 * half + 1, cutoff, window=("kaiser", beta)))
