"""Accelerations of one plane under hammer pulses, by modal superposition.

A mode of damped angular frequency w_d and pole s obeys z' = s z + f for its complex state z; its
deflection is Im(z)/w_d and its acceleration Im(s^2 z)/w_d + f. From sample to sample z is exact;
the force within a sample is summed by Simpson's rule on the fine steps. Once a band-limited pulse
is over, that sum is exact but for the pulse's content beyond half the fine rate (L. N. Trefethen
and J. A. C. Weideman, SIAM Review 56, 2014). Pulses are those that an anti-aliased logger sees, on
a grid finer than its samples; it adds noise, clipping and the steps of its converter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Protocol, cast

import numpy as np
import scipy

from shm.simulate.state import HammerPlan
from shm.values import (
    NAN,
    PLANES,
    Channel,
    ComplexArray,
    FloatArray,
    Hanger,
    IntArray,
    Plane,
    Quantity,
)

# From 32 times the sampling rate 1/((2 f T)^2 - 1) of a half sine of T folds back: 6e-5 of 4 ms at
# 512 Hz. Simpson's rule over 16 steps a pulse errs by (pi/16)^4/180, 1e-5.
_LEAST_STEPS, _STEPS_PER_PULSE = 32, 16
_PASS, _STOP = 0.4, 0.5  # of the sampling rate
_STOP_BAND_DB = 100.0


class PlaneModes(Protocol):
    """Modes of one plane, mass-normalised.

    `angular_frequency_rad_s` and `added_damping_ratio`, which comes on top of the hanger's, are
    (modes,). `other` is how these modes move in the other plane, None where they do not.
    """

    @property
    def angular_frequency_rad_s(self) -> FloatArray: ...

    @property
    def added_damping_ratio(self) -> FloatArray: ...

    @property
    def other(self) -> PlaneModes | None: ...

    def at(self, x_m: FloatArray) -> FloatArray:
        """Return the mode shapes in kg^-1/2 at `x_m` (points,): (points, modes)."""
        ...


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
        """Return the fraction of the force in a plane."""
        angle = math.radians(self.angle_deg)
        return math.cos(angle) if plane == "transverse" else math.sin(angle)


@dataclass(frozen=True)
class Schedule:
    """All hits, by time, and the part of the planned record that is kept."""

    strikes: tuple[Strike, ...]
    begin_s: float
    end_s: float


def draw_schedule(hanger: Hanger, plan: HammerPlan, rng: np.random.Generator) -> Schedule:
    """Draw the hits of a plan with their scatter of time and level, one a slot."""
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
    """A hit in the record.

    `fine_n` (samples, steps + 1) holds its force at the steps of each sample interval.
    `first` is the sample of the recording at which the first row begins; it may lie before 0.
    """

    strike: Strike
    first: int
    fine_n: FloatArray


def pulse_of(strike: Strike, sampling_rate_hz: float) -> Pulse:
    """Return the force of a hit, low-passed by the logger."""
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
    """Return the indices of the recording's samples in a pulse, and the force at them."""
    places = pulse.first + np.arange(len(pulse.fine_n))
    inside = (places >= 0) & (places < samples)
    return places[inside], pulse.fine_n[inside, 0]


def force_of(pulses: Sequence[Pulse], samples: int) -> FloatArray:
    """Return the force over time, (samples,)."""
    force = np.zeros(samples)
    for pulse in pulses:
        places, values = samples_of(pulse, samples)
        force[places] += values
    return force


def _steps(samples: float) -> int:
    """Return the fine steps a sample, an even number: enough for filter and pulse."""
    return max(_LEAST_STEPS, 2 * math.ceil(_STEPS_PER_PULSE / samples / 2))


@cache
def _filter(steps: int) -> FloatArray:
    """Return the logger's linear-phase low-pass: flat to 0.4, closed from 0.5 of the rate."""
    count, beta = scipy.signal.kaiserord(_STOP_BAND_DB, (_STOP - _PASS) * 2 / steps)
    half = math.ceil(count / (2 * steps)) * steps
    cutoff = (_PASS + _STOP) / steps
    return cast(FloatArray, scipy.signal.firwin(2 * half + 1, cutoff, window=("kaiser", beta)))


_MODES_AT_ONCE = 16  # technical: memory of a block against calls


@dataclass(frozen=True, eq=False)
class Stretch:
    """Samples `begin` up to `end` of a recording with the pulses in it and one damping ratio.

    The first may begin before sample 0, where a pulse does.
    """

    begin: int
    end: int
    damping_ratio: float
    pulses: tuple[Pulse, ...]


def accelerations(
    modes: PlaneModes,
    plane: Plane,
    damping_ratio: float,
    pulses: Sequence[Pulse],
    sensors_x_m: Sequence[float],
    sampling_rate_hz: float,
    samples: int,
) -> FloatArray:
    """Return accelerations of a plane in m/s^2, shape (sensors, samples).

    Each pulse acts at its position in its direction. After a hit with its damping ratio
    everything decays with that one up to the next hit.
    """
    seen = modes.at(np.array(sensors_x_m))
    out = np.zeros((len(seen), samples))
    carried = np.zeros(len(modes.angular_frequency_rad_s), complex)
    for stretch in stretches(pulses, damping_ratio, samples):
        ratio = stretch.damping_ratio + modes.added_damping_ratio
        poles = poles_of(modes.angular_frequency_rad_s, ratio)
        driven = [driven_states(poles, modes, plane, p, sampling_rate_hz) for p in stretch.pulses]
        for first in range(0, len(poles), _MODES_AT_ONCE):
            block = np.arange(first, min(first + _MODES_AT_ONCE, len(poles)))
            states = np.array([
                state_of(poles[m], stretch, [d[:, m] for d in driven], sampling_rate_hz, carried[m])
                for m in block
            ])  # fmt: skip
            carried[block] = states[:, -1]
            ringing = (poles[block, None] ** 2 * states).imag / poles[block, None].imag
            recorded = slice(max(0, stretch.begin), stretch.end)
            out[:, recorded] += seen[:, block] @ ringing[:, recorded.start - stretch.begin :]
    for pulse in pulses:
        places, force = samples_of(pulse, samples)
        out[:, places] += np.outer(seen @ _pushed(modes, plane, pulse), force)
    return out


def stretches(pulses: Sequence[Pulse], damping_ratio: float, samples: int) -> Sequence[Stretch]:
    """Cut the recording where the damping ratio changes: at the first sample of a pulse."""
    begin = min([0, *(pulse.first for pulse in pulses)])
    found: list[Stretch] = [Stretch(begin, samples, damping_ratio, ())]
    for pulse in pulses:
        last, stated_ratio = found[-1], pulse.strike.damping_ratio
        ratio = damping_ratio if math.isnan(stated_ratio) else stated_ratio
        if ratio == last.damping_ratio:
            found[-1] = replace(last, pulses=(*last.pulses, pulse))
        else:
            found[-1] = replace(last, end=pulse.first)
            found.append(Stretch(pulse.first, samples, ratio, (pulse,)))
    return [stretch for stretch in found if stretch.end > stretch.begin]


def poles_of(angular_frequency: FloatArray, damping_ratio: float | FloatArray) -> ComplexArray:
    """Return poles in rad/s, (modes,)."""
    return np.asarray(
        angular_frequency * (-damping_ratio + 1j * np.sqrt(1 - damping_ratio**2)), complex
    )


def driven_states(
    poles: ComplexArray, modes: PlaneModes, plane: Plane, pulse: Pulse, sampling_rate_hz: float
) -> ComplexArray:
    """Return what a pulse adds to each mode's state in each sample interval, (samples, modes)."""
    return driven_unit_states(poles, pulse, sampling_rate_hz) * _pushed(modes, plane, pulse)


def driven_unit_states(poles: ComplexArray, pulse: Pulse, sampling_rate_hz: float) -> ComplexArray:
    """Return the same for modes that take the whole force, (samples, modes)."""
    steps = pulse.fine_n.shape[1] - 1
    step_s = 1 / (sampling_rate_hz * steps)
    weights = np.full(steps + 1, 2 * step_s / 3)
    weights[1::2] *= 2
    weights[[0, -1]] /= 2
    remaining = step_s * (steps - np.arange(steps + 1))
    return np.asarray(pulse.fine_n @ (weights[:, None] * np.exp(remaining[:, None] * poles)))


def state_of(
    pole: complex,
    stretch: Stretch,
    driven: Sequence[ComplexArray],
    sampling_rate_hz: float,
    carried: complex = 0j,
) -> ComplexArray:
    """Return the complex state of one mode over a stretch; `carried` is that just before it.

    `driven` holds what each pulse adds to it, (samples of the pulse,).
    """
    added = np.zeros(stretch.end - stretch.begin, complex)
    for pulse, share in zip(stretch.pulses, driven, strict=True):
        begin = pulse.first + 1 - stretch.begin
        room = max(0, len(added) - begin)
        added[begin : begin + len(share)] += share[:room]
    factor = np.exp(pole / sampling_rate_hz)
    return np.asarray(
        scipy.signal.lfilter([1.0], [1.0, -factor], added, zi=[factor * carried])[0], complex
    )


def _pushed(modes: PlaneModes, plane: Plane, pulse: Pulse) -> FloatArray:
    """Return each mode's deflection at a pulse, times its fraction of the force, (modes,)."""
    at_hammer = modes.at(np.array([pulse.strike.x_m]))[0]
    pushed = np.asarray(at_hammer * pulse.strike.share(plane))
    if modes.other is None:
        return pushed
    return pushed + _pushed(modes.other, PLANES[1 - PLANES.index(plane)], pulse)


@dataclass(frozen=True, eq=False)
class Line:
    """One sensor's cable at the logger's input: `values` (samples,) without the logger's noise.

    The converter's codes span `full_range` to either side; beyond `limit` the signal saturates.
    """

    name: str
    quantity: Quantity
    values: FloatArray
    plane: Plane | None
    x_m: float
    noise_sd: float
    full_range: float
    limit: float = math.inf


def logged(line: Line, bits: int, rng: np.random.Generator) -> Channel:
    """Return a line with noise, quantised to `bits` over plus and minus its range, clipped."""
    codes = 2 ** (bits - 1)
    step = line.full_range / codes
    noisy = line.values + line.noise_sd * rng.standard_normal(len(line.values))
    held = np.clip(np.round(noisy / step), -codes, codes - 1) * step
    values = np.clip(held, -line.limit, line.limit)
    return Channel(line.name, line.quantity, values, line.plane, line.x_m)
