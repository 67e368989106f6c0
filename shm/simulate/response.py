"""Accelerations of one plane under hammer pulses, by modal superposition.

A mode of damped angular frequency w_d and pole s obeys z' = s z + f for its complex state z; its
deflection is Im(z)/w_d and its acceleration Im(s^2 z)/w_d + f. From sample to sample z is exact;
the force within a sample is summed by Simpson's rule on the fine steps. Once a band-limited pulse
is over, that sum is exact but for the pulse's content beyond half the fine rate (L. N. Trefethen
and J. A. C. Weideman, SIAM Review 56, 2014).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.simulate.elements import PlaneModes
from shm.simulate.strikes import Pulse, samples_of
from shm.values import PLANES, ComplexArray, FloatArray, Plane

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
    """Accelerations of a plane in m/s^2, shape (sensors, samples).

    Each pulse acts where and in which direction its blow struck. From a blow with a damping ratio
    of its own up to the next blow, everything decays with that one.
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
            kept = slice(max(0, stretch.begin), stretch.end)
            out[:, kept] += seen[:, block] @ ringing[:, kept.start - stretch.begin :]
    for pulse in pulses:
        places, force = samples_of(pulse, samples)
        out[:, places] += np.outer(seen @ _pushed(modes, plane, pulse), force)
    return out


def stretches(pulses: Sequence[Pulse], damping_ratio: float, samples: int) -> Sequence[Stretch]:
    """The recording cut where the damping ratio changes: at the first sample of a pulse."""
    begin = min([0, *(pulse.first for pulse in pulses)])
    found: list[Stretch] = [Stretch(begin, samples, damping_ratio, ())]
    for pulse in pulses:
        last, own = found[-1], pulse.strike.damping_ratio
        ratio = damping_ratio if math.isnan(own) else own
        if ratio == last.damping_ratio:
            found[-1] = replace(last, pulses=(*last.pulses, pulse))
        else:
            found[-1] = replace(last, end=pulse.first)
            found.append(Stretch(pulse.first, samples, ratio, (pulse,)))
    return [stretch for stretch in found if stretch.end > stretch.begin]


def poles_of(angular_frequency: FloatArray, damping_ratio: float | FloatArray) -> ComplexArray:
    """Poles in rad/s, (modes,)."""
    return np.asarray(
        angular_frequency * (-damping_ratio + 1j * np.sqrt(1 - damping_ratio**2)), complex
    )


def driven_states(
    poles: ComplexArray, modes: PlaneModes, plane: Plane, pulse: Pulse, sampling_rate_hz: float
) -> ComplexArray:
    """What a pulse adds to each mode's state within each sample interval, (samples, modes)."""
    return driven_unit_states(poles, pulse, sampling_rate_hz) * _pushed(modes, plane, pulse)


def driven_unit_states(poles: ComplexArray, pulse: Pulse, sampling_rate_hz: float) -> ComplexArray:
    """The same for modes that take the whole force, (samples, modes)."""
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
    """The complex state of one mode over a stretch; `carried` is that just before it.

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
    """Each mode's deflection where a pulse acts, times its share of the force, (modes,)."""
    at_hammer = modes.at(np.array([pulse.strike.x_m]))[0]
    pushed = np.asarray(at_hammer * pulse.strike.share(plane))
    if modes.other is None:
        return pushed
    return pushed + _pushed(modes.other, PLANES[1 - PLANES.index(plane)], pulse)
