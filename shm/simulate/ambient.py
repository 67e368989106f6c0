"""A hanger in wind and traffic: nobody hits, no force is recorded.

Each mode is driven by independent impulses at the samples, equally strong in all modes: white,
spatially uncorrelated forces. Sampled so, a mode is an autoregression with the exact pole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from shm.simulate.elements import modes_below, plane_modes
from shm.simulate.response import Line, logged, poles_of
from shm.simulate.state import HammerPlan, HangerState, check
from shm.values import PLANES, ComplexArray, FloatArray, Hanger, Recording

_HIGHEST = 0.4  # of the sampling rate: what the logger passes


@dataclass(frozen=True)
class AmbientPlan:
    """How long the crew listens, with which sensors and logger.

    `acceleration_m_s2` is the rms value at the sensor and in the plane that move most. The rest is
    as in `HammerPlan`.
    """

    seconds: float = 600.0
    sampling_rate_hz: float = 512.0
    sensors_x_m: tuple[float, ...] = ()
    acceleration_m_s2: float = 0.05
    acceleration_noise_m_s2: float = 0.002
    adc_bits: int = 24
    acceleration_range_m_s2: float = 200.0


def ambient_test(
    hanger: Hanger, state: HangerState, plan: AmbientPlan, rng: np.random.Generator
) -> Recording:
    """A recording of `acc_1` (transverse), `acc_2` (longitudinal) and so on, without force.

    Modes up to 0.4 of the sampling rate take part, in steady state from the first sample on.
    Raises UsageError for a state or plan that cannot be.
    """
    listening = _as_one_hit(plan)
    check(hanger, state, listening)
    places = listening.sensor_places_m(hanger)
    moved = np.array([_moved(hanger, state, i, listening, rng) for i in range(len(PLANES))])
    moved *= plan.acceleration_m_s2 / np.sqrt(np.mean(moved**2, axis=2)).max()
    lines = [
        Line(f"acc_{2 * index + number + 1}", "acceleration", moved[number, index], plane, x_m,
             plan.acceleration_noise_m_s2, plan.acceleration_range_m_s2)
        for index, x_m in enumerate(places)
        for number, plane in enumerate(PLANES)
    ]  # fmt: skip
    channels = tuple(logged(line, plan.adc_bits, rng) for line in lines)
    return Recording("simulated", channels, plan.sampling_rate_hz, hanger.id)


def _as_one_hit(plan: AmbientPlan) -> HammerPlan:
    """The same sensors and logger over one slot, for what both kinds of test share."""
    return replace(
        HammerPlan(hits=1, sensors_x_m=plan.sensors_x_m, adc_bits=plan.adc_bits),
        seconds_per_hit=plan.seconds,
        sampling_rate_hz=plan.sampling_rate_hz,
        acceleration_noise_m_s2=plan.acceleration_noise_m_s2,
        acceleration_range_m_s2=plan.acceleration_range_m_s2,
    )


def _moved(
    hanger: Hanger, state: HangerState, plane: int, plan: HammerPlan, rng: np.random.Generator
) -> FloatArray:
    """Accelerations of a plane under forces of any strength, (sensors, samples)."""
    highest_hz = _HIGHEST * plan.sampling_rate_hz
    modes = plane_modes(hanger, state, PLANES[plane], modes_below(hanger, state, highest_hz))
    seen = modes.at(np.array(plan.sensor_places_m(hanger)))
    ratio = state.damping_ratio + modes.added_damping_ratio
    poles = poles_of(modes.angular_frequency_rad_s, ratio)
    out = np.zeros((len(seen), plan.samples))
    for mode in np.flatnonzero(np.abs(poles) < 2 * math.pi * highest_hz):
        pole = complex(poles[mode])
        state_of_mode = _steady_state(pole / plan.sampling_rate_hz, plan.samples, rng)
        out += np.outer(seen[:, mode], (pole**2 * state_of_mode).imag / pole.imag)
    return out


def _steady_state(exponent: complex, samples: int, rng: np.random.Generator) -> ComplexArray:
    """z[k + 1] = exp(exponent) z[k] + a unit normal impulse, as if driven for ever, (samples,).

    Before the first sample z has the covariance that the recursion keeps: E|z|^2 = 1/(1 - |a|^2)
    and E z^2 = 1/(1 - a^2), a = exp(exponent).
    """
    factor = np.exp(exponent)
    power, pseudo = 1 / (1 - abs(factor) ** 2), 1 / (1 - factor**2)
    covariance = 0.5 * np.array(
        [[power + pseudo.real, pseudo.imag], [pseudo.imag, power - pseudo.real]]
    )
    real, imaginary = np.linalg.cholesky(covariance) @ rng.standard_normal(2)
    first = factor * (real + 1j * imaginary)
    impulses = rng.standard_normal(samples).astype(complex)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -factor], impulses, zi=[first])[0], complex)
