"""Hammer pulses as an anti-aliased logger sees them, on a grid finer than its samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.signal import firwin, kaiserord

from shm.simulate.state import HammerPlan
from shm.values import FloatArray, IntArray

_LEAST_STEPS = 32
_STEPS_PER_PULSE = 16
_PASS, _STOP = 0.4, 0.5  # of the sampling rate
_STOP_BAND_DB = 100.0


@dataclass(frozen=True, eq=False)
class Pulse:
    """One hit: `fine_n` (samples, steps + 1) holds the force at the steps of each sample interval.

    `first` is the sample of the recording at which the first row begins; it may lie before 0.
    """

    first: int
    fine_n: FloatArray


def draw_pulses(plan: HammerPlan, rng: np.random.Generator) -> list[Pulse]:
    """The hits of a plan with their scatter of time and level, one a slot."""
    late = rng.uniform(0, 1, plan.hits) * plan.hit_time_scatter_s
    level = plan.peak_force_n * np.exp(plan.peak_force_scatter * rng.standard_normal(plan.hits))
    slots = np.arange(plan.hits) * plan.samples_per_hit / plan.sampling_rate_hz
    taps = _filter(plan, _steps(plan))
    starts = slots + plan.pre_trigger_s + late
    pairs = zip(starts, level, strict=True)
    return [_pulse(plan, float(start), float(peak), taps) for start, peak in pairs]


def samples_of(pulse: Pulse, samples: int) -> tuple[IntArray, FloatArray]:
    """Which of the recording's samples a pulse touches, and the force at them."""
    places = pulse.first + np.arange(len(pulse.fine_n))
    inside = (places >= 0) & (places < samples)
    return places[inside], pulse.fine_n[inside, 0]


def _steps(plan: HammerPlan) -> int:
    """Fine steps a sample, an even number: enough for the filter and for the pulse's shape."""
    wanted = _STEPS_PER_PULSE / (plan.pulse_seconds * plan.sampling_rate_hz)
    return max(_LEAST_STEPS, 2 * math.ceil(wanted / 2))


def _filter(plan: HammerPlan, steps: int) -> FloatArray:
    """Linear-phase low-pass of the logger: flat to 0.4, closed from 0.5 of the sampling rate."""
    count, beta = kaiserord(_STOP_BAND_DB, (_STOP - _PASS) * 2 / steps)
    half = math.ceil(count / (2 * steps)) * steps
    cutoff = (_PASS + _STOP) / steps
    return cast(FloatArray, firwin(2 * half + 1, cutoff, window=("kaiser", beta)))


def _pulse(plan: HammerPlan, start_s: float, peak_n: float, taps: FloatArray) -> Pulse:
    steps = _steps(plan)
    half = len(taps) // 2
    rate = plan.sampling_rate_hz * steps
    origin = math.floor(start_s * plan.sampling_rate_hz)
    rows = math.ceil(plan.pulse_seconds * plan.sampling_rate_hz) + 1
    phase = ((origin * steps + np.arange(rows * steps)) / rate - start_s) / plan.pulse_seconds
    raw = peak_n * np.where((phase >= 0) & (phase <= 1), np.sin(np.pi * phase), 0.0)
    fine = np.append(np.convolve(raw, taps), 0.0)
    first_of_rows = np.arange(0, len(fine) - steps, steps)
    return Pulse(origin - half // steps, fine[first_of_rows[:, None] + np.arange(steps + 1)])
