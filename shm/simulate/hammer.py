"""A hammer test from the planted state to the recording that the crew brings home."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from shm.simulate.elements import modes_below, plane_modes
from shm.simulate.logger import log
from shm.simulate.pulse import Pulse, draw_pulses, samples_of
from shm.simulate.response import accelerations
from shm.simulate.state import HammerPlan, HangerState, check
from shm.values import NAN, PLANES, Channel, FloatArray, Hanger, Recording


def hammer_test(
    hanger: Hanger,
    state: HangerState,
    plan: HammerPlan,
    rng: np.random.Generator,
    *,
    time: datetime | None = None,
    temperature_c: float = NAN,
    source: str = "simulated",
) -> Recording:
    """One continuous recording of all hits: `force`, then `acc_1` (transverse), `acc_2`
    (longitudinal) of the first sensor, `acc_3`, `acc_4` of the second, and so on.

    The logger filters force and accelerations alike (linear phase, flat to 0.4 of the sampling
    rate, -100 dB from 0.5), so nothing is aliased and their ratio is the true accelerance. Modes
    up to twice the sampling rate take part; those above half of it are not excited and only add
    their quasi-static share. The hanger is at rest before the first hit. The same generator state
    gives the same recording. Raises UsageError for a state or plan that cannot be.
    """
    check(hanger, state, plan)
    pulses = draw_pulses(plan, rng)
    force = log(_force(pulses, plan), plan.force_noise_n, plan.force_range_n, plan.adc_bits, rng)
    signals = _accelerations(hanger, state, plan, pulses)
    channels = [Channel("force", "force", force, x_m=plan.hammer_place_m(hanger))]
    for index, x_m in enumerate(plan.sensor_places_m(hanger)):
        for number, plane in enumerate(PLANES):
            values = log(
                signals[number, index],
                plan.acceleration_noise_m_s2,
                plan.acceleration_range_m_s2,
                plan.adc_bits,
                rng,
            )
            name = f"acc_{2 * index + number + 1}"
            channels.append(Channel(name, "acceleration", values, plane, x_m))
    return Recording(source, tuple(channels), plan.sampling_rate_hz, hanger.id, time, temperature_c)


def _force(pulses: Sequence[Pulse], plan: HammerPlan) -> FloatArray:
    force = np.zeros(plan.samples)
    for pulse in pulses:
        places, values = samples_of(pulse, plan.samples)
        force[places] += values
    return force


def _accelerations(
    hanger: Hanger, state: HangerState, plan: HammerPlan, pulses: Sequence[Pulse]
) -> FloatArray:
    """Noise-free accelerations, shape (planes, sensors, samples)."""
    modes = modes_below(hanger, state, 2 * plan.sampling_rate_hz)
    angle = math.radians(plan.hammer_angle_deg)
    shares = (math.cos(angle), math.sin(angle))
    return np.array(
        [
            share
            * accelerations(
                plane_modes(hanger, state, plane, modes),
                state.damping_ratio,
                pulses,
                plan.hammer_place_m(hanger),
                plan.sensor_places_m(hanger),
                plan.sampling_rate_hz,
                plan.samples,
            )
            for plane, share in zip(PLANES, shares, strict=True)
        ]
    )
