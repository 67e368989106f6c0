"""Accelerations of one plane under hammer pulses, by modal superposition.

A mode of damped angular frequency w_d and pole s obeys z' = s z + f for its complex state z; its
deflection is Im(z)/w_d and its acceleration Im(s^2 z)/w_d + f. From sample to sample z is exact;
the force within a sample is summed by Simpson's rule on the fine steps. Once a band-limited pulse
is over, that sum is exact but for the pulse's content beyond half the fine rate (L. N. Trefethen
and J. A. C. Weideman, SIAM Review 56, 2014).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from shm.simulate.elements import PlaneModes
from shm.simulate.pulse import Pulse, samples_of
from shm.values import ComplexArray, FloatArray


def accelerations(
    modes: PlaneModes,
    damping_ratio: float,
    pulses: Sequence[Pulse],
    hammer_x_m: float,
    sensors_x_m: Sequence[float],
    sampling_rate_hz: float,
    samples: int,
) -> FloatArray:
    """Accelerations in m/s^2, shape (sensors, samples), of pulses that act at `hammer_x_m`."""
    excited = modes.at(np.array([hammer_x_m]))[0]
    seen = modes.at(np.array(sensors_x_m))
    poles = _poles(modes.angular_frequency_rad_s, damping_ratio)
    driven = [_driven(poles, pulse, sampling_rate_hz) for pulse in pulses]
    out = np.zeros((len(seen), samples))
    for mode, pole in enumerate(poles):
        state = _state(pole, mode, pulses, driven, sampling_rate_hz, samples)
        out += np.outer(seen[:, mode] * excited[mode] / pole.imag, (pole**2 * state).imag)
    for pulse in pulses:
        places, force = samples_of(pulse, samples)
        out[:, places] += np.outer(seen @ excited, force)
    return out


def _poles(angular_frequency: FloatArray, damping_ratio: float) -> ComplexArray:
    return np.asarray(
        angular_frequency * (-damping_ratio + 1j * np.sqrt(1 - damping_ratio**2)), complex
    )


def _driven(poles: ComplexArray, pulse: Pulse, sampling_rate_hz: float) -> ComplexArray:
    """What a pulse adds to each mode's state within each sample interval, (samples, modes)."""
    steps = pulse.fine_n.shape[1] - 1
    step_s = 1 / (sampling_rate_hz * steps)
    weights = np.full(steps + 1, 2 * step_s / 3)
    weights[1::2] *= 2
    weights[[0, -1]] /= 2
    remaining = step_s * (steps - np.arange(steps + 1))
    return np.asarray(pulse.fine_n @ (weights[:, None] * np.exp(remaining[:, None] * poles)))


def _state(
    pole: complex,
    mode: int,
    pulses: Sequence[Pulse],
    driven: Sequence[ComplexArray],
    sampling_rate_hz: float,
    samples: int,
) -> ComplexArray:
    """The complex state of one mode at the samples, at rest before the first pulse."""
    lead = max(0, -min(pulse.first for pulse in pulses))
    added = np.zeros(lead + samples, complex)
    for pulse, share in zip(pulses, driven, strict=True):
        begin = lead + pulse.first + 1
        room = max(0, len(added) - begin)
        added[begin : begin + len(share)] += share[:room, mode]
    state = lfilter([1.0], [1.0, -np.exp(pole / sampling_rate_hz)], added)
    return np.asarray(state[lead:], complex)
